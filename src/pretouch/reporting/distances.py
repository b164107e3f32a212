"""How near what was sensed came to the body. All of it is what the units showed, not what truly was near."""

from dataclasses import dataclass

from pretouch.control.approach import notice_m, of_table_i
from pretouch.reporting.course import Course
from pretouch.reporting.numbers import durations, least, least_of_each


@dataclass(frozen=True)
class Nearest:
    """The least distance of something."""

    name: str
    distance: float
    """[m]"""
    time: float
    """[s]"""


@dataclass(frozen=True)
class Distances:
    """Least distances, and how long something was near."""

    body: Nearest | None
    """From the surface of the body, with the unit that showed it."""
    ee: Nearest | None
    """From the end-effector's origin."""
    units: tuple[Nearest | None, ...]
    """By unit."""
    links: tuple[Nearest, ...]
    """By link, where it was the closest to anything, nearest first."""
    below_crit_s: float
    """Time with anything below d_crit from the body [s]."""
    below_notice_s: float
    """Time with anything below d_notice from the body [s]."""
    within_d_max_s: float
    """Time with anything within d_max of the end-effector's origin [s]."""


def distances(course: Course) -> Distances:
    """Least distances of a recording."""
    by_unit = [_nearest(course, name, k) for k, name in enumerate(course.units)]
    found = [n for n in by_unit if n is not None]
    links = [
        Nearest(name, low[0], float(course.time[low[1]]))
        for k, name in enumerate(course.links)
        if (low := least(course.link_distance[:, k])) is not None
    ]
    ee = least(course.ee_distance)
    lasted, body = durations(course.time), least_of_each(course.link_distance)
    crit = course.of_runs(lambda run: of_table_i(run.profile.approach).d_crit_m)
    notice = course.of_runs(lambda run: notice_m(run.profile.approach))
    d_max = course.of_runs(lambda run: run.profile.d_max_m)
    return Distances(
        body=min(found, key=lambda nearest: nearest.distance, default=None),
        ee=None if ee is None else Nearest("", ee[0], float(course.time[ee[1]])),
        units=tuple(by_unit),
        links=tuple(sorted(links, key=lambda nearest: nearest.distance)),
        below_crit_s=float(lasted[body < crit].sum()),
        below_notice_s=float(lasted[body < notice].sum()),
        within_d_max_s=float(lasted[course.ee_distance < d_max].sum()),
    )


def _nearest(course: Course, name: str, unit: int) -> Nearest | None:
    low = least(course.body_distance[:, unit])
    return None if low is None else Nearest(name, low[0], float(course.time[low[1]]))
