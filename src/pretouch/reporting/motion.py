"""How near what was sensed came to the body, and how fast the end-effector went."""

from dataclasses import dataclass

import numpy as np

from pretouch.control.approach import notice_m, of_table_i
from pretouch.recording.run_record import MODES
from pretouch.reporting.html import Html, element, facts, joined, number, percent, table
from pretouch.reporting.record import Percentiles, RunCourse, least, spread
from pretouch.types import BoolArray, FloatArray, Mode

_SLOWED = 0.99
"""Speed factor below which the arm counts as slowed."""


@dataclass(frozen=True)
class LeastDistance:
    """The least distance of something."""

    name: str
    distance: float
    """[m]"""
    time: float
    """[s]"""


@dataclass(frozen=True)
class Distances:
    """Least distances, and how long something was near: by what the units showed, not by what truly was near."""

    body: LeastDistance | None
    """From the surface of the body, with the unit that showed it."""
    ee: LeastDistance | None
    """From the end-effector's origin."""
    units: tuple[LeastDistance | None, ...]
    """By unit."""
    links: tuple[LeastDistance, ...]
    """By link, where it was the closest to anything, nearest first."""
    below_crit_s: float
    """Time with anything below d_crit from the body [s]."""
    below_notice_s: float
    """Time with anything below d_notice from the body [s]."""
    within_d_max_s: float
    """Time with anything within d_max of the end-effector's origin [s]."""


def distances(course: RunCourse) -> Distances:
    """Least distances of a recording."""

    def nearest(name: str, values: FloatArray) -> LeastDistance | None:
        low = least(values)
        return None if low is None else LeastDistance(name, low[0], float(course.time[low[1]]))

    def by_distance(one: LeastDistance) -> float:
        return one.distance

    units = [nearest(name, values) for name, values in zip(course.units, course.body_distance.T, strict=True)]
    links = [nearest(name, values) for name, values in zip(course.model.links, course.link_distance.T, strict=True)]
    lasted, body = course.lasted, np.fmin.reduce(course.link_distance, axis=1)
    return Distances(
        body=min((unit for unit in units if unit), key=by_distance, default=None),
        ee=nearest("", course.ee_distance),
        units=tuple(units),
        links=tuple(sorted((link for link in links if link), key=by_distance)),
        below_crit_s=float(lasted[body < d_crit(course)].sum()),
        below_notice_s=float(lasted[body < d_notice(course)].sum()),
        within_d_max_s=float(lasted[within_d_max(course)].sum()),
    )


def d_crit(course: RunCourse) -> FloatArray:
    """Distance from the body (S,) below which nothing may come nearer [m]."""
    return course.of_runs(lambda run: of_table_i(run.profile.approach).d_crit_m)


def d_notice(course: RunCourse) -> FloatArray:
    """Distance from the body (S,) from which on what comes nearer counts [m]."""
    return course.of_runs(lambda run: notice_m(run.profile.approach))


def within_d_max(course: RunCourse) -> BoolArray:
    """Whether anything sensed was within d_max of the end-effector's origin (S,)."""
    return np.asarray(course.ee_distance < course.of_runs(lambda run: run.profile.d_max_m))


def distance_section(course: RunCourse, d: Distances) -> Html:
    """Least distances by unit and by link, and how long something was near."""
    if not course.proximity_used:
        return element("p", "Proximity was not used: the profile leaves the units aside.")
    if d.body is None or d.ee is None:
        return element("p", "Nothing was sensed." if course.units else "The arm wears no unit: nothing is sensed.")
    near = facts(
        [
            ("nearest to the body", f"{d.body.distance:.3f} m, shown by {d.body.name} at {d.body.time:.2f} s"),
            ("nearest to the end-effector's origin", f"{d.ee.distance:.3f} m at {d.ee.time:.2f} s"),
            ("body nearer than d_crit", f"{d.below_crit_s:.2f} s"),
            ("body nearer than d_notice", f"{d.below_notice_s:.2f} s"),
            ("end-effector's origin nearer than d_max", f"{d.within_d_max_s:.2f} s"),
        ]
    )

    def least_table(name: str, distance: str, rows: list[tuple[str, LeastDistance | None]]) -> Html:
        return table(
            [
                (name, lambda row: row[0]),
                (distance, lambda row: number(row[1] and row[1].distance, 3)),
                ("at [s]", lambda row: number(row[1] and row[1].time, 2)),
            ],
            rows,
        )

    units = least_table("unit", "least distance of what it showed [m]", list(zip(course.units, d.units, strict=True)))
    links = least_table("link, where it was the closest", "least distance [m]", [(link.name, link) for link in d.links])
    note = (
        "Distances are of sensed points from the surface of the body, negative in penetration. What no unit showed is"
        " not in them; the units measure nothing below 0.04 m and hold such an obstacle there."
    )
    return joined([near, element("div", joined([units, links]), "columns"), element("p", note, "note")])


@dataclass(frozen=True)
class Speeds:
    """Speeds of the end-effector [m/s], and the factor on the speed along the path."""

    all: Percentiles | None
    by_mode: dict[Mode, Percentiles | None]
    near: Percentiles | None
    """While anything sensed was within d_max."""
    free: Percentiles | None
    """While nothing was, following the path."""
    median_factor: float | None
    """While following the path."""
    least_factor: float | None
    """While following the path."""
    slowed: float | None
    """Share of the time following the path with a factor below 0.99."""


def speeds(course: RunCourse) -> Speeds:
    """Speeds of a recording."""
    near, tracking = within_d_max(course), course.mode == MODES.index(Mode.TRACK)
    factor = course.speed_scale[tracking & np.isfinite(course.speed_scale)]
    return Speeds(
        all=spread(course.speed),
        by_mode={mode: spread(course.speed[course.mode == i]) for i, mode in enumerate(MODES)},
        near=spread(course.speed[near]),
        free=spread(course.speed[tracking & ~near]),
        median_factor=float(np.median(factor)) if len(factor) else None,
        least_factor=float(factor.min()) if len(factor) else None,
        slowed=float(np.mean(factor < _SLOWED)) if len(factor) else None,
    )


def speed_section(s: Speeds) -> Html:
    """How fast the end-effector went, and when."""
    rows = {
        "whole recording": s.all,
        "TRACK, nothing within d_max": s.free,
        "anything within d_max": s.near,
        **{mode.name: s.by_mode[mode] for mode in Mode},
    }
    columns = [
        ("end-effector speed [m/s]", lambda row: row[0]),
        ("median", lambda row: number(row[1] and row[1].median, 3)),
        ("99 %", lambda row: number(row[1] and row[1].p99, 3)),
        ("largest", lambda row: number(row[1] and row[1].max, 3)),
    ]
    factors = (
        f"While following the path the speed factor (eqs. 3 and 4) had the median {number(s.median_factor, 2)} and the"
        f" least value {number(s.least_factor, 2)}; it was below 0.99 for {percent(s.slowed)} of the steps."
        if s.median_factor is not None
        else "The arm never followed its path."
    )
    return joined([table(columns, rows.items()), element("p", factors)])
