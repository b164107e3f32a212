"""Detected contacts, held against what truly touched, which only a simulation knows."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pretouch.recording.run_record import MODES, TrueForces
from pretouch.reporting.html import NOTHING, Html, Row, Text, bad, element, joined, number, table, vector
from pretouch.reporting.record import RunCourse
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import mean_over, spans
from pretouch.types import BoolArray, FloatArray, Mode

BOUNCE_S = 0.1
"""Touches with less than this between them are one [s]."""
TRANSIENT_S = 0.5
"""From this long after its beginning a contact counts as quasi-static [s] (ISO/TS 15066)."""
MEAN_S = 0.02
"""Length of the mean that peaks are also given of [s]."""
GRACE_S = 0.2
"""A detection this long after a touch still answers it [s]: the estimate lags, and the value of eq. 8 more."""
AXES = "xyz"
_ROWS = 40
"""Contacts and touches that are listed; touches that were not answered are listed up to `_MOST`."""
_MOST = 200
_FORCE = {
    True: "Force: norm of the estimate above the window's mean",
    False: "Force: at the end-effector, as the joint torques beyond those of free motion tell it; the contact may be"
    " elsewhere. Axes: where that passes the band of one sample, or is nearest to it",
}
"""What a contact's force is, by whether the paper's thresholds detect it."""


@dataclass(frozen=True)
class TrueTouch:
    """One true touch: from the true force passing 1 N until it is below for good."""

    start: float
    """[s]"""
    end: float
    """[s]"""
    peak: float
    """Largest true force [N]."""
    peak_20ms: float
    """Largest 20 ms mean of the true force [N]."""
    held: float
    """Largest 20 ms mean that begins 0.5 s after the touch or later [N], NaN if it was over by then."""
    link: str
    """Link that touched first, '' where that is not known."""
    velocity: FloatArray
    """(3,) velocity of the touching point before the contact [m/s], NaN where that is not known."""


@dataclass(frozen=True)
class FeltContact:
    """One detected contact and the reaction to it. Base frame."""

    time: float
    """[s]"""
    profile: str
    """Name of the profile that detected it."""
    force: FloatArray
    """(3,) F_ext of eq. 12: the reading above the window's mean, or what explains the torques best [N]."""
    axes: BoolArray
    """(3,) axes whose threshold or band was crossed, or came nearest to it."""
    filtered: FloatArray
    """(3,) value of eq. 8 at the detection [N]."""
    raw: FloatArray
    """(3,) estimate at the detection [N]."""
    peak: FloatArray
    """(3,) on each axis the estimate that was farthest from zero during the contact [N]."""
    peak_norm: float
    """Largest norm of the estimate during the contact [N]."""
    held_norm: float
    """Largest norm of the estimate later than 0.5 s into the contact [N]."""
    reaction_speed: float
    """At its beginning [m/s]."""
    reaction_s: float
    """How long the reaction lasted [s]."""
    moved_s: float
    """How long the arm moved in it [s]; 0 of a contact that held it still, for it was below what moves the arm."""
    touch: int | None
    """Index of the true touch it answers."""
    delay: float | None
    """Time since that touch began [s], None if an earlier detection answered it."""


@dataclass(frozen=True)
class ContactMeasures:
    """Detections and true touches in order."""

    truth_known: bool
    detections: tuple[FeltContact, ...]
    touches: tuple[TrueTouch, ...]
    unanswered: dict[int, Mode | None]
    """Touches without a detection, by index: what the arm was doing when each began."""

    @property
    def missed(self) -> tuple[TrueTouch, ...]:
        """True touches that were never answered, those aside that came while the arm was yielding already."""
        return tuple(self.touches[i] for i, mode in self.unanswered.items() if mode is not Mode.REACT)

    @property
    def without_touch(self) -> tuple[FeltContact, ...]:
        """Detections without a true touch; none where the truth is not known."""
        return tuple(d for d in self.detections if d.touch is None) if self.truth_known else ()

    @property
    def delays(self) -> tuple[float, ...]:
        """Time from each touch that was answered to its first detection [s]."""
        return tuple(d.delay for d in self.detections if d.delay is not None)

    @property
    def peak(self) -> float | None:
        """Largest true force [N], or where it is not known the largest estimate during a contact."""
        if self.truth_known:
            return max((touch.peak for touch in self.touches), default=0.0)
        return _largest([d.peak_norm for d in self.detections])

    @property
    def held(self) -> float | None:
        """Largest force later than 0.5 s into a contact [N], from the same source as the peak; None if none lasted."""
        return _largest([t.held for t in self.touches] if self.truth_known else [d.held_norm for d in self.detections])


def contacts_in(course: RunCourse) -> ContactMeasures:
    """Find what touched in a recording and what was detected of it."""
    touches = touches_of(course.truth)
    detections = _detections(course, touches)
    answered = {detection.touch for detection in detections}
    unanswered = {i: _mode_at(course, touch.start) for i, touch in enumerate(touches) if i not in answered}
    return ContactMeasures(course.truth is not None, tuple(detections), tuple(touches), unanswered)


