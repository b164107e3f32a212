"""All that a report says of one recording, in a few sentences, and several recordings side by side."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pretouch.contact.scatter import HELD_S
from pretouch.explanation import LOUD_N
from pretouch.recording.reader import Recorded
from pretouch.reporting.contacts import ContactMeasures, contacts_in
from pretouch.reporting.health import LoopHealth, UnitMeasures, loop_health, unit_health
from pretouch.reporting.html import Html, Text, bad, element, joined, number, percent, table_html
from pretouch.reporting.limits import JointMargin, States, limit_margins, states, violations
from pretouch.reporting.motion import Distances, Speeds, distances, speeds
from pretouch.reporting.record import RunCourse, gather
from pretouch.reporting.setting import started
from pretouch.text_table import TextTable
from pretouch.types import FloatArray, Mode


@dataclass(frozen=True)
class Measures:
    """One recording, measured."""

    title: str
    """Name of the file, with as much of its folder as tells it from the others."""
    lacking: str
    """What is missing of a file that is not complete, as a sentence, or ''."""
    course: RunCourse
    contacts: ContactMeasures
    distances: Distances
    speeds: Speeds
    joints: tuple[JointMargin, ...]
    states: States
    units: tuple[UnitMeasures, ...]
    loop: LoopHealth


def measure(recorded: Recorded, title: str) -> Measures:
    """Measure a recording."""
    course = gather(recorded)
    return Measures(
        title=title,
        lacking="" if recorded.complete else recorded.sentence or "The file is not complete.",
        course=course,
        contacts=contacts_in(course),
        distances=distances(course),
        speeds=speeds(course),
        joints=limit_margins(course),
        states=states(course),
        units=unit_health(course),
        loop=loop_health(course),
    )


def summary(m: Measures) -> Html:
    """Say the most important of a recording."""
    exceeded = violations(m.joints)
    sentences: list[Text] = [
        _what(m.course),
        _contacts(m.contacts),
        _detectable(m.course),
        _forces(m.contacts),
        _nearest(m),
        f"The arm followed its path for {percent(m.states.share[Mode.TRACK])} of the time, yielded for"
        f" {percent(m.states.share[Mode.REACT])} and held for {percent(m.states.share[Mode.HOLD])}.",
        bad(f"Limits of the arm were exceeded: {', '.join(exceeded)}.") if exceeded else "No joint limit was exceeded.",
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


def _forces(c: ContactMeasures) -> str:
    which = "true force" if c.truth_known else "force estimate during a contact"
    return f"The largest {which} was {c.peak:.1f} N." if c.peak else ""


def _nearest(m: Measures) -> str:
    nearest = m.distances.body
    if not m.course.proximity_used:
        return "Proximity was not used."
    if nearest is None:
        return "Nothing was sensed near the arm."
    distance, where = f"{nearest.distance:.3f} m", f"{nearest.name}, at {nearest.time:.1f} s"
    return f"The nearest obstacle sensed was {distance} from the body ({where})."


def comparison(rows: Sequence[Sequence[Text]]) -> Html:
    """Put several recordings side by side, from what `compared` says of each."""
    headings = (
        "recording", "profiles", "duration [s]", "contacts", "missed", "without touch", "delay [ms]", "filtered [N]",
        "raw [N]", "largest force [N]", "nearest [m]", "fastest [m/s]", "REACT", "HOLD",
    )  # fmt: skip
    note = (
        "Delay, filtered and raw: medians, of forces the norm at the detection. Largest force: the true one where it is"
        " known (*), else the estimate during a contact."
    )
    return table_html(TextTable("", headings, tuple(map(tuple, rows)), note))


def compared(order: int, m: Measures) -> list[Text]:
    """Row of a recording in the comparison; `order` counts the recordings of the page from 1."""
    link = Html(f'<a href="#recording-{order}">{element("span", m.title)}</a>')
    c, body, fastest = m.contacts, m.distances.body, m.speeds.all
    return [
        joined([link, bad(" (incomplete)")], "") if m.lacking else link,
        ", ".join(m.course.profile_names),
        number(float(m.course.lasted.sum()), 1),
        str(len(c.detections)),
        str(len(c.missed)) if c.truth_known else "?",
        str(len(c.without_touch)) if c.truth_known else "?",
        number(float(np.median(c.delays)) if c.delays else None, 0, 1000.0),
        number(_median_norm([d.filtered for d in c.detections]), 1),
        number(_median_norm([d.raw for d in c.detections]), 1),
        number(c.peak, 1) + ("*" if c.truth_known else ""),
        number(body.distance if body else None, 3),
        number(fastest.max if fastest else None, 3),
        percent(m.states.share[Mode.REACT]),
        percent(m.states.share[Mode.HOLD]),
    ]


def _median_norm(forces: Sequence[FloatArray]) -> float | None:
    """Median norm [N] of forces (3,) each, None of none."""
    return float(np.median(np.linalg.norm(np.array(forces), axis=1))) if forces else None
