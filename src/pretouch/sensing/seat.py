"""Where on the surface of its link a unit sits, as far as capsules tell."""

from dataclasses import dataclass

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


@dataclass(frozen=True, eq=False)
class Seat:
    """A point of the surface of a link, below a unit."""

    height: float
    """Of the unit above it [m]; negative inside."""
    normal: FloatArray
    """(3,) unit vector outwards, link frame."""


def seat(model: RobotModel, link: int, p: FloatArray) -> Seat | None:
    """Return where the surface of a link is nearest to a point p (3,) in its frame [m]; None if it has no capsule."""
    nearest: Seat | None = None
    own = model.capsules.of_links(np.array([link]))
    for a, b, radius in zip(own.a, own.b, own.radius, strict=True):
        along = np.clip((p - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0.0, 1.0)
        away = p - a - along * (b - a)
        distance = float(np.linalg.norm(away))
        if nearest is None or distance - radius < nearest.height:
            nearest = Seat(distance - float(radius), away / max(distance, 1e-9))
    return nearest