def touches_of(truth: TrueForces | None) -> list[TrueTouch]:
    """All true touches in order; none where nothing is known, or what is said to be known cannot be."""
    if truth is None or len(truth.time) < 2 or not np.all(np.isfinite(truth.time)):
        return []
    time, force = truth.time, np.linalg.norm(truth.force, axis=1)
    samples = max(1, round(MEAN_S / max(float(np.median(np.diff(time))), 1e-9)))
    mean, begun = mean_over(force, samples), [instant for instant, _, _ in truth.touches]
    touches, before = list[TrueTouch](), -np.inf
    for first, past in _merged(spans(force > TOUCH_N), time):
        start, end = float(time[first]), float(time[past - 1])
        late = int(np.searchsorted(time, start + TRANSIENT_S))
        # the last contact that began after the touch before, and by now
        last = bisect_right(begun, start + 1e-9) - 1
        begins_here = last >= 0 and begun[last] > before
        _, link, velocity = truth.touches[last] if begins_here else (start, "", np.full(3, np.nan))
        touches.append(
            TrueTouch(
                start,
                end,
                peak=float(force[first:past].max()),
                peak_20ms=float(mean[max(first - samples + 1, 0) : past].max(initial=0.0)),
                held=float(mean[late:past].max(initial=0.0)) if late < past else float("nan"),
                link=link,
                velocity=velocity,
            )
        )
        before = end
    return touches


def _merged(flags: list[tuple[int, int]], time: FloatArray) -> list[tuple[int, int]]:
    """Join spans with less than `BOUNCE_S` between them."""
    first, past = np.array(flags, dtype=np.int64).reshape(-1, 2).T
    apart = time[first[1:]] - time[past[:-1] - 1] >= BOUNCE_S
    begins, ends = np.append(True, apart)[: len(first)], np.append(apart, True)[: len(past)]
    return list(zip(first[begins].tolist(), past[ends].tolist(), strict=True))


def _detections(course: RunCourse, touches: Sequence[TrueTouch]) -> list[FeltContact]:
    """All detected contacts in order, each with the touch it answers if there is one."""
    detections: list[FeltContact] = []
    answered: set[int | None] = set()
    lasted, steps = course.lasted, [i for i, _, _ in course.contacts]
    for (i, contact, speed), following in zip(course.contacts, [*steps[1:], len(course)], strict=False):
        time, end = float(course.time[i]), _reaction_end(course, i)
        under_way = [k for k, touch in enumerate(touches) if touch.start <= time <= touch.end + GRACE_S]
        touch = under_way[-1] if under_way else None
        first = touch is not None and touch not in answered
        answered.add(touch)
        begun = touches[touch].start if first and touch is not None else time
        over = touches[touch].end + GRACE_S if touch is not None else time
        during = slice(
            int(np.searchsorted(course.time, begun)),
            min(max(end, int(np.searchsorted(course.time, over, side="right"))), following),
        )
        force, late = course.force[during], course.time[during] >= begun + TRANSIENT_S
        size = np.linalg.norm(np.where(np.isfinite(force), force, np.nan), axis=1)
        detections.append(
            FeltContact(
                time=time,
                profile=course.runs[course.run[i]].profile.name,
                force=contact.force,
                axes=contact.axes,
                filtered=course.filtered_force[i],
                raw=course.force[i],
                peak=_farthest(force),
                peak_norm=float(np.fmax.reduce(size, initial=np.nan)),
                held_norm=float(np.fmax.reduce(size[late], initial=np.nan)),
                reaction_speed=speed,
                reaction_s=float(lasted[i:end].sum()),
                moved_s=float(lasted[i:end][course.answering[i:end]].sum()),
                touch=touch,
                delay=time - begun if first else None,
            )
        )
    return detections


def _reaction_end(course: RunCourse, first: int) -> int:
    """Index one past the last step of the reaction that begins in a step."""
    other = np.flatnonzero(course.mode[first:] != MODES.index(Mode.REACT))
    return max(first + int(other[0]), first + 1) if len(other) else len(course)


def _mode_at(course: RunCourse, time: float) -> Mode | None:
    """Mode of the step in force at an instant [s], None before the first."""
    i = int(np.searchsorted(course.time, time, side="right")) - 1
    return MODES[course.mode[i]] if i >= 0 else None


def _farthest(force: FloatArray) -> FloatArray:
    """Value farthest from zero (3,) of each column of forces (S, 3), NaN of none."""
    finite = force[np.isfinite(force).all(axis=1)]
    if not len(finite):
        return np.full(3, np.nan)
    return finite[np.abs(finite).argmax(axis=0), np.arange(3)]


