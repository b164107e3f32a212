"""Poses of the sensors at their measurements, and the motion of the objects that they see."""

import math

import numpy as np

from pretouch.compiled import kernel
from pretouch.perception.obstacles import TrackState
from pretouch.robot.kinematics import Chain, point_velocity
from pretouch.sensing.sensor import Sensors
from pretouch.types import BoolArray, FloatArray


@kernel
def move_back(
    sensors: Sensors, moved: BoolArray, stamp: FloatArray, chain: Chain, posed: float, longest: FloatArray
) -> None:
    """Move sensor poses, (K, 3) [m] and (K, 3, 3), from the instant of the arm's posture back to their stamps (K,) [s].

    That is the motion of their links at the joint velocities (n,) [rad/s], to first order in the position; the rotation
    is exact for a constant angular velocity. Only sensors with a flag `moved` (K,) change; `posed` is that of the
    posture [s]. No reading counts as older than `longest` (K,) [s].
    """
    position, rotation, unit_link = sensors
    axis, moved_by, qd = chain.axis, chain.moved_by, chain.qd
    w, turned = np.empty(3), np.empty(3)
    for k in range(len(unit_link)):
        age = min(posed - stamp[k], longest[k])
        # measured after the posture: the further motion of the arm is unknown
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
        if speed == 0.0:  # without an axis of rotation
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


FASTEST = 2.0
"""Fastest plausible motion of a person's hand [m/s]."""
JUMP_M = 0.06
"""Further difference of two readings of one surface, by noise and the width of the cone [m]."""


@kernel
def follow_points(tracks: TrackState, points: FloatArray, stamp: FloatArray, counts: BoolArray, memory: float) -> None:
    """Update the motion of the tracks by the points (K, 3) [m] of `stamp` (K,) [s] that count (K,).

    A fading-memory filter, the least squares of a straight line with weights that fall by 1/e in `memory` [s]: with
    theta = exp(-dt / memory) it corrects the position by 1 - theta^2 and the velocity by (1 - theta)^2 / dt of the
    prediction error. A point farther from the unit's last than a hand moves belongs to another surface: its motion
    starts anew, with velocity 0. The tracks still contain the last points.
    """
    motion, last = tracks.motion, tracks.point
    for k in range(len(counts)):
        if not counts[k]:
            continue
        dt, away2 = stamp[k] - tracks.point_stamp[k], 0.0
        for i in range(3):
            away2 += (points[k, i] - last[k, i]) ** 2
        # not the first reading, whose dt is infinite, nor one after three memories: e^-3 of the old weight is left then
        continues = not np.isnan(motion[0, k, 0]) and 0.0 < dt <= 3.0 * memory
        if not continues or away2 > (FASTEST * dt + JUMP_M) ** 2:
            for i in range(3):
                motion[0, k, i], motion[1, k, i] = points[k, i], 0.0
            continue
        # The gains of the steady state, from the second reading on: two noisy points alone would give any velocity.
        theta = np.exp(-dt / memory)
        for i in range(3):
            prediction = motion[0, k, i] + dt * motion[1, k, i]
            error = points[k, i] - prediction
            motion[0, k, i] = prediction + (1.0 - theta * theta) * error
            motion[1, k, i] += (1.0 - theta) ** 2 / dt * error
