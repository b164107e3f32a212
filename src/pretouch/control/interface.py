"""What a restriction of the arm's motion is: what it is given, and what it returns."""

from typing import Any

from pretouch.compiled import Entry
from pretouch.composition import Part
from pretouch.control.joint_box import JointLimits
from pretouch.control.motion_entry import Ended
from pretouch.groups import Kinematics
from pretouch.params import TaskParams
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, IntArray, Obstacles, RobotState
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
    units: int = 0
    """How many units, outside points and links beside moving fixtures obstacles may be of, if more than the units."""
    untouched: int | None = None
    """`Obstacles.unit` from which on obstacles are moving fixtures, not to be touched; None without."""


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


@value
class CompiledRows:
    """Rows that compiled code writes right before it solves: one call a step in place of two."""

    motion: Entry[Ended]
    """Takes `Step`, `Rows`, `Fixed`, and what belongs to it: writes the rows and ends with `motion_within`."""
    room: tuple[FloatArray, FloatArray, IntArray]
    """Fields of `Rows`."""
    weight: float
    """As in `Restricted`."""
    numbers: tuple[Any, ...]
    """What belongs to it, flattened."""


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
    ) -> tuple[Restricted | CompiledRows, Any]:  # fmt: skip
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
