"""What only a simulation knows, and what stood round the arm as far as the facts of a run tell."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pretouch.errors import RecordingError
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


@dataclass(frozen=True, eq=False)
class KnownBox:
    """A box that stood still."""

    name: str
    center: FloatArray
    """(3,) base frame [m]."""
    half_size: FloatArray
    """(3,) [m]."""


@dataclass(frozen=True)
class Surroundings:
    """Boxes, a person's hand and the floor."""

    boxes: tuple[KnownBox, ...]
    hand_radius: float | None
    """[m], None without a hand."""
    floor_height: float | None
    """In the base frame [m], None if it was not said."""


def surroundings(about: Mapping[str, Any]) -> Surroundings:
    """Read `scene` of what is said about a run: `boxes`, `hand_radius_m`, `floor_height_m`, each if it is there.

    RecordingError for a box that cannot be drawn.
    """
    scene = about.get("scene")
    said: Mapping[str, Any] = scene if isinstance(scene, Mapping) else {}
    try:
        boxes = tuple(_box(given) for given in said.get("boxes") or ())
    except (TypeError, KeyError, ValueError) as error:
        raise RecordingError(
            "A box of the scene cannot be drawn: give each a name, center (x, y, z) and half_size (x, y, z) [m]."
        ) from error
    return Surroundings(boxes, _number(said.get("hand_radius_m")), _number(said.get("floor_height_m")))


def _box(given: Mapping[str, Any]) -> KnownBox:
    center, half_size = (np.array(given[name], dtype=np.float64) for name in ("center", "half_size"))
    if center.shape != (3,) or half_size.shape != (3,) or not np.all(np.isfinite([center, half_size])):
        raise ValueError(given)
    return KnownBox(str(given.get("name", "box")), center, half_size)


def _number(given: object) -> float | None:
    return float(given) if isinstance(given, int | float) and math.isfinite(given) else None
