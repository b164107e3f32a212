"""What stood round the arm of a recording, as far as its facts tell: `about["scene"]`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch.errors import RecordingError
from pretouch.types import FloatArray


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
