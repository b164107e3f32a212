"""How well the units, the robot's interface and the loop did their work."""

from dataclasses import dataclass

import numpy as np

from pretouch.reporting.course import NO_READING, Course
from pretouch.reporting.numbers import Spread, share, spread
from pretouch.types import BoolArray, FloatArray, RangeStatus

_MAD_TO_SIGMA = 1.4826
"""Standard deviation over median absolute deviation, of a normal distribution."""
_FEW = 5
"""Fewer readings than this tell no rate and no noise."""


@dataclass(frozen=True)
class UnitHealth:
    """One unit, by the readings of it that the steps were given."""

    name: str
    readings: int
    """New ones."""
    rate: float | None
    """One over the median time between measurements [Hz]."""
    lost: float | None
    """Share of measurements at that rate that are missing."""
    latency: Spread | None
    """From a measurement to the first step that was given it [s]."""
    status: dict[str, int]
    """New readings by status."""
    silence: float | None
    """Longest time without a new measurement, beginning and end of the recording included [s]."""
    noise: float | None
    """Standard deviation of a distance, from the second differences of successive good readings [m]."""


@dataclass(frozen=True)
class RobotHealth:
    """The robot's interface."""

    rate: float | None
    """New states a second that the steps were given [Hz]."""
    age: Spread | None
    """Of the state at the step [s]."""
    force_missing: float | None
    """Share of the steps without a force estimate."""
    sigma: FloatArray
    """(3,) median standard deviation of the force window while it is full [N], NaN without any."""


@dataclass(frozen=True)
class LoopHealth:
    """How the steps followed each other."""

    period: Spread | None
    """Time from one step to the next [s]."""
    late: int
    """Steps that came half a period late or more."""
    without_inputs: int
    """Steps whose inputs could not be kept."""


def unit_health(course: Course) -> list[UnitHealth]:
    """Each unit of the skin."""
    return [_unit(course, k) for k in range(len(course.units))]


def _unit(course: Course, k: int) -> UnitHealth:
    stamp, status = course.reading_stamp[:, k], course.reading_status[:, k]
    fresh = _fresh(np.where(status == NO_READING, np.nan, stamp))
    stamps, statuses = stamp[fresh], status[fresh]
    gaps = np.diff(stamps)
    usual = float(np.median(gaps)) if len(stamps) >= _FEW else 0.0
    expected = float(np.round(gaps / usual).sum()) if usual > 0 else 0.0
    known = course.time[course.given]
    return UnitHealth(
        name=course.units[k],
        readings=len(stamps),
        rate=1 / usual if usual > 0 else None,
        lost=max(0.0, 1 - len(gaps) / expected) if expected else None,
        latency=spread(course.time[fresh] - stamps),
        status={_status(code): int(np.sum(statuses == code)) for code in np.unique(statuses)},
        silence=float(np.diff(np.concatenate([known[:1], np.sort(stamps), known[-1:]])).max()) if len(known) else None,
        noise=_noise(np.where(statuses == RangeStatus.OK, course.reading_distance[fresh, k], np.nan)),
    )


def robot_health(course: Course) -> RobotHealth:
    """What the robot reported."""
    stamps = course.robot_stamp[_fresh(course.robot_stamp)]
    lasted = float(stamps[-1] - stamps[0]) if len(stamps) > 1 else 0.0
    armed = course.sigma[course.armed & np.isfinite(course.sigma).all(axis=1)]
    return RobotHealth(
        rate=(len(stamps) - 1) / lasted if lasted > 0 else None,
        age=spread(course.time - course.robot_stamp),
        force_missing=share(course.force_missing[course.given]),
        sigma=np.median(armed, axis=0) if len(armed) else np.full(3, np.nan),
    )


def loop_health(course: Course) -> LoopHealth:
    """How the steps followed each other."""
    gaps = np.diff(course.time)
    period = course.of_runs(lambda run: run.profile.task.control_period_s)[1:]
    return LoopHealth(spread(gaps), int(np.sum(gaps >= 1.5 * period)), int(np.sum(~course.given)))


def _fresh(stamp: FloatArray) -> BoolArray:
    """Whether each stamp (S,) is finite and another than the last finite one."""
    known = np.flatnonzero(np.isfinite(stamp))
    fresh = np.zeros(len(stamp), np.bool_)
    fresh[known] = np.diff(stamp[known], prepend=np.nan) != 0
    return fresh


def _status(code: int) -> str:
    return RangeStatus(code).name if code in RangeStatus._value2member_map_ else str(code)


def _noise(distance: FloatArray) -> float | None:
    """Noise [m] of successive distances (R,), NaN where there is none: a steady motion drops out of it."""
    bend = np.diff(distance, n=2)
    bend = bend[np.isfinite(bend)]
    if len(bend) < _FEW:
        return None
    # the second difference of independent errors has 1 + 4 + 1 times their variance
    return float(_MAD_TO_SIGMA * np.median(np.abs(bend - np.median(bend))) / np.sqrt(6.0))