def _largest(values: list[float]) -> float | None:
    return max((value for value in values if np.isfinite(value)), default=None)


def contact_section(course: RunCourse, contacts: ContactMeasures) -> Html:
    """Detected contacts and, where it is known, what truly touched and what was missed."""
    parts = [_detected(course, contacts.detections)]
    if contacts.truth_known:
        parts += [_touched(contacts), _false(contacts.detections)]
    else:
        unknown = "True touches are not known: delays, missed touches and false detections cannot be counted."
        parts.append(element("p", unknown, "note"))
    return joined(parts)


def _detected(course: RunCourse, detections: Sequence[FeltContact]) -> Html:
    if not detections:
        return element("p", "No contact was detected.")
    rows: list[Row] = []
    for i, d in enumerate(detections[:_ROWS], 1):
        rows.append(
            {
                "no.": str(i),
                "axes": " ".join(axis for axis, hit in zip(AXES, d.axes, strict=True) if hit),
                "towards": heading(d.force),
                "time [s]": number(d.time, 2),
                "force [N]": number(float(np.linalg.norm(d.force)), 1),
                "direction x y z": vector(_unit(d.force), 2),
                "filtered x y z [N]": vector(d.filtered, 1),
                "raw x y z [N]": vector(d.raw, 1),
                "peak x y z [N]": vector(d.peak, 1),
                "reaction [m/s]": number(d.reaction_speed, 3),
                "lasted [s]": number(d.reaction_s, 2),
                "moved [s]": number(d.moved_s, 2) if d.moved_s else "held still",
                **({"profile": d.profile} if len(course.runs) > 1 else {}),
            }
        )
    note = (
        f"{_left_out(len(detections) - _ROWS)}{_FORCE[course.by_thresholds]}; on the arm, base frame. Filtered: value"
        " of eq. 8. Raw: the estimate. Peak: on each axis the estimate farthest from zero during the contact. Held"
        " still: the contact was below what moves the arm."
    )
    return table(rows, note, 3, "Detected contacts")


def _touched(contacts: ContactMeasures) -> Html:
    if not contacts.touches:
        return element("p", "Nothing truly touched the arm.")
    answers = {d.touch: (i, d) for i, d in reversed(list(enumerate(contacts.detections, 1)))}
    rows: list[Row] = []
    for i, touch in enumerate(contacts.touches):
        order, detection = answers.get(i, (0, None))
        if len(rows) < (_ROWS if detection else _MOST):
            rows.append(
                {
                    "no.": str(i + 1),
                    "first link": touch.link or NOTHING,
                    "answered by": f"contact {order}" if detection else _why(contacts.unanswered[i]),
                    "time [s]": number(touch.start, 3),
                    "duration [s]": number(touch.end - touch.start, 3),
                    "delay [ms]": number(detection.delay if detection else None, 0, 1000.0),
                    "speed [m/s]": number(float(np.linalg.norm(touch.velocity)), 3),
                    "true peak [N]": number(touch.peak, 1),
                    "true 20 ms [N]": number(touch.peak_20ms, 1),
                    f"held {TRANSIENT_S:g} s [N]": number(touch.held, 1),
                }
            )
    note = (
        f"{_left_out(len(contacts.touches) - len(rows))}A touch begins as the true force passes 1 N; the delay runs"
        f" from there to the detection. Interruptions of less than {BOUNCE_S:g} s are bounces of one touch. Speed: of"
        " the point of the arm that touched first."
    )
    return table(rows, note, 3, "True touches (simulation)")


def _why(mode: Mode | None) -> Text:
    """Why a touch has no detection."""
    if mode is Mode.REACT:
        return "none: the arm was yielding already"
    return bad("missed" + (" in HOLD" if mode is Mode.HOLD else ""))


def _false(detections: Sequence[FeltContact]) -> Html:
    """Say which detections no touch explains."""
    false = [f"contact {i} at {d.time:.2f} s" for i, d in enumerate(detections, 1) if d.touch is None]
    if not false:
        return element("p", "Every detection answers a true touch.") if detections else Html("")
    listed = ", ".join(false[:_ROWS]) + (" ..." if len(false) > _ROWS else "")
    return element(
        "p", bad(f"Detections without a touch under way or over for less than {GRACE_S:g} s: {len(false)} ({listed}).")
    )


def _left_out(count: int) -> str:
    return f"{count} more are left out here; all count in the summary. " if count > 0 else ""


def _unit(force: FloatArray) -> FloatArray:
    norm = float(np.linalg.norm(force))
    return force / norm if norm > 0 else np.full(3, np.nan)


def heading(force: FloatArray) -> str:
    """Base axis that a force points along most, with its sign."""
    if not np.all(np.isfinite(force)) or not np.any(force):
        return NOTHING
    axis = int(np.abs(force).argmax())
    return ("+" if force[axis] > 0 else "−") + AXES[axis]
