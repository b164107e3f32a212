"""Obstacles as surfaces, and how far from them the arm truly is."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_lab.trial import Record

_ALONG = np.linspace(0.0, 1.0, 51)[:, None, None]
"""Places along a capsule's axis at which its distance from a box is taken."""


@dataclass(frozen=True)
class Nearest:
    """The true closest points of the arm and an obstacle."""

    distance: float
    """Signed distance of the surfaces, negative where they meet [m]."""
    link: int
    """Index of the link that is nearest."""
    point: FloatArray
    """(3,) closest point of the arm's surface [m]."""
    direction: FloatArray
    """(3,) unit vector from there to the obstacle."""


class Shape(Protocol):
    """The surface of an obstacle."""

    def closest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distances (...) [m] of points (..., 3), and unit vectors (..., 3) from them towards the surface."""
        ...


@dataclass(frozen=True)
class Ball:
    """A ball."""

    center: FloatArray
    """(3,) [m]"""
    radius: float
    """[m]"""

    def closest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `Shape`."""
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
        """See `Shape`; from inside, the direction is towards the middle."""
        rel = self.center - points
        beyond = np.abs(rel) - self.half_size
        outside = np.maximum(beyond, 0.0) * np.sign(rel)
        size = np.linalg.norm(outside, axis=-1)
        inside = size < 1e-12
        to = np.where(inside[..., None], rel, outside)
        to = to / np.maximum(np.linalg.norm(to, axis=-1), 1e-12)[..., None]
        return np.where(inside, beyond.max(axis=-1), size), to


def nearest(kin: Kinematics, body: Capsules, shape: Shape) -> Nearest:
    """Find the closest points of an arm's capsules and an obstacle.

    Exact to a fiftieth of a capsule's length along its axis.
    """
    _, a, b, _ = placed(body, kin)
    along = a + _ALONG * (b - a)
    distance, direction = shape.closest(along)
    gap = distance - body.radius
    place, k = np.unravel_index(int(np.argmin(gap)), gap.shape)
    to = direction[place, k]
    return Nearest(float(gap[place, k]), int(body.link[k]), along[place, k] + body.radius[k] * to, to)


@dataclass(frozen=True)
class Truth:
    """How near arm and obstacle truly were in the S control steps of a trial: no sensor is asked."""

    nearest: list[Nearest]
    """True closest points of arm and obstacle at each step."""
    distance: FloatArray
    """(S,) distance of the surfaces, negative in contact [m]."""
    ee_distance: FloatArray
    """(S,) distance of the obstacle's surface from the end-effector's origin [m]."""


def truth_of(record: Record, model: RobotModel, shapes: Iterable[Shape]) -> Truth:
    """Work out from true joint positions and the obstacle's true place at each step how near they were."""
    found, of_ee = [], []
    for step, shape in zip(record.steps, shapes, strict=True):
        kin = model.kinematics(step.q)
        found.append(nearest(kin, model.body, shape))
        of_ee.append(float(shape.closest(kin.position[model.ee])[0]))
    return Truth(found, np.array([n.distance for n in found]), np.array(of_ee))
