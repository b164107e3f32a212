"""True values of a simulation, and the objects round the arm as far as the facts of a run tell."""

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from pretouch.errors import RecordingError
from pretouch.recording.packing import custom
from pretouch.types import FloatArray, IntArray
from pretouch.values import value


@value
class Truth:
    """True values of a simulation since the cycle before. M instants of the physics, T touches."""

    time: FloatArray
    """(M,) instants of the physics [s]."""
    force: FloatArray
    """(M, 3) true contact force on the arm [N], base frame."""
    hand: FloatArray
    """(3,) centre of the person's hand [m], NaN without one."""
    touch_time: FloatArray
    """(T,) beginnings of contacts [s]."""
    touch_link: IntArray
    """(T,) index of the link that was touched."""
    touch_velocity: FloatArray
    """(T, 3) velocity of the touching point [m/s]."""

    @property
    def touches(self) -> list[tuple[float, int, FloatArray]]:
        """Beginnings of contacts one by one: instant [s], link index, velocity (3,) [m/s]."""
        return list(zip(self.touch_time.tolist(), self.touch_link.tolist(), self.touch_velocity, strict=True))


def truth_of(
    log: Sequence[tuple[float, FloatArray]], touches: Sequence[tuple[float, int, FloatArray]], hand: FloatArray | None
) -> Truth:
    """Gather what a simulation logged since the cycle before: (instant, force (3,)) of each step of its physics.

    Args:
        log: instants [s] and forces (3,) [N].
        touches: beginnings of contacts: instant [s], link index, velocity (3,) of the touching point [m/s].
        hand: centre of the person's hand (3,) [m], None without one.
    """
    time, force = zip(*log, strict=True) if log else ((), ())
    begun, link, velocity = zip(*touches, strict=True) if touches else ((), (), ())
    return Truth(
        np.array(time, dtype=np.float64),
        np.array(force, dtype=np.float64).reshape(-1, 3),
        np.full(3, np.nan) if hand is None else hand,
        np.array(begun, dtype=np.float64),
        np.array(link, dtype=np.int64),
        np.array(velocity, dtype=np.float64).reshape(-1, 3),
    )


@value
class KnownBox:
    """A box that stood still. ValueError for numbers that are none."""

    center: FloatArray
    """(3,) base frame [m]."""
    half_size: FloatArray
    """(3,) [m]."""
    name: str = "box"

    def __post_init__(self) -> None:
        for numbers in (self.center, self.half_size):
            if numbers.shape != (3,) or not np.isfinite(numbers).all():
                raise ValueError(f"{numbers.tolist()} is no place and no size")


@value
class Surroundings:
    """Boxes, a person's hand and the floor."""

    boxes: tuple[KnownBox, ...] = ()
    hand_radius_m: float | None = None
    """Radius of the person's hand [m]; None without a hand."""
    floor_height_m: float | None = None
    """Height of the floor in the base frame [m]; None if unknown."""


def surroundings(about: Mapping[str, Any]) -> Surroundings:
    """Read `scene` of the facts of a run: `boxes`, `hand_radius_m`, `floor_height_m`, each if it is there.

    RecordingError for what cannot be drawn.
    """
    try:
        return msgspec.convert(about.get("scene") or {}, Surroundings, dec_hook=custom)
    except (msgspec.ValidationError, ValueError, TypeError) as error:
        raise RecordingError(
            f"The scene cannot be drawn ({error}): give each of its boxes center (x, y, z) and half_size (x, y, z) [m]."
        ) from error
