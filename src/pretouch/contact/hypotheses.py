"""The contacts that the sequential test looks for in one posture: given to `sequential.judge`."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.proximity_prior import nearest_of, nearness
from pretouch.contact.sequential import Hypotheses
from pretouch.groups import Mechanism, ObstacleArrays
from pretouch.robot.model import Kinematics, jacobian_into
from pretouch.types import FloatArray


class NearPrior(NamedTuple):
    """How much likelier a contact is where something is near."""

    near_gain: float
    near_m: float
    near_horizon_s: float


@compiled
def write_hypotheses(
    kin: Kinematics, mechanism: Mechanism, qd: FloatArray, obstacles: ObstacleArrays, touch_gain: FloatArray,
    p: NearPrior, contacts: Hypotheses,
) -> None:  # fmt: skip
    """Write the contacts that are looked for: of each joint, then of each link, then of the nearest objects.

    Joints move at `qd` (n,) [rad/s]. All weights are times `touch_gain` (L,) of the link; of several links behind one
    joint the largest counts.
    """
    position, rotation, anchor, axis = kin
    moved_by, parts, middle = mechanism.arm.moved_by, mechanism.links.parts, mechanism.links.middle
    distance, direction = obstacles.body_distance, obstacles.direction
    J, joints, weight, away = contacts
    n, count, full, point = len(anchor), len(parts), np.empty((6, len(anchor))), np.empty(3)
    order, k = nearest_of(distance, len(J) - count), 0
    weight[:n] = 0.0
    for body in range(len(moved_by)):
        before = moved_by[body].sum()
        if before:
            weight[before - 1] = max(weight[before - 1], 0.5 / n * touch_gain[body])
    for h in range(len(J)):
        if h < count:
            touched = parts[h]
            weight[n + h] = (0.5 / count) * touch_gain[touched]
            for a in range(3):
                point[a] = position[touched, a]
                for b in range(3):
                    point[a] += rotation[touched, a, b] * middle[h, b]
        else:
            k = order[h - count]
            touched, point[:] = obstacles.link[k], obstacles.body_point[k]
        jacobian_into(anchor, axis, moved_by[touched], point, full)
        J[h], joints[h] = full[:3], moved_by[touched].sum()
        if h >= count:
            speed = obstacles.closing_speed[k]
            for a in range(3):
                away[h, a] = -direction[k, a]
                for j in range(n):
                    speed += direction[k, a] * J[h, a, j] * qd[j]
            weight[n + h] = p.near_gain * nearness(distance[k], speed, p.near_m, p.near_horizon_s) * touch_gain[touched]
