"""Points on the outer surface of an arm's capsules, each for the same area."""

from dataclasses import dataclass

import numpy as np

from pretouch.control.braking import tangents_of
from pretouch.robot.body import Capsules, from_axes
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray, IntArray

_STEP = 1.324717957244746
"""Root of x^3 = x + 1: points at the fractions of n / x and n / x^2 are even over the square (Roberts 2018)."""


@dataclass(frozen=True, eq=False)
class Surface:
    """P points of an arm's surface, each in the frame of its link."""

    link: IntArray
    """(P,) index of the link."""
    capsule: IntArray
    """(P,) index of the capsule among `RobotModel.capsules`."""
    point: FloatArray
    """(P, 3) [m]"""
    normal: FloatArray
    """(P, 3) unit vectors outwards."""
    area: FloatArray
    """(P,) that each stands for [m^2]."""

    def __len__(self) -> int:
        return len(self.link)

    def only(self, keep: BoolArray | IntArray) -> "Surface":
        """Return some of the points."""
        return Surface(self.link[keep], self.capsule[keep], self.point[keep], self.normal[keep], self.area[keep])


def surface_of(model: RobotModel, count: int, shift: float = 0.0) -> Surface:
    """Return about `count` points, even by area, on the links that any joint moves.

    What lies inside another capsule of the same link is left out; the area of a capsule is uniform along its axis, ends
    included (Archimedes). `shift` moves all points along their sequence.
    """
    arm = model.capsules
    moving = np.flatnonzero(np.isin(arm.link, model.parts))
    length = np.linalg.norm(arm.b - arm.a, axis=1) + 2 * arm.radius
    area = 2 * np.pi * arm.radius * length
    parts = []
    for c in moving:
        number = max(1, round(count * area[c] / area[moving].sum()))
        index = np.arange(1, number + 1)
        u, turn = (index / _STEP + shift) % 1.0, 2 * np.pi * ((index / _STEP**2 + shift) % 1.0)
        point, normal = on_capsule(arm.a[c], arm.b[c], float(arm.radius[c]), u, turn)
        outside = ~_inside(arm, int(c), point)
        here = np.full(number, area[c] / number)
        at = Surface(np.full(number, arm.link[c]), np.full(number, c), point, normal, here)
        parts.append(at.only(outside))
    return Surface(*(np.concatenate([getattr(part, name) for part in parts]) for name in Surface.__annotations__))


def on_capsule(
    a: FloatArray, b: FloatArray, radius: float, u: FloatArray, turn: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points (N, 3) [m] of a capsule's surface and normals (N, 3), at parts u (N,) of its length and angles (N,)."""
    length = float(np.linalg.norm(b - a))
    axis = (b - a) / length if length > 0 else np.array([0.0, 0.0, 1.0])
    across = np.empty((2, 3))
    tangents_of(axis, across)
    z = u * (length + 2 * radius) - radius
    foot = np.clip(z, 0.0, length)
    rise = np.clip((z - foot) / radius, -1.0, 1.0)
    ring = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
    normal = rise[:, None] * axis + np.sqrt(1.0 - rise**2)[:, None] * ring
    return a + foot[:, None] * axis + radius * normal, normal


def _inside(arm: Capsules, c: int, point: FloatArray) -> BoolArray:
    """Whether points (N, 3) of capsule c lie inside another one of its link."""
    others = (arm.link == arm.link[c]) & (np.arange(len(arm.radius)) != c)
    away = np.linalg.norm(from_axes(point, arm.a[others], arm.b[others])[1], axis=2)
    return np.asarray((away < arm.radius[others]).any(axis=1))
