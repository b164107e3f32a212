"""Obstacles as surfaces, and their true distances from the arm, without any sensor."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

_ALONG = np.linspace(0.0, 1.0, 51)[:, None, None]
"""Points along a capsule's axis that distances are computed at: exact to a fiftieth of its length."""


class Nearest(NamedTuple):
    """True closest points of the arm and an obstacle."""

    distance: float
    """Signed distance of the surfaces, negative in contact [m]."""
    link: int
    """Index of the nearest link."""
    point: FloatArray
    """(3,) closest point of the arm's surface [m]."""
    direction: FloatArray
    """(3,) unit vector from there to the obstacle."""


class ObstacleShape(Protocol):
    """The surface of an obstacle."""

    def closest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distances (...) [m] of points (..., 3), and unit vectors (..., 3) from them towards the surface."""
        ...


ShapeAt = Callable[[FloatArray], ObstacleShape]
"""Returns an obstacle's surface for positions (..., 3) of the person's hand [m]."""


@dataclass(frozen=True)
class Ball:
    """A ball, or a ball at several instants."""

    center: FloatArray
    """(..., 3) [m]"""
    radius: float
    """[m]"""

    def closest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `ObstacleShape`."""
        to = self.center - points
        size = np.linalg.norm(to, axis=-1)
        return size - self.radius, to / np.maximum(size, 1e-12)[..., None]


@dataclass(frozen=True)
class Cuboid:
    """A box along the axes of the base frame."""

    center: FloatArray
    """(3,) [m]"""
    half_size: FloatArray
    """(3,) [m]"""

    def closest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `ObstacleShape`; from inside, the direction is towards the middle."""
        rel = self.center - points
        beyond = np.abs(rel) - self.half_size
        outside = np.maximum(beyond, 0.0) * np.sign(rel)
        size = np.linalg.norm(outside, axis=-1)
        inside = size < 1e-12
        to = np.where(inside[..., None], rel, outside)
        to = to / np.maximum(np.linalg.norm(to, axis=-1), 1e-12)[..., None]
        return np.where(inside, beyond.max(axis=-1), size), to


def nearest(kin: Kinematics, body: Capsules, shape: ObstacleShape) -> Nearest:
    """Find the closest points of an arm's capsules and an obstacle."""
    _, a, b, _ = placed(body, kin)
    along = a + _ALONG * (b - a)
    distance, direction = shape.closest(along)
    gap = distance - body.radius
    place, k = np.unravel_index(int(np.argmin(gap)), gap.shape)
    to = direction[place, k]
    return Nearest(float(gap[place, k]), int(body.link[k]), along[place, k] + body.radius[k] * to, to)


def least_distance(model: RobotModel, q: FloatArray, shape: ShapeAt, hands: FloatArray) -> float:
    """Return the least of the distances that `nearest` finds in S postures (S, n) [rad], with hands (S, 3) [m]."""
    body = model.body
    ends = np.array([placed(body, model.kinematics(posture))[1:3] for posture in q])
    a, b = ends[:, 0], ends[:, 1]
    middle = shape(hands[:, None]).closest((a + b) / 2)[0] - body.radius
    # no point of an axis is farther from its middle than half its length
    s, c = np.nonzero(middle - np.linalg.norm(b - a, axis=2) / 2 <= middle.min())
    along = a[s, c] + _ALONG * (b - a)[s, c]
    return float((shape(hands[s]).closest(along)[0] - body.radius[c]).min())
