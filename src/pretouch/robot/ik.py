"""Inverse kinematics: bringing an arm's hand to a place, by damped least squares."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pretouch.errors import ExperimentError
from pretouch.groups import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.robot.vectors import rotation_error
from pretouch.types import FloatArray


class Pace(NamedTuple):
    """How a hand is brought to a place."""

    steps: int
    """At most."""
    step_max: float
    """Largest motion of a joint in one step, within which the Jacobian is taken for constant [rad]."""
    damping: float
    """Of the pseudo-inverse: near singularities the hand is slow, and drawn off its place by `pull`."""
    pull: float = 0.0
    """Part of the way to the posture at rest that is gone in one step, as far as the hand stays where it is."""
    close: float = 1e-4
    """Largest entry of the error of a hand that is there [m, rad]."""


def posture_at(
    model: RobotModel, q: FloatArray, error_of: Callable[[Kinematics], FloatArray], rest: FloatArray, pace: Pace
) -> FloatArray | None:
    """Move an arm from q (n,) until its hand is where it is to be; None where its joint limits are in the way.

    `error_of` gives the motion (6,) that the end-effector still has to make, translation [m] then rotation [rad];
    `rest` is the posture (n,) that the arm is drawn to [rad].
    """
    for _ in range(pace.steps):
        kin = model.kinematics(q)
        error = error_of(kin)
        if np.abs(error).max() < pace.close:
            return q
        J, drawn = model.ee_jacobian(kin), pace.pull * (rest - q)
        # damped least squares: no step explodes near a singularity, and elsewhere the damping costs a few steps more
        step = drawn + J.T @ np.linalg.solve(J @ J.T + pace.damping * np.eye(6), error - J @ drawn)
        q = np.clip(q + step * min(1.0, pace.step_max / max(np.abs(step).max(), 1e-12)), model.q_min, model.q_max)
    return None


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
