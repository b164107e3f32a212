"""The closest point of the body to each obstacle: signed distance and direction, on capsules."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.groups import CapsuleArrays, Kinematics
from pretouch.robot.body import Capsules
from pretouch.robot.vectors import placed_capsules
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
    count = len(point)
    body_point, link, distance = np.empty((count, 3)), np.empty(count, np.int64), np.empty(count)
    # a copy: where `closest` finds no direction the last one stays in it
    direction, ee_distance = last_direction.astype(np.float64), np.empty(count)
    found = ClosestArrays(body_point, link, direction, distance)
    closest(placed_capsules(body.arrays, kin), point, found)
    distances(point, ee_position, ee_distance)
    return Obstacles(unit, point, ee_distance, body_point, link, direction, distance, np.zeros(count))


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
    nearest = nearest_capsules(capsules, point, distance)
    for k in range(len(point)):
        c = nearest[k]
        along, from_axis = to_axis(point, k, a, b, c)
        on_link[k] = link[c]
        for i in range(3):
            foot = a[c, i] + along * (b[c, i] - a[c, i])
            if from_axis > _ON_AXIS:  # on the axis all directions across are alike: the last one stays
                direction[k, i] = (point[k, i] - foot) / from_axis
            body_point[k, i] = foot + radius[c] * direction[k, i]


@kernel
def nearest_capsules(capsules: CapsuleArrays, point: FloatArray, distance: FloatArray) -> IntArray:
    """Write how far points (K, 3) are from the nearest of C placed capsules, as `to_axis` has it; return which it is.

    A tie goes to the lower index; a point that is NaN is nearest to the first.
    """
    count, (_, a, b, radius) = len(point), capsules
    at, least, nearest = np.empty((3, count)), np.empty(count), np.zeros(count, np.int64)
    for k in range(count):
        at[0, k], at[1, k], at[2, k] = point[k, 0], point[k, 1], point[k, 2]
    # Capsule by capsule, all points: a loop without a branch, of which the processor does four turns at once. To look
    # at each point's nearby capsules alone takes half as many roots, and twice as long.
    for c in range(len(radius)):
        ax, ay, az, thick = a[c, 0], a[c, 1], a[c, 2], radius[c]
        ux, uy, uz = b[c, 0] - ax, b[c, 1] - ay, b[c, 2] - az
        length2 = ux * ux + uy * uy + uz * uz
        length2 = 1.0 if length2 == 0 else length2  # a ball has no axis
        for k in range(count):
            x, y, z = at[0, k] - ax, at[1, k] - ay, at[2, k] - az
            along = min(1.0, max(0.0, (x * ux + y * uy + z * uz) / length2))
            x, y, z = x - along * ux, y - along * uy, z - along * uz
            gap = np.sqrt(x * x + y * y + z * z) - thick
            nearer = c == 0 or gap < least[k]
            least[k] = gap if nearer else least[k]
            nearest[k] = c if nearer else nearest[k]
    for k in range(count):
        distance[k] = least[k]
    return nearest


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


@kernel
def to_spheres(point: FloatArray, k: int, spheres: FloatArray, gap2: FloatArray) -> None:
    """Write the squared distance (C,) of point[k] from the middle of each sphere [m^2]."""
    x, y, z = point[k, 0], point[k, 1], point[k, 2]
    for c in range(len(gap2)):
        u, v, w = spheres[0, c] - x, spheres[1, c] - y, spheres[2, c] - z
        gap2[c] = u * u + v * v + w * w


@kernel
def to_axis(point: FloatArray, k: int, a: FloatArray, b: FloatArray, c: int) -> tuple[float, float]:
    """Where on the segment from a[c] to b[c] point[k] is closest, from 0 to 1, and how far from it [m]."""
    ux, uy, uz = b[c, 0] - a[c, 0], b[c, 1] - a[c, 1], b[c, 2] - a[c, 2]
    x, y, z = point[k, 0] - a[c, 0], point[k, 1] - a[c, 1], point[k, 2] - a[c, 2]
    length2 = ux * ux + uy * uy + uz * uz
    # the foot of the perpendicular, brought into the segment; a ball has no axis
    along = 0.0 if length2 == 0 else min(1.0, max(0.0, (x * ux + y * uy + z * uz) / length2))
    x, y, z = x - along * ux, y - along * uy, z - along * uz
    return along, np.sqrt(x * x + y * y + z * z)
