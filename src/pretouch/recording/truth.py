"""What only a simulation knows."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from pretouch.types import FloatArray
from pretouch.values import value


@value
class Truth:
    """What only a simulation knows, of the time since the cycle before. M instants of the physics."""

    time: FloatArray
    """(M,) instants of the physics [s]."""
    force: FloatArray
    """(M, 3) true contact force on the arm [N], base frame."""
    hand: FloatArray
    """(3,) centre of the person's hand [m], NaN without one."""
    touches: tuple[tuple[float, int, FloatArray], ...]
    """Beginnings of contacts: instant [s], link index, velocity (3,) of the touching point [m/s]."""


class Beginning(Protocol):
    """The beginning of a contact, as a simulation reports it."""

    @property
    def time(self) -> float:
        """Instant [s]."""
        ...

    @property
    def link(self) -> int:
        """Index of the link that touches."""
        ...

    @property
    def velocity(self) -> FloatArray:
        """Velocity of the touching point (3,) [m/s]."""
        ...


def truth_of(log: Sequence[tuple[float, FloatArray]], touches: Sequence[Beginning], hand: FloatArray | None) -> Truth:
    """Gather what a simulation logged since the cycle before: (instant, force (3,)) of each step of its physics.

    `hand` is the centre of the person's hand (3,) [m], None without one.
    """
    return Truth(
        np.array([time for time, _ in log], dtype=np.float64),
        np.array([force for _, force in log], dtype=np.float64).reshape(-1, 3),
        np.full(3, np.nan) if hand is None else hand,
        tuple((touch.time, touch.link, touch.velocity) for touch in touches),
    )
