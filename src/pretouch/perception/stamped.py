"""Where the sensors were when they measured: the arm goes on while a reading is on its way."""

import math

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import Chain, Sensors
from pretouch.robot.kinematics import point_velocity
from pretouch.types import BoolArray, FloatArray


@compiled
def move_back(
    sensors: Sensors, moved: BoolArray, stamp: FloatArray, chain: Chain, posed: float, longest: float
) -> None:  # fmt: skip
    """Move sensor poses, (K, 3) [m] and (K, 3, 3), from the instant of the arm's posture back to their stamps (K,) [s].

    That is the motion of their links at the joint velocities (n,) [rad/s], to first order in the place; the rotation is
    exact for a constant angular velocity. No reading is taken for older than `longest` [s].

    Args:
        sensors: changed.
        moved: (K,) which of them.
        stamp: of the readings.
        chain: of the arm.
        posed: instant of the arm's posture [s].
        longest: see above.
    """
    position, rotation, unit_link = sensors
    axis, moved_by, qd = chain.axis, chain.moved_by, chain.qd
    w, turned = np.empty(3), np.empty(3)
    for k in range(len(unit_link)):
        age = min(posed - stamp[k], longest)
        # measured after the posture: how the arm goes on is not known
        if not moved[k] or not age > 0.0:
            continue
        v = point_velocity(chain, unit_link[k], position[k, 0], position[k, 1], position[k, 2])
        w[:] = 0.0  # the sum of qd_j a_j, over the joints that move the link
        for j in range(len(qd)):
            if moved_by[unit_link[k], j]:
                for i in range(3):
                    w[i] += axis[j, i] * qd[j]
        speed = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        for i in range(3):
            position[k, i] -= age * v[i]  # p(stamp) = p - age v, to first order
        if speed == 0.0:  # there is no axis to turn about
            continue
        # R(stamp) = exp(-age [w]) R by the formula of Rodrigues, column by column
        s, c = math.sin(-age * speed), math.cos(age * speed)
        for i in range(3):
            w[i] /= speed
        for column in range(3):
            a, b, d = rotation[k, 0, column], rotation[k, 1, column], rotation[k, 2, column]
            along = (1.0 - c) * (w[0] * a + w[1] * b + w[2] * d)
            turned[0] = c * a + s * (w[1] * d - w[2] * b) + along * w[0]
            turned[1] = c * b + s * (w[2] * a - w[0] * d) + along * w[1]
            turned[2] = c * d + s * (w[0] * b - w[1] * a) + along * w[2]
            for i in range(3):
                rotation[k, i, column] = turned[i]
