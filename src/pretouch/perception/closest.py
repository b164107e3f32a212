"""The closest point of the body to each obstacle: signed distance and direction, on capsules."""

import numpy as np
from numba import njit

from pretouch.perception.vectors import dot, placed
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics
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
    body_point, link, direction, distance = _closest(body.link, a, b, body.radius, point, last_direction)
    ee_distance = np.sqrt(((point - ee_position) ** 2).sum(axis=1))
    return Obstacles(unit, point, ee_distance, body_point, link, direction, distance)


def no_obstacles() -> Obstacles:
    """Return the empty set."""
    none, vectors = np.zeros(0), np.zeros((0, 3))
    return Obstacles(np.zeros(0, np.int64), vectors, none, vectors, np.zeros(0, np.int64), vectors, none)


@njit(cache=True)
def _closest(
    link: IntArray,
    a: FloatArray,
    b: FloatArray,
    radius: FloatArray,
    point: FloatArray,
    last_direction: FloatArray,
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
    count = len(point)
    body_point, direction = np.empty((count, 3)), np.empty((count, 3))
    on_link, distance = np.empty(count, np.int64), np.full(count, np.inf)
    for k in range(count):
        for c in range(len(radius)):
            axis, to = b[c] - a[c], point[k] - a[c]
            length2 = dot(axis, axis)
            along = 0.0 if length2 == 0 else min(1.0, max(0.0, dot(to, axis) / length2))
            foot = a[c] + along * axis
            gap = point[k] - foot
            from_axis = np.sqrt(dot(gap, gap))
            if c == 0 or from_axis - radius[c] < distance[k]:
                distance[k] = from_axis - radius[c]
                on_link[k] = link[c]
                direction[k] = gap / from_axis if from_axis > _ON_AXIS else last_direction[k]
                body_point[k] = foot + radius[c] * direction[k]
    return body_point, on_link, direction, distance
