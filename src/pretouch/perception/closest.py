"""The closest point of the body to each obstacle: signed distance and direction, on capsules."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import CapsuleArrays
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics
from pretouch.robot.vectors import placed
from pretouch.types import FloatArray, IntArray, Obstacles

_ON_AXIS = 1e-9
"""Distance from a capsule's axis below which the direction to an obstacle is not defined [m]."""


def closest_points(
    kin: Kinematics,
    body: Capsules,
    ee_position: FloatArray,
    unit: IntArray,
    point: FloatArray,
    last_direction: FloatArray,
) -> Obstacles:
    """Find the closest body point of each obstacle.

    The direction is taken from the capsule's axis to the obstacle, so it is defined in penetration, where the
    distance is negative. On the axis the last direction holds.

    Args:
        kin: posture.
        body: the C capsules that can be moved away, at least one.
        ee_position: (3,) end-effector origin [m].
        unit: (K,) index of the unit that showed each obstacle.
        point: (K, 3) obstacles, base frame [m].
        last_direction: (K, 3) unit vectors to fall back on.
    """
    a, b = placed(body, kin)
    count = len(point)
    body_point, link, distance = np.empty((count, 3)), np.empty(count, np.int64), np.empty(count)
    # a copy: where `closest` finds no direction the last one stays in it
    direction, ee_distance = last_direction.astype(np.float64), np.empty(count)
    closest(CapsuleArrays(body.link, a, b, body.radius), point, ClosestArrays(body_point, link, direction, distance))
    distances(point, ee_position, ee_distance)
    return Obstacles(unit, point, ee_distance, body_point, link, direction, distance, np.zeros(count))


def no_obstacles() -> Obstacles:
    """Return the empty set."""
    none, vectors = np.zeros(0), np.zeros((0, 3))
    return Obstacles(np.zeros(0, np.int64), vectors, none, vectors, np.zeros(0, np.int64), vectors, none, none)


@compiled
def distances(point: FloatArray, origin: FloatArray, out: FloatArray) -> None:
    """Write the distance (K,) [m] of points (K, 3) from one point (3,)."""
    for k in range(len(point)):
        x, y, z = point[k, 0] - origin[0], point[k, 1] - origin[1], point[k, 2] - origin[2]
        out[k] = np.sqrt(x * x + y * y + z * z)


class ClosestArrays(NamedTuple):
    """Room for the closest points of the body to K points, of `Obstacles`."""

    body_point: FloatArray
    """(K, 3) [m]."""
    link: IntArray
    """(K,) that carries it."""
    direction: FloatArray
    """(K, 3) from there; before, what to fall back on."""
    distance: FloatArray
    """(K,) [m]."""


@compiled
def closest(capsules: CapsuleArrays, point: FloatArray, found: ClosestArrays) -> None:
    """Write what is closest to each point (K, 3) of C placed capsules, as `closest_points` says."""
    link, a, b, radius = capsules
    body_point, on_link, direction, distance = found
    spheres, gap2 = bounds(a, b, radius), np.empty(len(radius))
    for k in range(len(point)):
        # begun with the capsule whose middle is nearest, most of the others need no closer look
        to_spheres(point, k, spheres, gap2)
        first = int(np.argmin(gap2))
        best, nearest, at, axial = np.inf, -1, 0.0, 0.0
        for i in range(-1, len(radius)):
            c = first if i < 0 else i
            # No capsule is nearer than the sphere round it. Squares need no root; where `best` is negative, inside a
            # capsule, they may leave out too few, never too many.
            if i >= 0 and (c == first or gap2[c] > (best + spheres[3, c]) ** 2):
                continue
            along, from_axis = to_axis(point, k, a, b, c)
            gap = from_axis - radius[c]
            # a tie goes to the lower index, whichever was first; `nearest < 0` names one even for a point that is NaN
            if nearest < 0 or gap < best or (gap == best and c < nearest):
                best, nearest, at, axial = gap, c, along, from_axis
        distance[k], on_link[k] = best, link[nearest]
        for i in range(3):
            foot = a[nearest, i] + at * (b[nearest, i] - a[nearest, i])
            if axial > _ON_AXIS:  # on the axis all directions across are alike: the last one stays
                direction[k, i] = (point[k, i] - foot) / axial
            body_point[k, i] = foot + radius[nearest] * direction[k, i]


@compiled
def bounds(a: FloatArray, b: FloatArray, radius: FloatArray) -> FloatArray:
    """Spheres (4, C) round capsules, a little larger than they need to be: x, y, z and radius [m]."""
    spheres = np.empty((4, len(radius)))
    for c in range(len(radius)):
        length2 = 0.0
        for i in range(3):
            spheres[i, c] = (a[c, i] + b[c, i]) / 2
            length2 += (b[c, i] - a[c, i]) ** 2
        # larger by more than rounding, so that what is left out changes no bit of the answer
        spheres[3, c] = (np.sqrt(length2) / 2 + radius[c]) * (1 + 1e-12) + 1e-12
    return spheres


@compiled
def to_spheres(point: FloatArray, k: int, spheres: FloatArray, gap2: FloatArray) -> None:
    """Write the squared distance (C,) of point[k] from the middle of each sphere [m^2]."""
    x, y, z = point[k, 0], point[k, 1], point[k, 2]
    for c in range(len(gap2)):
        u, v, w = spheres[0, c] - x, spheres[1, c] - y, spheres[2, c] - z
        gap2[c] = u * u + v * v + w * w


@compiled
def to_axis(point: FloatArray, k: int, a: FloatArray, b: FloatArray, c: int) -> tuple[float, float]:
    """Where on the segment from a[c] to b[c] point[k] is closest, from 0 to 1, and how far from it [m]."""
    ux, uy, uz = b[c, 0] - a[c, 0], b[c, 1] - a[c, 1], b[c, 2] - a[c, 2]
    x, y, z = point[k, 0] - a[c, 0], point[k, 1] - a[c, 1], point[k, 2] - a[c, 2]
    length2 = ux * ux + uy * uy + uz * uz
    # the foot of the perpendicular, brought into the segment; a ball has no axis
    along = 0.0 if length2 == 0 else min(1.0, max(0.0, (x * ux + y * uy + z * uz) / length2))
    x, y, z = x - along * ux, y - along * uy, z - along * uz
    return along, np.sqrt(x * x + y * y + z * z)
