"""Detected contacts, held against what truly touched."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pretouch.recording.run_record import MODES
from pretouch.reporting.course import Course
from pretouch.reporting.numbers import durations
from pretouch.reporting.touches import TRANSIENT_S, Touch
from pretouch.types import BoolArray, FloatArray, Mode

GRACE_S = 0.2
"""A detection this long after a touch still answers it [s]: the estimate lags, and the value of eq. 8 more."""


@dataclass(frozen=True)
class Detection:
    """One detected contact and the reaction to it. Base frame."""

    time: float
    """[s]"""
    run: int
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
class Unanswered:
    """A true touch without a detection."""

    touch: Touch
    index: int
    """Of the touch among all."""
    mode: Mode | None
    """What the arm was doing when it began."""


def detections(course: Course, touches: Sequence[Touch]) -> list[Detection]:
    """All detected contacts in order, each with the touch it answers if there is one."""
    found: list[Detection] = []
    answered: set[int | None] = set()
    lasted, steps = durations(course.time), [i for i, _, _ in course.contacts]
    for (i, contact, speed), following in zip(course.contacts, [*steps[1:], len(course)], strict=False):
        time, end = float(course.time[i]), _reaction_end(course, i)
        touch = _answered(time, touches)
        first = touch is not None and touch not in answered
        answered.add(touch)
        begun = touches[touch].start if first and touch is not None else time
        over = touches[touch].end + GRACE_S if touch is not None else time
        during = slice(
            int(np.searchsorted(course.time, begun)),
            min(max(end, int(np.searchsorted(course.time, over, side="right"))), following),
        )
        force, late = course.force[during], course.time[during] >= begun + TRANSIENT_S
        found.append(
            Detection(
                time=time, run=int(course.run[i]), force=contact.force, axes=contact.axes,
                filtered=course.filtered_force[i], raw=course.force[i],
                peak=_farthest(force), peak_norm=_norm(force), held_norm=_norm(force[late]),
                reaction_speed=speed, reaction_s=float(lasted[i:end].sum()), touch=touch,
                moved_s=float(lasted[i:end][course.answering[i:end]].sum()),
                delay=time - begun if first else None,
            )
        )  # fmt: skip
    return found


def unanswered(course: Course, touches: Sequence[Touch], found: Sequence[Detection]) -> list[Unanswered]:
    """True touches that no detection answers."""
    answered = {detection.touch for detection in found}
    return [Unanswered(touch, i, _mode_at(course, touch.start)) for i, touch in enumerate(touches) if i not in answered]


def _reaction_end(course: Course, first: int) -> int:
    """Index one past the last step of the reaction that begins in a step."""
    other = np.flatnonzero(course.mode[first:] != MODES.index(Mode.REACT))
    return max(first + int(other[0]), first + 1) if len(other) else len(course)


def _answered(time: float, touches: Sequence[Touch]) -> int | None:
    """Index of the last touch under way, or just over, at an instant [s]."""
    under_way = [i for i, touch in enumerate(touches) if touch.start <= time <= touch.end + GRACE_S]
    return under_way[-1] if under_way else None


def _mode_at(course: Course, time: float) -> Mode | None:
    """Mode of the step in force at an instant [s], None before the first."""
    i = int(np.searchsorted(course.time, time, side="right")) - 1
    return MODES[course.mode[i]] if i >= 0 else None


def _farthest(force: FloatArray) -> FloatArray:
    """Value farthest from zero (3,) of each column of forces (S, 3), NaN of none."""
    known = force[np.isfinite(force).all(axis=1)]
    if not len(known):
        return np.full(3, np.nan)
    return known[np.abs(known).argmax(axis=0), np.arange(3)]


def _norm(force: FloatArray) -> float:
    """Largest norm of forces (S, 3), NaN of none."""
    norms = np.linalg.norm(force[np.isfinite(force).all(axis=1)], axis=1)
    return float(norms.max()) if len(norms) else float("nan")
