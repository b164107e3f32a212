"""What a restriction of the arm's motion is: what it is given, and what it returns."""

from typing import Any

import numpy as np

from pretouch.composition import Part
from pretouch.control.joint_box import JointLimits
from pretouch.params import TaskParams
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.types import WHOLE, FloatArray, IntArray, Obstacles, RobotState
from pretouch.values import value


@value
class Body:
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
    tracks: bool = False
    """Whether the arm follows its path, so that something may block it."""
    qd: FloatArray | None = None
    """(n,) joint velocities asked for in place of the task's, within the same limits [rad/s]."""
    touch: float | None = None
    """Speed at which an arm that a contact moves may touch what it sees, and then nothing drives it away from what
    comes nearer [m/s]; None for what the profile says."""
    units: int = 0
    """How many units and outside points there are that obstacles may be of, if more than the skin has."""


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


class Restriction(Part, group="pretouch.restrictions"):
    """What keeps the body from what is near. A part of it is a frozen dataclass of its parameters."""

    def on(self, body: Body) -> "Restriction":
        """Return what a controller works with: itself, or something with what does not change computed once."""
        return self

    def init(self, body: Body) -> Any:
        """Return what is remembered before the first step; None for nothing."""
        return None

    def step(
        self, state: Any, body: Body, kin: Kinematics, robot: RobotState, obstacles: Obstacles, request: MotionRequest
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


class _Unrestricted(Restriction):
    """Allows everything."""

    def __init__(self, n: int) -> None:
        self._all = Restricted(np.zeros((0, n)), np.zeros(0), np.zeros(0, WHOLE), 0.0)

    def step(
        self, state: Any, body: Body, kin: Kinematics, robot: RobotState, obstacles: Obstacles, request: MotionRequest
    ) -> tuple[Restricted, Any]:  # fmt: skip
        return self._all, state


def restriction_on(part: Restriction | None, body: Body) -> Restriction:
    """Return a restriction that works for a body; for None one that allows everything."""
    return _Unrestricted(body.model.n) if part is None else part.on(body)
