"""What the arm was doing, why it held, and how the quadratic programs ended."""

from dataclasses import dataclass

import numpy as np

from pretouch.recording.run_record import MODES
from pretouch.reporting.course import OUTCOMES, Course
from pretouch.reporting.numbers import Spread, durations, spread
from pretouch.types import Mode, QpOutcome


@dataclass(frozen=True)
class Hold:
    """One stretch of HOLD by one event."""

    start: float
    """[s]"""
    duration: float
    """[s]"""
    sentence: str
    """As first said; what it says of a step may have changed later."""


@dataclass(frozen=True)
class States:
    """Modes and solver of a recording."""

    time: dict[Mode, float]
    """Time in each mode [s]."""
    holds: tuple[Hold, ...]
    outcomes: dict[QpOutcome, int]
    """Steps by how their quadratic program ended."""
    slack: Spread | None
    """Largest violation of an approach row in the steps that had any row [m/s]."""

    @property
    def share(self) -> dict[Mode, float]:
        """Share of each mode, 0 of a recording without any time."""
        total = sum(self.time.values())
        return {mode: lasted / total if total else 0.0 for mode, lasted in self.time.items()}


def states(course: Course) -> States:
    """Modes, holds and solver outcomes of a recording."""
    lasted = durations(course.time)
    return States(
        time={mode: float(lasted[course.mode == i].sum()) for i, mode in enumerate(MODES)},
        holds=_holds(course),
        outcomes={outcome: int(np.sum(course.outcome == i)) for i, outcome in enumerate(OUTCOMES)},
        slack=spread(course.slack[course.restricted > 0]),
    )


def _holds(course: Course) -> tuple[Hold, ...]:
    """Stretches of HOLD, each by one event."""
    lasted, held = durations(course.time), course.mode == MODES.index(Mode.HOLD)
    found: list[Hold] = []
    first, kind = -1, None
    for i in range(len(course) + 1):
        here = course.event[i] if i < len(course) and held[i] else None
        if here is kind:
            continue
        if kind is not None:
            found.append(Hold(float(course.time[first]), float(lasted[first:i].sum()), course.reason[first]))
        first, kind = i, here
    return tuple(found)
