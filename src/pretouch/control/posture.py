"""The posture an arm starts from."""

import numpy as np

from pretouch.control.task import rotation_error
from pretouch.errors import ExperimentError
from pretouch.groups import Kinematics
from pretouch.robot.ik import Pace, posture_at
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


def brought_to(model: RobotModel, point: FloatArray) -> FloatArray:
    """Joint positions (n,) [rad] of the ready posture, its hand moved to a point (3,) [m] without being turned.

    Raises ExperimentError where the arm cannot reach it within its joint limits.
    """
    ready = model.description.q_ready
    upright = model.kinematics(ready).rotation[model.ee]

    def error(kin: Kinematics) -> FloatArray:
        # metres and radians side by side; the sine of the angle will do, for the hand is never turned far
        return np.concatenate([point - kin.position[model.ee], rotation_error(kin.rotation[model.ee], upright)])

    q = posture_at(model, ready.copy(), error, ready, Pace(2000, 0.02, 1e-4, close=1e-6))
    if q is None:
        raise ExperimentError(
            f"The arm cannot reach {np.round(point, 3).tolist()} with its hand upright: choose another."
        )
    return q
