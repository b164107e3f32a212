"""What a restriction of the arm's motion is: what it is given, and what it returns."""

from typing import Any

import numpy as np

from pretouch.composition import Part
from pretouch.control.joint_box import JointLimits
from pretouch.errors import ParameterError
from pretouch.params import TaskParams
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import WHOLE, FloatArray, IntArray, Obstacles, RobotState
from pretouch.values import value


@value
class MotionBody:
    """What does not change from step to step."""

    model: RobotModel
    units: int
    """How many units the skin has."""
    limits: JointLimits
    task: TaskParams


@value
class MotionRequest:
    """What is asked of the arm in one step."""

    velocity: FloatArray
    """(3,) of the end-effector origin [m/s]."""
    rotation_goal: FloatArray
    """(3, 3) R_O_ee to hold, if the task asks for it."""
    hold: bool = False
    """Whether to brake, whatever else is asked."""
    qd: FloatArray | None = None
    """(n,) joint velocities asked for in place of the task's, within the same limits [rad/s]."""
    touch: float | None = None
    """Speed at which an arm that a contact moves may touch what it sees, and then nothing drives it away from what
    comes nearer [m/s]; None for what the profile says."""


@value
class Restricted:
    """What a restriction allows: R rows G @ qd <= h of the QP, and more if it needs to."""

    G: FloatArray
    """(R, n) approach velocity of a body point per joint velocity [m]."""
    h: FloatArray
    """(R,) largest approach velocity [m/s]; negative asks for a retreat."""
    which: IntArray
    """(K',) index of the obstacle that each of the first K' rows belongs to; those after them are of none."""
    weight: float
    """Weight of a row's squared violation against the squared task error of eq. 2, both in (m/s)^2; 0: the rows are
    hard, and the arm brakes where the joint box leaves no way to keep them."""
    velocity: FloatArray | None = None
    """(3,) added to the velocity asked of the end-effector origin [m/s]."""
    speeds: tuple[FloatArray, FloatArray] | None = None
    """(n,) least and (n,) largest joint velocities [rad/s]; what the acceleration does not allow comes later."""


GivenRows = tuple[FloatArray, FloatArray, IntArray]
"""G, h and which of `Restricted`."""


def rows_of(allowed: Restricted, n: int) -> tuple[GivenRows, float, tuple[FloatArray, FloatArray]]:
    """Return rows, weight and joint speeds for compiled code; a ParameterError for wrong shapes."""
    count, seen = len(allowed.h), len(allowed.which)
    if allowed.G.shape != (count, n) or seen > count:
        shapes = f"G {allowed.G.shape}, h {allowed.h.shape}, which {allowed.which.shape}"
        raise ParameterError(f"A restriction's rows are {shapes}: G is (R, {n}), h is (R,), which is at most (R,).")
    # other types or orders in memory would be compiled for anew, while the arm waits
    G, h, slowest, fastest = (
        np.ascontiguousarray(part, float) for part in (allowed.G, allowed.h, *(allowed.speeds or (_NONE, _NONE)))
    )
    return (G, h, np.ascontiguousarray(allowed.which, WHOLE)), float(allowed.weight), (slowest, fastest)


_NONE = np.zeros(0)
"""What stands for joint speeds that are not restricted."""


class Restriction(Part, group="pretouch.restrictions"):
    """What keeps the body from what is near. A part of it is a frozen dataclass of its parameters."""

    def on(self, body: MotionBody) -> "Restriction":
        """Return what a controller works with: itself, or something with what does not change computed once."""
        return self

    def init(self, body: MotionBody) -> Any:
        """Return what is remembered before the first step; None for nothing."""
        return None

    def step(
        self, state: Any, body: MotionBody, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
        request: MotionRequest,
    ) -> tuple[Restricted, Any]:  # fmt: skip
        """Return what is allowed in one step, and what to remember.

        Args:
            state: what is remembered.
            body: what is fixed.
            kin: posture.
            robot: state of the arm.
            obstacles: what is near.
            request: what is asked of the arm.
        """
        raise NotImplementedError
