"""How near the commands came to the arm's limits."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pretouch.reporting.course import Course
from pretouch.reporting.numbers import Spread, least, spread
from pretouch.types import FloatArray

if TYPE_CHECKING:
    from pretouch.recording.reader import Run

_MOST = 1000.0
"""Fraction that stands for more, as of a command where the arm allows none."""
_ROUNDING = 1e-9
"""What a fraction may exceed 1 by, or a margin lie below 0 [rad], as nothing but rounding."""


@dataclass(frozen=True)
class JointMargin:
    """One joint and its limits."""

    margin: float | None
    """Least distance of the commanded position from the nearer limit [rad]."""
    margin_measured: float | None
    """The same of the measured position [rad]."""
    speed: Spread | None
    """Command as a fraction of the largest speed the arm allows at that position."""
    acceleration: Spread | None
    """Change of the command as a fraction of the largest acceleration the arm allows."""

    @property
    def violations(self) -> tuple[str, ...]:
        """Which limits were exceeded."""
        return tuple(
            name
            for name, exceeded in (
                ("position", _below(self.margin) or _below(self.margin_measured)),
                ("velocity", _above(self.speed)),
                ("acceleration", _above(self.acceleration)),
            )
            if exceeded
        )


def limit_margins(course: Course) -> list[JointMargin]:
    """Each joint of the arm."""
    speed, acceleration = speed_fraction(course), acceleration_fraction(course)
    return [
        JointMargin(
            _least(course.q_margin[:, j]),
            _least(course.q_margin_measured[:, j]),
            spread(speed[:, j]),
            spread(acceleration[:, j]),
        )
        for j in range(course.command.shape[1])
    ]


def speed_fraction(course: Course) -> FloatArray:
    """Commands (S, n) as fractions of what the arm allows, no more than `_MOST`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.abs(course.command) / course.speed_limit
    return np.where(course.command == 0, 0.0, np.minimum(fraction, _MOST))


def acceleration_fraction(course: Course) -> FloatArray:
    """Changes (S, n) of the command as fractions of what the arm allows in the whole periods they took; first row NaN.

    A command is held for a period. A step that came later, or after cycles that the recording lost, had longer.
    """
    fraction = np.full(course.command.shape, np.nan)
    if len(course) < 2:
        return fraction
    period = course.of_runs(lambda run: run.profile.task.control_period_s)[1:]
    periods = np.maximum(np.round(np.diff(course.time) / period), 1.0)
    allowed = _by_joint(course, lambda run: run.model.description.qdd_max)[1:] * (periods * period)[:, None]
    with np.errstate(invalid="ignore"):
        fraction[1:] = np.abs(np.diff(course.command, axis=0)) / allowed
    return fraction


def _by_joint(course: Course, value: Callable[["Run"], FloatArray]) -> FloatArray:
    """Value (S, n) that each step's run has for each joint, NaN where its arm has fewer joints."""
    table = np.full((len(course.runs), course.command.shape[1]), np.nan)
    for i, run in enumerate(course.runs):
        of_run = value(run)
        table[i, : len(of_run)] = of_run
    return table[course.run]


def _least(values: FloatArray) -> float | None:
    found = least(values)
    return None if found is None else found[0]


def _below(margin: float | None) -> bool:
    return margin is not None and margin < -_ROUNDING


def _above(fraction: Spread | None) -> bool:
    return fraction is not None and fraction.max > 1 + _ROUNDING
