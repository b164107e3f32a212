"""How fast the end-effector went."""

from dataclasses import dataclass

import numpy as np

from pretouch.recording.run_record import MODES
from pretouch.reporting.course import Course
from pretouch.reporting.numbers import Spread, spread
from pretouch.types import Mode

_SLOWED = 0.99
"""Speed factor below which the arm counts as slowed."""


@dataclass(frozen=True)
class Speeds:
    """Speeds of the end-effector [m/s], and the factor on the speed along the path."""

    all: Spread | None
    by_mode: dict[Mode, Spread | None]
    near: Spread | None
    """While anything sensed was within d_max."""
    free: Spread | None
    """While nothing was, following the path."""
    median_factor: float | None
    """While following the path."""
    least_factor: float | None
    """While following the path."""
    slowed: float | None
    """Share of the time following the path with a factor below 0.99."""


def speeds(course: Course) -> Speeds:
    """Speeds of a recording."""
    near = course.ee_distance < course.of_runs(lambda run: run.profile.d_max_m)
    tracking = course.mode == MODES.index(Mode.TRACK)
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
