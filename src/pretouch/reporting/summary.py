"""One recording in a few sentences, and several side by side."""

from collections.abc import Sequence

import numpy as np

from pretouch.contact.scatter import HELD_S
from pretouch.explanation import LOUD_N
from pretouch.reporting.html import Html, Text, bad, element, joined, note, number, percent, table
from pretouch.reporting.measures import Measures
from pretouch.reporting.sections.setting import started
from pretouch.types import FloatArray, Mode


def summary(m: Measures) -> Html:
    """Say the most important of a recording."""
    if not len(m.course):
        return element("p", "The recording holds no control step.", "summary")
    sentences: list[Text] = [_what(m), _contacts(m), _found(m), _forces(m), _nearest(m), _modes(m)]
    if m.violations:
        sentences.append(bad(f"Limits of the arm were exceeded: {', '.join(m.violations)}."))
    else:
        sentences.append("No joint limit was exceeded.")
    if not m.complete:
        sentences.append(bad(m.said or "The file is not complete."))
    return element("p", joined((s for s in sentences if s), " "), "summary")


def _what(m: Measures) -> str:
    names = list(dict.fromkeys(run.profile.name for run in m.course.runs))
    first = m.course.runs[0]
    units = f"{len(m.course.units)} unit{'s' if len(m.course.units) != 1 else ''}"
    return (
        f"{_time(m.duration)} of {first.model.description.name} with {units}, profile{'s' if len(names) > 1 else ''}"
        f" {_listed(names)}, begun {started(first)}."
    )


def _contacts(m: Measures) -> Text:
    found = len(m.detections)
    said = f"{found or 'No'} contact{'s' if found != 1 else ''} {'were' if found != 1 else 'was'} detected"
    unmoved = sum(not d.moved_s for d in m.detections)
    said += f", {unmoved} of which did not move the arm" if unmoved else ""
    if not m.truth_known:
        return f"{said}; what truly touched is not known."
    delays = [d.delay for d in m.detections if d.delay is not None]
    after = f", {1000 * float(np.median(delays)):.0f} ms (median) after the true touch" if delays else ""
    wrong = f"; {len(m.missed)} of {len(m.touches)} true touches missed, {len(m.without_touch)} detections without one."
    return joined([said + after, bad(wrong) if m.missed or m.without_touch else Html(wrong)], "")


def _found(m: Measures) -> Text:
    """Say what force the detector finds, as `Detection.detectable_n`."""
    said = m.course.detectable_n[m.course.armed & ~np.isnan(m.course.detectable_n)]
    if not len(said):
        return ""
    half, most = (float(np.quantile(said, share, method="inverted_cdf")) for share in (0.5, 0.95))
    sentence = (
        f"A force that is held on the end-effector for {HELD_S:g} s is found from {half:.0f} N on half of the time, and"
        f" from {most:.0f} N on 95 % of the time."
    )
    return sentence if most <= LOUD_N else bad(sentence)


def _forces(m: Measures) -> str:
    if m.peak is None or not m.peak:
        return ""
    which = "true force" if m.truth_known else "force estimate during a contact"
    return f"The largest {which} was {m.peak:.1f} N."


def _nearest(m: Measures) -> str:
    d = m.distances.body
    if not m.course.proximity_used:
        return "Proximity was not used."
    if d is None:
        return "Nothing was sensed near the arm."
    return f"The nearest obstacle sensed was {d.distance:.3f} m from the body ({d.name}, at {d.time:.1f} s)."


def _modes(m: Measures) -> str:
    share = m.states.share
    return (
        f"The arm followed its path for {percent(share[Mode.TRACK])} of the time, yielded for"
        f" {percent(share[Mode.REACT])} and held for {percent(share[Mode.HOLD])}."
    )


def comparison(rows: Sequence[Sequence[Text]]) -> Html:
    """Put several recordings side by side, from what `compared` says of each."""
    head = (
        "recording", "profiles", "duration [s]", "contacts", "missed", "without touch", "delay [ms]", "filtered [N]",
        "raw [N]", "largest force [N]", "nearest [m]", "fastest [m/s]", "REACT", "HOLD",
    )  # fmt: skip
    return joined([
        table(head, rows, words=2),
        note(
            "Delay, filtered and raw: medians, of forces the norm at the detection. Largest force: the true one where"
            " it is known (*), else the estimate during a contact."
        ),
    ])  # fmt: skip


def compared(order: int, m: Measures) -> list[Text]:
    """Row of a recording in the comparison; `order` counts the recordings of the page from 1."""
    link = Html(f'<a href="#recording-{order}">{element("span", m.title)}</a>')
    names = dict.fromkeys(run.profile.name for run in m.course.runs)
    delays = [d.delay for d in m.detections if d.delay is not None]
    fastest = m.speeds.all
    return [
        link if m.complete else joined([link, bad(" (incomplete)")], ""), ", ".join(names), number(m.duration, 1),
        str(len(m.detections)), str(len(m.missed)) if m.truth_known else "?",
        str(len(m.without_touch)) if m.truth_known else "?",
        number(float(np.median(delays)) if delays else None, 0, 1000.0),
        number(_median_norm([d.filtered for d in m.detections]), 1),
        number(_median_norm([d.raw for d in m.detections]), 1),
        number(m.peak, 1) + ("*" if m.truth_known else ""),
        number(m.distances.body.distance if m.distances.body else None, 3), number(fastest.max if fastest else None, 3),
        percent(m.states.share[Mode.REACT]), percent(m.states.share[Mode.HOLD]),
    ]  # fmt: skip


def _median_norm(forces: Sequence[FloatArray]) -> float | None:
    """Median norm [N] of forces (3,) each, None of none."""
    return float(np.median(np.linalg.norm(np.array(forces), axis=1))) if forces else None


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{seconds:.1f} s"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)
