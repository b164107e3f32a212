"""Sections about contacts and forces."""

import numpy as np

from pretouch.reporting.contacts import GRACE_S, Detection
from pretouch.reporting.html import NOTHING, Html, Text, bad, element, joined, note, number, percent, table, vector
from pretouch.reporting.measures import Measures
from pretouch.reporting.orientation import REGIONS, SOURCE, Region
from pretouch.reporting.touches import BOUNCE_S, TRANSIENT_S
from pretouch.types import FloatArray, Mode

_ROWS = 40
"""Contacts and touches that are listed; touches that were not answered are listed up to `_MOST`."""
_MOST = 200
_AXES = "xyz"
_FORCE = {
    True: "Force: norm of the estimate above the window's mean",
    False: "Force: at the end-effector, as the joint torques beyond those of free motion tell it; the contact may be"
    " elsewhere. Axes: where that passes the band of one sample, or is nearest to it",
}
"""What a contact's force is, by whether the paper's thresholds detect it."""


def contact_section(m: Measures) -> Html:
    """Detected contacts and, where it is known, what truly touched and what was missed."""
    parts: list[Html] = [_detected(m)]
    if not m.truth_known:
        parts.append(note("True touches are not known: delays, missed touches and false detections cannot be counted."))
    else:
        parts += [_touched(m), _false(m)]
    return joined(parts)


def _detected(m: Measures) -> Html:
    if not m.detections:
        return element("p", "No contact was detected.")
    head = [
        "no.", "axes", "towards", "time [s]", "force [N]", "direction x y z", "filtered x y z [N]", "raw x y z [N]",
        "peak x y z [N]", "reaction [m/s]", "lasted [s]", "moved [s]",
    ]  # fmt: skip
    rows = [_detection(i, d) for i, d in enumerate(m.detections[:_ROWS], 1)]
    if len(m.course.runs) > 1:
        head.append("profile")
        rows = [[*row, m.course.runs[d.run].profile.name] for row, d in zip(rows, m.detections, strict=False)]
    return joined([
        element("h4", "Detected contacts"),
        table(head, rows, words=3),
        *_left_out(len(m.detections), len(rows)),
        note(
            f"{_FORCE[m.course.by_thresholds]}; on the arm, base frame. Filtered: value of eq. 8."
            " Raw: the estimate. Peak: on each axis the estimate farthest from zero during the contact. Held still: the"
            " contact was below what moves the arm."
        ),
    ])  # fmt: skip


def _detection(order: int, d: Detection) -> list[Text]:
    return [
        str(order), " ".join(a for a, hit in zip(_AXES, d.axes, strict=True) if hit),
        heading(d.force), number(d.time, 2), number(float(np.linalg.norm(d.force)), 1), vector(_unit(d.force), 2),
        vector(d.filtered, 1), vector(d.raw, 1), vector(d.peak, 1), number(d.reaction_speed, 3),
        number(d.reaction_s, 2), number(d.moved_s, 2) if d.moved_s else "held still",
    ]  # fmt: skip


def _touched(m: Measures) -> Html:
    if not m.touches:
        return element("p", "Nothing truly touched the arm.")
    head = (
        "no.", "first link", "answered by", "time [s]", "duration [s]", "delay [ms]", "speed [m/s]", "true peak [N]",
        "true 20 ms [N]", f"held {TRANSIENT_S:g} s [N]",
    )  # fmt: skip
    answers = {d.touch: (i, d) for i, d in reversed(list(enumerate(m.detections, 1)))}
    modes = {unanswered.index: unanswered.mode for unanswered in m.unanswered}
    rows: list[list[Text]] = []
    for i, touch in enumerate(m.touches):
        if len(rows) >= (_ROWS if i in answers else _MOST):
            continue
        order, detection = answers.get(i, (0, None))
        said = f"contact {order}" if detection else _why(modes[i])
        rows.append([
            str(i + 1), touch.link or NOTHING, said, number(touch.start, 3), number(touch.end - touch.start, 3),
            number(detection.delay if detection else None, 0, 1000.0), number(float(np.linalg.norm(touch.velocity)), 3),
            number(touch.peak, 1), number(touch.peak_20ms, 1), number(touch.held, 1),
        ])  # fmt: skip
    return joined([
        element("h4", "True touches (simulation)"),
        table(head, rows, words=3),
        *_left_out(len(m.touches), len(rows)),
        note(
            "A touch begins as the true force passes 1 N; the delay runs from there to the detection. Interruptions of"
            f" less than {BOUNCE_S:g} s are bounces of one touch. Speed: of the point of the arm that touched first."
        ),
    ])  # fmt: skip


