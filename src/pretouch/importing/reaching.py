"""Bringing an arm's hand to a place, by damped least squares."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch.robot.model import Kinematics, RobotModel
from pretouch.types import FloatArray

_REACHED = 1e-4
"""Largest entry of the error of a hand that is there [m, rad]."""


@dataclass(frozen=True)
class Pace:
    """How a hand is brought to a place."""

    steps: int
    """At most."""
    step_max: float
    """Largest motion of a joint in one step [rad]."""
    damping: float
    """Of the pseudo-inverse: near singularities the hand is slow, and drawn off its place by `pull`."""
    pull: float
    """Part of the way to the posture at rest that is gone in one step, as far as the hand stays where it is."""


def reached(
    model: RobotModel, q: FloatArray, error_of: Callable[[Kinematics], FloatArray], rest: FloatArray, pace: Pace
) -> FloatArray | None:
    """Move an arm until its hand is where it is to be; None where that does not come about within joint limits.

    Args:
        model: the arm.
        q: (n,) posture to begin with [rad].
        error_of: motion (6,) that the end-effector still has to make, translation [m] then rotation [rad].
        rest: (n,) posture the arm is drawn to [rad].
        pace: of the motion.
    """
    for _ in range(pace.steps):
        kin = model.kinematics(q)
        error = error_of(kin)
        if np.abs(error).max() < _REACHED:
            return q
        J = model.ee_jacobian(kin)
        pseudo = J.T @ np.linalg.inv(J @ J.T + pace.damping * np.eye(6))
        step = pseudo @ error + (np.eye(model.n) - pseudo @ J) @ (pace.pull * (rest - q))
        q = np.clip(q + step * min(1.0, pace.step_max / max(np.abs(step).max(), 1e-12)), model.q_min, model.q_max)
    return None
