"""How well the units, the robot's interface and the loop did their work."""

from dataclasses import dataclass

import numpy as np

from pretouch.reporting.html import NOTHING, Html, Text, bad, element, facts, joined, number, percent, table, vector
from pretouch.reporting.record import NO_READING, Percentiles, RunCourse, spread
from pretouch.types import BoolArray, FloatArray, RangeStatus

_MAD_TO_SIGMA = 1.4826
"""Standard deviation over median absolute deviation, of a normal distribution."""
_FEW = 5
"""Fewer readings than this tell no rate and no noise."""
_LOST = 0.05
"""Share of lost measurements from which it is marked."""


@dataclass(frozen=True)
class UnitMeasures:
    """One unit, by the readings of it that the steps were given."""

    name: str
    readings: int
    """New ones."""
    rate: float | None
    """One over the median time between measurements [Hz]."""
    lost: float | None
    """Share of measurements at that rate that are missing."""
    latency: Percentiles | None
    """From a measurement to the first step that was given it [s]."""
    status: dict[str, int]
    """New readings by status."""
    silence: float | None
    """Longest time without a new measurement, beginning and end of the recording included [s]."""
    noise: float | None
    """Standard deviation of a distance, from the second differences of successive good readings [m]."""


@dataclass(frozen=True)
class LoopHealth:
    """The robot's interface, and how the steps followed each other."""

    rate: float | None
    """New robot states a second that the steps were given [Hz]."""
    age: Percentiles | None
    """Of the robot state at the step [s]."""
    force_missing: float | None
    """Share of the steps without a force estimate."""
    sigma: FloatArray
    """(3,) median standard deviation of the force window while it is full [N], NaN without any."""
    period: Percentiles | None
    """Time from one step to the next [s]."""
    late: int
    """Steps that came half a period late or more."""
    without_inputs: int
    """Steps whose inputs are not in the recording."""


def unit_health(course: RunCourse) -> tuple[UnitMeasures, ...]:
    """Each unit of the skin."""
    return tuple(_unit(course, k) for k in range(len(course.units)))


def _unit(course: RunCourse, k: int) -> UnitMeasures:
    stamp, status = course.reading_stamp[:, k], course.reading_status[:, k]
    fresh = _fresh(np.where(status == NO_READING, np.nan, stamp))
    stamps, statuses = stamp[fresh], status[fresh]
    gaps = np.diff(stamps)
    usual = float(np.median(gaps)) if len(stamps) >= _FEW else 0.0
    expected = float(np.round(gaps / usual).sum()) if usual > 0 else 0.0
    time = course.time[course.with_inputs]
    return UnitMeasures(
        name=course.units[k],
        readings=len(stamps),
        rate=1 / usual if usual > 0 else None,
        lost=max(0.0, 1 - len(gaps) / expected) if expected else None,
        latency=spread(course.time[fresh] - stamps),
        status={_status(code): int(np.sum(statuses == code)) for code in np.unique(statuses)},
        silence=float(np.diff(np.concatenate([time[:1], np.sort(stamps), time[-1:]])).max()) if len(time) else None,
        noise=_noise(np.where(statuses == RangeStatus.OK, course.reading_distance[fresh, k], np.nan)),
    )


def loop_health(course: RunCourse) -> LoopHealth:
    """What the robot reported, and how the steps followed each other."""
    stamps = course.robot_stamp[_fresh(course.robot_stamp)]
    lasted = float(stamps[-1] - stamps[0]) if len(stamps) > 1 else 0.0
    armed = course.sigma[course.armed & np.isfinite(course.sigma).all(axis=1)]
    gaps, period = np.diff(course.time), course.of_runs(lambda run: run.profile.task.control_period_s)[1:]
    return LoopHealth(
        rate=(len(stamps) - 1) / lasted if lasted > 0 else None,
        age=spread(course.time - course.robot_stamp),
        force_missing=float(np.mean(course.force_missing[course.with_inputs])) if course.with_inputs.any() else None,
        sigma=np.median(armed, axis=0) if len(armed) else np.full(3, np.nan),
        period=spread(gaps),
        late=int(np.sum(gaps >= 1.5 * period)),
        without_inputs=int(np.sum(~course.with_inputs)),
    )


def _fresh(stamp: FloatArray) -> BoolArray:
    """Whether each stamp (S,) is finite and another than the last finite one."""
    finite = np.flatnonzero(np.isfinite(stamp))
    fresh = np.zeros(len(stamp), np.bool_)
    fresh[finite] = np.diff(stamp[finite], prepend=np.nan) != 0
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


def health_section(units: tuple[UnitMeasures, ...], loop: LoopHealth) -> Html:
    """Units, robot interface and loop."""
    columns = [
        ("unit", lambda unit: unit.name),
        ("readings", lambda unit: str(unit.readings)),
        ("rate [Hz]", lambda unit: number(unit.rate, 1)),
        ("lost", lambda unit: bad(percent(unit.lost, 1)) if (unit.lost or 0.0) > _LOST else percent(unit.lost, 1)),
        ("latency, median [ms]", lambda unit: number(unit.latency and unit.latency.median, 1, 1000.0)),
        ("99 % [ms]", lambda unit: number(unit.latency and unit.latency.p99, 1, 1000.0)),
        ("longest silence [s]", lambda unit: number(unit.silence, 2)),
        ("noise [mm]", lambda unit: number(unit.noise, 1, 1000.0)),
        ("status", lambda unit: ", ".join(f"{name} {count}" for name, count in unit.status.items()) or NOTHING),
    ]
    note = (
        "Of the readings that the steps were given: a unit faster than the loop is counted at the loop's rate. Latency:"
        " from a measurement to the first step that had it. Noise: of distances, a steady motion left out."
    )
    rest: list[tuple[Text, Text]] = [
        ("robot states", f"{number(loop.rate, 1)} Hz; age {_milliseconds(loop.age)}"),
        ("force estimate missing", percent(loop.force_missing, 1)),
        ("noise of the force estimate x y z (median of the detector's σ)", Html(vector(loop.sigma, 2) + " N")),
        ("period of the loop", _milliseconds(loop.period)),
        ("late steps (by half a period or more)", str(loop.late)),
        ("steps whose inputs could not be kept", bad(str(loop.without_inputs)) if loop.without_inputs else "0"),
    ]
    return joined([table(columns, units, note) if units else element("p", "The arm wears no unit."), facts(rest)])


def _milliseconds(values: Percentiles | None) -> str:
    if values is None:
        return NOTHING
    median, p99, largest = (number(value, 1, 1000.0) for value in (values.median, values.p99, values.max))
    return f"median {median}, 99 % {p99}, largest {largest} ms"
