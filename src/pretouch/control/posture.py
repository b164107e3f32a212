"""The posture an arm starts from."""

import numpy as np

from pretouch.control.task import rotation_error
from pretouch.errors import ExperimentError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

_STEPS = 2000
_STEP_MAX = 0.02  # [rad] a joint turns at most in one step, within which J is taken for constant


def brought_to(model: RobotModel, point: FloatArray) -> FloatArray:
    """Joint positions (n,) [rad] of the ready posture, its hand moved to a point (3,) [m] without being turned.

    Raises ExperimentError where the arm cannot reach it within its joint limits.
    """
    q = model.description.q_ready.copy()
    upright = model.kinematics(q).rotation[model.ee]
    for _ in range(_STEPS):
        kin = model.kinematics(q)
        # metres and radians side by side; the sine of the angle will do, for the hand is never turned far
        error = np.concatenate([point - kin.position[model.ee], rotation_error(kin.rotation[model.ee], upright)])
        if np.abs(error).max() < 1e-6:
            return q
        J = model.ee_jacobian(kin)
        # damped least squares: no step explodes near a singularity, and elsewhere the damping costs a few steps more
        step = J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(6), error)
        q = np.clip(q + step * min(1.0, _STEP_MAX / np.abs(step).max()), model.q_min, model.q_max)
    raise ExperimentError(f"The arm cannot reach {np.round(point, 3).tolist()} with its hand upright: choose another.")
