"""What the QP tracks: the end-effector's velocity, and if asked its orientation."""

import numpy as np

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
    angular = params.orientation_gain_1_s * rotation_error(rotation, rotation_goal)
    return ee_jacobian, np.concatenate([velocity, angular])


def rotation_error(rotation: FloatArray, goal: FloatArray) -> FloatArray:
    """Rotation from one orientation to the other (3,): the unit axis times the sine of the angle, base frame."""
    turn = goal @ rotation.T
    return 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
