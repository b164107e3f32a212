"""Health of the units, the robot's interface and the loop."""

import numpy as np

from pretouch.reporting.html import NOTHING, Html, Row, Text, bad, element, facts, joined, number, percent, table
from pretouch.reporting.record import NO_READING, RunCourse, spread
from pretouch.types import BoolArray, FloatArray, RangeStatus
from pretouch.units.health import noise_of, status_name

_FEW = 5
"""Fewer readings than this tell no rate."""
_LOST = 0.05
"""Share of lost measurements from which it is marked."""


def health_section(course: RunCourse) -> Html:
    """Units, robot interface and loop."""
    note = (
        "Of the readings that the steps were given: a unit faster than the loop is counted at the loop's rate. Latency:"
        " from a measurement to the first step that had it. Noise: of distances, a steady motion left out."
    )
    units = table([unit_row(course, k) for k in range(len(course.units))], note)
    return joined([units if course.units else element("p", "The arm wears no unit."), facts(loop_row(course).items())])


def unit_row(course: RunCourse, k: int) -> Row:
    """Describe a unit by the readings of it that the steps were given."""
    stamp, status = course.reading_stamp[:, k], course.reading_status[:, k]
    fresh = _fresh(np.where(status == NO_READING, np.nan, stamp))
    stamps, statuses = stamp[fresh], status[fresh]
    gaps = np.diff(stamps)
    usual = float(np.median(gaps)) if len(stamps) >= _FEW else 0.0
    expected = float(np.round(gaps / usual).sum()) if usual > 0 else 0.0
    lost = max(0.0, 1 - len(gaps) / expected) if expected else 0.0
    latency, time = spread(course.time[fresh] - stamps), course.time[course.with_inputs]
    silence = float(np.diff(np.concatenate([time[:1], np.sort(stamps), time[-1:]])).max()) if len(time) else None
    noise = noise_of(np.where(statuses == RangeStatus.OK, course.reading_distance[fresh, k], np.nan))
    counts = [f"{status_name(code)} {np.sum(statuses == code)}" for code in np.unique(statuses)]
    share = percent(lost if expected else None, 1)
    return {
        "unit": course.units[k],
        "readings": str(len(stamps)),
        "rate [Hz]": number(1 / usual if usual > 0 else None, 1),
        "lost": bad(share) if lost > _LOST else share,
        "latency, median [ms]": number(latency.median, 1, 1000.0),
        "99 % [ms]": number(latency.p99, 1, 1000.0),
        "longest silence [s]": number(silence, 2),
        "noise [mm]": number(noise, 1, 1000.0),
        "status": ", ".join(counts) or NOTHING,
    }


def loop_row(course: RunCourse) -> Row:
    """Describe what the robot reported, and how the steps followed each other."""
    stamps = course.robot_stamp[_fresh(course.robot_stamp)]
    lasted = float(stamps[-1] - stamps[0]) if len(stamps) > 1 else 0.0
    rate = (len(stamps) - 1) / lasted if lasted > 0 else None
    age = _milliseconds(course.time - course.robot_stamp)
    with_inputs = course.with_inputs
    missing = float(np.mean(course.force_missing[with_inputs])) if with_inputs.any() else None
    armed = course.sigma[course.armed & np.isfinite(course.sigma).all(axis=1)]
    sigma = np.median(armed, axis=0) if len(armed) else np.full(3, np.nan)
    gaps, period = np.diff(course.time), course.of_runs(lambda run: run.profile.task.control_period_s)[1:]
    without: Text = str(np.sum(~with_inputs))
    return {
        "robot states": f"{number(rate, 1)} Hz; age {age}",
        "force estimate missing": percent(missing, 1),
        "noise of the force estimate x y z (median of the detector's σ)": " ".join(
            number(axis, 2) for axis in sigma.tolist()
        )
        + " N",
        "period of the loop": _milliseconds(gaps),
        "late steps (by half a period or more)": str(np.sum(gaps >= 1.5 * period)),
        "steps whose inputs could not be kept": without if with_inputs.all() else bad(without),
    }


def _fresh(stamp: FloatArray) -> BoolArray:
    """Mask of the stamps (S,) that are finite and differ from the last finite one."""
    finite = np.flatnonzero(np.isfinite(stamp))
    fresh = np.zeros(len(stamp), np.bool_)
    fresh[finite] = np.diff(stamp[finite], prepend=np.nan) != 0
    return fresh


def _milliseconds(times: FloatArray) -> str:
    """Write how times [s] are spread."""
    values = spread(times)
    if np.isnan(values.max):
        return NOTHING
    median, p99, largest = (number(value, 1, 1000.0) for value in values)
    return f"median {median}, 99 % {p99}, largest {largest} ms"
