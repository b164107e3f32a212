"""The pages, one HTML file each with all in it: a report of a recording, and what `pretouch detect` found in one."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pretouch.contact.scatter import HELD_S
from pretouch.explanation import LOUD_N
from pretouch.reporting import measures
from pretouch.reporting.contacts import ContactMeasures, contact_section
from pretouch.reporting.figures import force_figure, motion_figure, picture, style
from pretouch.reporting.health import health_section
from pretouch.reporting.html import Html, Text, bad, document, element, joined, percent, table_html
from pretouch.reporting.measures import Measures
from pretouch.reporting.record import RunCourse
from pretouch.reporting.setting import parameter_section, setting_section, started
from pretouch.text_table import TextTable
from pretouch.types import Mode

_SHADED = "Red: REACT, grey: HOLD."


def page(m: Measures) -> str:
    """Make the page of a recording."""
    with style():
        body = joined([element("h1", "Pretouch report"), *_recording(m)])
    return document(f"Pretouch report: {m.title}", body)


def _recording(m: Measures) -> list[Text]:
    course = m.course
    forces = (
        "Force on the arm and contact thresholds by axis, base frame; evidence, a contact from 1 on."
        if course.by_thresholds
        else "Force on the arm by axis, base frame, with the bands in which one sample of it alone would be no contact."
        " What decides is the evidence, made of all joint torques and many samples: a contact from 1 on."
    )
    prefix = "Sensed distances from the body, s" if course.proximity_used else "S"
    return [
        element("h2", m.title),
        summary(m),
        element("h3", "What ran"),
        setting_section(course),
        element("h3", "Contacts"),
        contact_section(course, m.contacts),
        picture(force_figure(course), f"{forces} {_SHADED}"),
        element("h3", "Distances"),
        measures.distance_section(course),
        element("h3", "Speed"),
        measures.speed_section(course),
        picture(motion_figure(course), f"{prefix}peed of the end-effector, and speed factor. {_SHADED}"),
        element("h3", "Modes and quadratic program"),
        measures.mode_section(course),
        element("h3", "Limits of the arm"),
        measures.limit_section(course),
        element("h3", "Units, robot and loop"),
        health_section(course),
        element("h3", "Largest forces"),
        measures.force_section(m.contacts),
        element("h3", "Parameters"),
        parameter_section(course),
    ]


def summary(m: Measures) -> Html:
    """Say the most important of a recording."""
    of_truth, peak = m.contacts.truth_known, m.contacts.peak
    shares = {mode: percent(share) for mode, (_, share) in measures.time_in_modes(m.course).items()}
    sentences: list[Text] = [
        _what(m.course),
        _contacts(m.contacts),
        _detectable(m.course),
        f"The largest {'true force' if of_truth else 'force estimate during a contact'} was {peak:.1f} N."
        if peak
        else "",
        _nearest(m.course),
        f"The arm followed its path for {shares[Mode.TRACK]} of the time, yielded for {shares[Mode.REACT]} and held for"
        f" {shares[Mode.HOLD]}.",
        bad(f"Limits of the arm were exceeded: {', '.join(m.exceeded)}.")
        if m.exceeded
        else "No joint limit was exceeded.",
        bad(m.lacking) if m.lacking else "",
    ]
    return element("p", joined((sentence for sentence in sentences if sentence), " "), "summary")


def _what(course: RunCourse) -> str:
    names, first, seconds = course.profile_names, course.runs[0], float(course.lasted.sum())
    minutes, rest = divmod(round(seconds), 60)
    lasted = f"{minutes} min {rest} s" if minutes else f"{seconds:.1f} s"
    units = f"{len(course.units)} unit{'s' if len(course.units) != 1 else ''}"
    listed = " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]
    return (
        f"{lasted} of {first.model.description.name} with {units}, profile{'s' if len(names) > 1 else ''} {listed},"
        f" begun {started(first)}."
    )


def _contacts(c: ContactMeasures) -> Text:
    count, unmoved = len(c.detections), sum(not d.moved_s for d in c.detections)
    sentence = f"{count or 'No'} contact{'s' if count != 1 else ''} {'were' if count != 1 else 'was'} detected"
    sentence += f", {unmoved} of which did not move the arm" if unmoved else ""
    if not c.truth_known:
        return f"{sentence}; what truly touched is not known."
    if c.delays:
        sentence += f", {1000 * float(np.median(c.delays)):.0f} ms (median) after the true touch"
    wrong = f"; {len(c.missed)} of {len(c.touches)} true touches missed, {len(c.without_touch)} detections without one."
    return joined([sentence, bad(wrong) if c.missed or c.without_touch else wrong], "")


def _detectable(course: RunCourse) -> Text:
    """Say what force the detector finds, as `ControlStep.detectable_n`."""
    forces = course.detectable_n[course.armed & ~np.isnan(course.detectable_n)]
    if not len(forces):
        return ""
    half, most = (float(np.quantile(forces, share, method="inverted_cdf")) for share in (0.5, 0.95))
    sentence = (
        f"A force that is held on the end-effector for {HELD_S:g} s is found from {half:.0f} N on half of the time, and"
        f" from {most:.0f} N on 95 % of the time."
    )
    return sentence if most <= LOUD_N else bad(sentence)


def _nearest(course: RunCourse) -> str:
    nearest = measures.nearest_to_body(course)
    if not course.proximity_used:
        return "Proximity was not used."
    if nearest is None:
        return "Nothing was sensed near the arm."
    where = f"{nearest.name}, at {nearest.time:.1f} s"
    return f"The nearest obstacle sensed was {nearest.distance:.3f} m from the body ({where})."


def detection_page(
    title: str, sentences: Sequence[str], tables: Sequence[TextTable], figures: Sequence[tuple[Figure, str]]
) -> str:
    """Make the page of what detectors found: sentences, tables, and figures with what they show."""
    with style():
        drawn = [picture(figure, text) for figure, text in figures]
    head = [element("h1", f"Contacts in {title}"), *(element("p", sentence, "summary") for sentence in sentences[:1])]
    notes = [element("ul", joined(element("li", text) for text in sentences[1:]))] if sentences[1:] else []
    return document(f"Contacts in {title}", joined([*head, *notes, *map(table_html, tables), *drawn]))
