"""The hypotheses of the sequential test in one posture, which `sequential.judge` weighs: contacts and their priors.

An object adds hypotheses, it takes none away: a force on the body's point nearest to it, away from it. How much they
weigh depends on how soon it may touch. What no unit sees, or a unit whose reading is too old to be an obstacle, adds
nothing, and all other contacts keep the weight they have without a skin.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.sequential import Hypotheses
from pretouch.contact.window_scatter import LENGTHS
from pretouch.groups import Kinematics, Mechanism, ObstacleArrays
from pretouch.robot.kinematics import jacobian_into
from pretouch.types import FloatArray, IntArray

MOST = 4
"""Objects that are taken into account, the nearest ones."""


class NearPrior(NamedTuple):
    """How much likelier a contact is where something is near."""

    near_gain: float
    near_m: float
    near_horizon_s: float


@compiled
def link_prior(mechanism: Mechanism) -> float:
    """Return ln of the prior weight of a force on one link in one window, of which nothing near or touched is known."""
    return -math.log(2.0 * len(mechanism.links.parts) * len(LENGTHS))


@compiled
def write_hypotheses(
    kin: Kinematics, mechanism: Mechanism, qd: FloatArray, obstacles: ObstacleArrays, touch_gain: FloatArray,
    p: NearPrior, contacts: Hypotheses,
) -> None:  # fmt: skip
    """Write the hypotheses: any wrench beyond each joint, a force on each link, one by each of the nearest objects.

    Joints move at `qd` (n,) [rad/s]. All weights are times `touch_gain` (L,) of the link; of several links behind one
    joint the largest counts.
    """
    position, rotation, anchor, axis = kin
    moved_by, parts, middle = mechanism.arm.moved_by, mechanism.links.parts, mechanism.links.middle
    distance, direction = obstacles.body_distance, obstacles.direction
    J, joints, weight, away = contacts
    n, count, full, point = len(anchor), len(parts), np.empty((6, len(anchor))), np.empty(3)
    order, k = nearest_of(distance, len(J) - count), 0
    # joints and links without what is seen share a weight of 1: half for any wrench on a link, which moves the joints
    # before it, half for a force at the middle of a link
    weight[:n] = 0.0
    for body in range(len(moved_by)):
        # in a serial chain the joints that move a link are the first so many, so their number says which
        before = moved_by[body].sum()
        if before:
            weight[before - 1] = max(weight[before - 1], 0.5 / n * touch_gain[body])
    for h in range(len(J)):
        if h < count:
            link = parts[h]
            weight[n + h] = (0.5 / count) * touch_gain[link]
            for a in range(3):
                point[a] = position[link, a]
                for b in range(3):
                    point[a] += rotation[link, a, b] * middle[h, b]
        else:
            k = order[h - count]
            link, point[:] = obstacles.link[k], obstacles.body_point[k]
        jacobian_into(anchor, axis, moved_by[link], point, full)
        J[h], joints[h] = full[:3], moved_by[link].sum()
        if h >= count:
            # closing speed: that of the object towards the body, and u^T J qd of the body towards the object; a force
            # away from the object has the direction -u
            speed = obstacles.closing_speed[k]
            for a in range(3):
                away[h, a] = -direction[k, a]
                for j in range(n):
                    speed += direction[k, a] * J[h, a, j] * qd[j]
            weight[n + h] = p.near_gain * nearness(distance[k], speed, p.near_m, p.near_horizon_s) * touch_gain[link]


@compiled
def nearness(distance: float, closing: float, near: float, horizon: float) -> float:
    """How soon an object may touch, from 0 (not near) to 1 (touches within `horizon` [s]).

    `distance` [m] is from the body's surface, `closing` [m/s] the speed at which it becomes less; a growing one counts
    as it is.
    """
    ahead = distance - max(closing, 0.0) * horizon
    return min(max(1.0 - ahead / near, 0.0), 1.0)


@compiled
def nearest_of(distance: FloatArray, most: int) -> IntArray:
    """Indices of the smallest distances (K,), at most so many, the nearest first."""
    return np.argsort(distance)[:most]
