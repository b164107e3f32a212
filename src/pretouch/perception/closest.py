"""The closest body point to each obstacle, on capsules: to sensed points, and to moving fixtures beside the arm."""

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.robot.body import Capsules, placed, to_axis
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import nearest_points
from pretouch.types import FloatArray, IntArray, MovingFixtures, Obstacles, RangeReadings, no_obstacles

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

    The direction points from the capsule's axis to the obstacle, so it is defined in penetration, where the distance
    is negative. On the axis the last direction stays.

    Args:
        kin: posture.
        body: the C capsules that joints move, at least one.
        ee_position: (3,) end-effector origin [m].
        unit: (K,) index of each obstacle's unit.
        point: (K, 3) obstacles, base frame [m].
        last_direction: (K, 3) unit vectors for points on an axis.
    """
    near = no_obstacles(len(point))._replace(
        unit=unit, slot=unit, point=point, direction=last_direction.astype(np.float64)
    )
    closest(placed(body, kin), near)
    return near._replace(ee_distance=np.linalg.norm(point - ee_position, axis=1))


@compiled
def closest(capsules: Capsules, obstacles: Obstacles) -> None:
    """Write the points of C placed capsules that are closest to the points of obstacles, see `closest_points`.

    Where no direction is defined, that of the obstacles stays.
    """
    link, a, b, radius = capsules
    point, direction = obstacles.point, obstacles.direction
    nearest = _nearest_capsules(capsules, point, obstacles.body_distance)
    for k in range(len(point)):
        c = nearest[k]
        along, from_axis = to_axis(point, k, a, b, c)
        obstacles.link[k] = link[c]
        for i in range(3):
            foot = a[c, i] + along * (b[c, i] - a[c, i])
            if from_axis > _ON_AXIS:  # on the axis all directions across are alike: the last one stays
                direction[k, i] = (point[k, i] - foot) / from_axis
            obstacles.body_point[k, i] = foot + radius[c] * direction[k, i]


@kernel
def _nearest_capsules(capsules: Capsules, point: FloatArray, distance: FloatArray) -> IntArray:
    """Write the distances of points (K, 3) from the nearest of C placed capsules; return these capsules.

    A tie goes to the lower index; a point of NaN is nearest to the first.
    """
    count, (_, a, b, radius) = len(point), capsules
    at, least, nearest = np.empty((3, count)), np.empty(count), np.zeros(count, np.int64)
    for k in range(count):
        at[0, k], at[1, k], at[2, k] = point[k, 0], point[k, 1], point[k, 2]
    # Capsule by capsule, all points: a loop without a branch, four iterations of which the processor runs at once. A
    # search of each point's nearby capsules alone needs half as many roots, and takes twice as long.
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


def beside(
    still: Capsules, moving: MovingFixtures, readings: RangeReadings, now: float, persistence: float
) -> Capsules:
    """Return the fixtures at rest and the moving ones, at the stamp of the newest reading.

    Readings older than `persistence` [s] at `now` [s] do not count.
    """
    stamps = readings.stamp[(readings.stamp <= now) & (readings.stamp >= now - persistence)]
    a, b = moving.at(float(stamps.max(initial=-np.inf)) if len(stamps) else moving.stamp)
    link = np.concatenate([still.link, np.zeros(len(a), np.int64)])
    radius = np.concatenate([still.radius, moving.radius])
    return Capsules(link, np.vstack([still.a, a]), np.vstack([still.b, b]), radius)


def near_moving(
    moving: MovingFixtures, model: RobotModel, kin: Kinematics, now: float, first: tuple[int, int]
) -> Obstacles:
    """Return the point of the moving fixtures that is nearest to each moving link, one obstacle a link.

    Args:
        moving: fixtures with at least one capsule, as `sound_moving` returns them.
        model: the arm.
        kin: its posture.
        now: instant of the step [s].
        first: `Obstacles.unit` of all, and `slot` of the first link; the others follow.
    """
    (a, b), body, parts = moving.at(now), model.body, model.parts
    _, own_a, own_b, _ = placed(body, kin)
    on_body, on_other = nearest_points(own_a[:, None], own_b[:, None], a, b)  # (C, M, 3)
    between, length = on_other - on_body, np.linalg.norm(b - a, axis=1)
    apart, along = np.linalg.norm(between, axis=2), np.linalg.norm(on_other - a, axis=2)
    gap = apart - body.radius[:, None] - moving.radius
    of_part = np.where((body.link == parts[:, None])[..., None], gap, np.inf).reshape(len(parts), -1)
    c, m = np.divmod(of_part.argmin(axis=1), len(moving.radius))
    # any direction will do where the axes meet
    crossing = (apart[c, m] <= _ON_AXIS)[:, None]
    n = np.where(crossing, (0.0, 0.0, 1.0), between[c, m] / np.where(crossing, 1.0, apart[c, m][:, None]))
    share = (along[c, m] / np.where(length[m] > 0.0, length[m], 1.0))[:, None]
    velocity = moving.a_velocity[m] + share * (moving.b_velocity[m] - moving.a_velocity[m])
    number = np.arange(len(parts))
    unit, far, closing = np.full(len(parts), first[0]), np.full(len(parts), np.inf), -(n * velocity).sum(axis=1)
    point, body_point = on_other[c, m] - moving.radius[m, None] * n, on_body[c, m] + body.radius[c, None] * n
    return Obstacles(
        unit, point, far, body_point, parts.copy(), n, gap[c, m], closing, first[1] + number, np.zeros(len(parts))
    )