def _why(mode: Mode | None) -> Text:
    if mode is Mode.REACT:
        return "none: the arm was yielding already"
    return bad("missed" + (" in HOLD" if mode is Mode.HOLD else ""))


def _false(m: Measures) -> Html:
    """Say which detections no touch explains."""
    false = [f"contact {i} at {d.time:.2f} s" for i, d in enumerate(m.detections, 1) if d.touch is None]
    if not false:
        return element("p", "Every detection answers a true touch.") if m.detections else Html("")
    shown = ", ".join(false[:_ROWS]) + (" ..." if len(false) > _ROWS else "")
    return element(
        "p", bad(f"Detections without a touch under way or over for less than {GRACE_S:g} s: {len(false)} ({shown}).")
    )


def _left_out(count: int, shown: int) -> list[Html]:
    return [note(f"{count - shown} more are left out here; all count in the summary.")] if count > shown else []


def _unit(force: FloatArray) -> FloatArray:
    norm = float(np.linalg.norm(force))
    return force / norm if norm > 0 else np.full(3, np.nan)


def heading(force: FloatArray) -> str:
    """Base axis that a force points along most, with its sign."""
    if not np.all(np.isfinite(force)) or not np.any(force):
        return NOTHING
    axis = int(np.abs(force).argmax())
    return ("+" if force[axis] > 0 else "−") + _AXES[axis]


def orientation_section(m: Measures) -> Html:
    """The largest forces beside what regions of the body are said to bear."""
    source = "true force, as the simulation knows it" if m.truth_known else "force estimate during detected contacts"
    said = f"Largest {source}: {number(m.peak, 1)} N; later than {TRANSIENT_S:g} s into a contact: {_held(m)}."
    head = ("body region", "transient [N]", "of it", "quasi-static [N]", "of it", "")
    rows = [_region(region, m) for region in REGIONS]
    unsure = "" if m.truth_known else (
        " The estimate has a bandwidth of about 10 Hz and understates the peaks of impacts, and contacts that were not"
        " detected are not in it."
    )  # fmt: skip
    return joined([
        element("p", said),
        table(head, rows),
        note(
            f"For orientation, not conformity. Figures: {SOURCE}. Public copies of such tables disagree."
            " The transient figure is held against the largest force, the quasi-static one"
            f" against the largest 20 ms mean later than {TRANSIENT_S:g} s into a contact"
            f"{'' if m.truth_known else ' (here of the estimate as it is)'}. Which region would be hit, and over what"
            f" area, is not known here; pressures are not looked at.{unsure}"
        ),
    ])  # fmt: skip


def _held(m: Measures) -> str:
    return "none" if m.held is None else f"{m.held:.1f} N"


def _region(region: Region, m: Measures) -> list[Text]:
    transient = m.peak / region.transient if m.peak is not None and region.transient else None
    lasting = m.held / region.quasi_static if m.held is not None else None
    return [
        region.name, number(region.transient, 0), _marked(transient), number(region.quasi_static, 0), _marked(lasting),
        _bar(max((share for share in (transient, lasting) if share is not None), default=None)),
    ]  # fmt: skip


def _marked(share: float | None) -> Text:
    return bad(percent(share)) if share is not None and share > 1 else percent(share)


def _bar(share: float | None) -> Html:
    if share is None:
        return Html("")
    kind = "bar over" if share > 1 else "bar"
    return Html(f'<div class="{kind}"><div style="width:{100 * min(share, 1.0):.0f}%"></div></div>')
