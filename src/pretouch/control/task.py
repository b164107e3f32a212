"""What the QP tracks: the end-effector's velocity, and if asked its orientation."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.params import TaskParams
from pretouch.types import FloatArray


def task(
    ee_jacobian: FloatArray,
    velocity: FloatArray,
    rotation: FloatArray,
    rotation_goal: FloatArray,
    params: TaskParams,
) -> tuple[FloatArray, FloatArray]:
    """Jacobian (m, n) and desired velocity (m,) of the task: m = 3, or 6 when the orientation is held.

    Args:
        ee_jacobian: (6, n) of the end-effector origin.
        velocity: (3,) desired velocity [m/s].
        rotation: (3, 3) R_O_ee now.
        rotation_goal: (3, 3) R_O_ee to hold.
        params: orientation and its gain.
    """
    if params.orientation == "free":
        return ee_jacobian[:3], velocity
    return ee_jacobian, twist(velocity, rotation, rotation_goal, params.orientation_gain_1_s)


@compiled
def twist(velocity: FloatArray, rotation: FloatArray, goal: FloatArray, gain: float) -> FloatArray:
    """Task velocity (6,) of `task` when the orientation is held [m/s, then rad/s]."""
    error, both = rotation_error(rotation, goal), np.empty(6)
    for i in range(3):
        both[i], both[3 + i] = velocity[i], gain * error[i]
    return both


@compiled
def rotation_error(rotation: FloatArray, goal: FloatArray) -> FloatArray:
    """Rotation from one orientation to the other (3,): the unit axis times the sine of the angle, base frame."""
    error = np.zeros(3)
    # Half the sum of the cross products of each axis of the one with its like of the other. The sine falls again beyond
    # a right angle and is 0 for a half turn: good for holding an orientation, not for turning to a far one.
    for i in range(3):
        x, y, z = rotation[0, i], rotation[1, i], rotation[2, i]
        error[0] += 0.5 * (y * goal[2, i] - z * goal[1, i])
        error[1] += 0.5 * (z * goal[0, i] - x * goal[2, i])
        error[2] += 0.5 * (x * goal[1, i] - y * goal[0, i])
    return error
