"""How near what was sensed came to the body, and how fast the end-effector went."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pretouch.control.approach import ApproachRestriction, notice_m
from pretouch.recording.run_record import MODES
from pretouch.reporting.html import Html, element, facts, joined, number, percent, table
from pretouch.reporting.record import RunCourse, least, spread
from pretouch.types import BoolArray, FloatArray, Mode

_SLOWED = 0.99
"""Speed factor below which the arm counts as slowed."""


class LeastDistance(NamedTuple):
    """The least distance of something."""

    name: str
    distance: float
    """[m], infinite where there is none."""
    time: float
    """[s]"""


def _nearest(course: RunCourse, names: Sequence[str], distances: FloatArray) -> list[LeastDistance]:
    """Return the least distance of each column (S, N) of distances [m], by its name."""
    lows = [least(values) or (np.inf, 0) for values in distances.T]
    return [LeastDistance(name, low, float(course.time[at])) for name, (low, at) in zip(names, lows, strict=True)]


def nearest_to_body(course: RunCourse) -> LeastDistance | None:
    """Return the least distance from the surface of the body, with the unit that showed it; None of nothing sensed."""
    units = _nearest(course, course.units, course.body_distance)
    nearest = min(units, key=lambda one: one.distance, default=None)
    return nearest if nearest and np.isfinite(nearest.distance) else None


def d_crit(course: RunCourse) -> FloatArray:
    """Distance from the body (S,) below which nothing may come nearer [m]."""
    return course.of_runs(lambda run: ApproachRestriction.of_kind(run.profile.approach).d_crit_m)


def d_notice(course: RunCourse) -> FloatArray:
    """Distance from the body (S,) from which on what comes nearer counts [m]."""
    return course.of_runs(lambda run: notice_m(run.profile.approach))


def within_d_max(course: RunCourse) -> BoolArray:
    """Whether anything sensed was within d_max of the end-effector's origin (S,)."""
    return np.asarray(course.ee_distance < course.of_runs(lambda run: run.profile.d_max_m))


def distance_section(course: RunCourse) -> Html:
    """Least distances by unit and by link, and how long something was near: by what the units showed."""
    body = nearest_to_body(course)
    (ee,) = _nearest(course, ["end-effector"], course.ee_distance[:, None])
    if not course.proximity_used:
        return element("p", "Proximity was not used: the profile leaves the units aside.")
    if body is None or not np.isfinite(ee.distance):
        return element("p", "Nothing was sensed." if course.units else "The arm wears no unit: nothing is sensed.")
    lasted, distance = course.lasted, np.fmin.reduce(course.link_distance, axis=1)
    near = {
        "body nearer than d_crit": distance < d_crit(course),
        "body nearer than d_notice": distance < d_notice(course),
        "end-effector's origin nearer than d_max": within_d_max(course),
    }
    rows = [
        ("nearest to the body", f"{body.distance:.3f} m, shown by {body.name} at {body.time:.2f} s"),
        ("nearest to the end-effector's origin", f"{ee.distance:.3f} m at {ee.time:.2f} s"),
        *((name, f"{lasted[flags].sum():.2f} s") for name, flags in near.items()),
    ]

    def least_table(name: str, distance: str, columns: list[LeastDistance]) -> Html:
        times = [number(one.time if np.isfinite(one.distance) else None, 2) for one in columns]
        return table(
            [
                {name: one.name, distance: number(one.distance, 3), "at [s]": time}
                for one, time in zip(columns, times, strict=True)
            ]
        )

    units = _nearest(course, course.units, course.body_distance)
    closest = [one for one in _nearest(course, course.model.links, course.link_distance) if np.isfinite(one.distance)]
    links = sorted(closest, key=lambda one: one.distance)
    tables = [
        least_table("unit", "least distance of what it showed [m]", units),
        least_table("link, where it was the closest", "least distance [m]", links),
    ]
    note = (
        "Distances are of sensed points from the surface of the body, negative in penetration. What no unit showed is"
        " not in them; the units measure nothing below 0.04 m and hold such an obstacle there."
    )
    return joined([facts(rows), element("div", joined(tables), "columns"), element("p", note, "note")])


def speed_section(course: RunCourse) -> Html:
    """How fast the end-effector went, and when."""
    near, tracking = within_d_max(course), course.mode == MODES.index(Mode.TRACK)
    when = {
        "whole recording": np.ones(len(course), np.bool_),
        "TRACK, nothing within d_max": tracking & ~near,
        "anything within d_max": near,
        **{mode.name: course.mode == i for i, mode in enumerate(MODES)},
    }
    spreads = {name: spread(course.speed[flags]) for name, flags in when.items()}
    rows = [
        {
            "end-effector speed [m/s]": name,
            "median": number(speed.median, 3),
            "99 %": number(speed.p99, 3),
            "largest": number(speed.max, 3),
        }
        for name, speed in spreads.items()
    ]
    factor = course.speed_scale[tracking & np.isfinite(course.speed_scale)]
    factors = (
        f"While following the path the speed factor (eqs. 3 and 4) had the median {number(np.median(factor), 2)} and"
        f" the least value {number(factor.min(), 2)}; it was below 0.99 for {percent(np.mean(factor < _SLOWED))} of the"
        " steps."
        if len(factor)
        else "The arm never followed its path."
    )
    return joined([table(rows), element("p", factors)])
