"""What the arm's motion is made with, set up once, and what is asked of it in a step."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from pretouch.compiled import flattened
from pretouch.control.braking import BrakingLimits
from pretouch.control.joint_box import JointLimits
from pretouch.control.null_space import NullSpaceLimits
from pretouch.control.qp import CostParams, cost_params
from pretouch.control.restriction import ApproachParams, approach_params
from pretouch.control.touch_speed import TouchLimits, touch_limits
from pretouch.params import AnticipationParams, BaselineParams, FailureParams, RestrictionParams, TaskParams
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch.values import value


class MotionNumbers(NamedTuple):
    """What any motion takes of an arm, its limits and a profile."""

    approach: ApproachParams
    cost: CostParams
    orientation_gain_1_s: float
    holds_orientation: bool
    """Whether the end-effector keeps its orientation."""
    row_weight: float
    """Price of the violation of a row; 0 for hard ones: where one is violated, another solver follows."""
    budget: int
    """Factorisations after which to give up."""
    limits: FloatArray
    """`JointLimits.table`."""
    q_mid: FloatArray
    """(n,) middle of the joint ranges [rad]."""


class NearSettings(NamedTuple):
    """What anticipation takes of a profile."""

    limits: BrakingLimits
    touching: TouchLimits
    away: NullSpaceLimits
    braking: bool
    """Whether the braking curve restricts, in place of eqs. 5-7."""
    moves_away: bool
    """Whether links before the hand move away in the null space."""
    projected: bool
    """Whether the mid-joint term is in the null space."""


class MotionProfile(Protocol):
    """What motion takes of a profile."""

    @property
    def task(self) -> TaskParams:
        """Following the path, and the cost of eq. 2."""

    @property
    def restriction(self) -> RestrictionParams:
        """Restricting the approach."""

    @property
    def anticipation(self) -> AnticipationParams:
        """What is done before a contact."""

    @property
    def baselines(self) -> BaselineParams:
        """Published ways to compare with."""

    @property
    def failure(self) -> FailureParams:
        """When to give up."""


@value
class MotionSetup:
    """An arm, its limits and a profile."""

    model: RobotModel
    limits: JointLimits
    profile: MotionProfile
    numbers: MotionNumbers
    near: NearSettings | None
    """None for a profile without anticipation."""
    rotors: FloatArray
    """(n, n) inertia of the drives, which the touch speed counts too [kg m^2]."""
    fields: tuple[Any, ...]
    """Of arm and numbers, for compiled code."""
    near_fields: tuple[Any, ...]
    """Of arm, numbers and what anticipation takes."""


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


NO_JOINTS = np.zeros(0)
"""What stands for joint velocities that are not asked for."""


class Asked(NamedTuple):
    """What compiled code takes of a `MotionRequest`."""

    velocity: FloatArray
    rotation_goal: FloatArray
    hold: bool
    tracks: bool
    by_joint: bool
    """Whether joint velocities are asked for."""
    joints: FloatArray
    """(n,) these [rad/s]; without meaning if not."""


def motion_setup(model: RobotModel, limits: JointLimits, profile: MotionProfile) -> MotionSetup:
    """Return what `near_motion` and `joint_motion` are made with."""
    r, t = profile.restriction, profile.task
    numbers = MotionNumbers(
        approach_params(r), cost_params(t), t.orientation_gain_1_s, t.orientation == "hold",
        r.slack_weight if r.mode != "hard" else 0.0, profile.failure.solver_iterations, limits.table, model.q_mid,
    )  # fmt: skip
    near, arm, rotors = near_settings(profile), model.arm, profile.anticipation.rotor_inertia_kg_m2 * np.eye(model.n)
    fields = flattened(arm, numbers)
    return MotionSetup(model, limits, profile, numbers, near, rotors, fields, flattened(arm, numbers, near))


def anticipates(profile: MotionProfile) -> bool:
    """Whether a profile asks for anything that `joint_motion` alone does not do."""
    p = profile.anticipation
    return profile.restriction.mode == "braking" or profile.task.mid_joint_projected or p.null_space


def near_settings(profile: MotionProfile) -> NearSettings | None:
    """Return what anticipation takes of a profile; None for one without."""
    if not anticipates(profile):
        return None
    r, p, t = profile.restriction, profile.anticipation, profile.task
    limits = BrakingLimits(
        r.d_notice_m, p.deceleration_m_s2, p.latency_s, p.margin_m, p.retreat_max_m_s,
        p.closing_deadband_m_s if p.closing_speed else np.inf,
        p.tangential_distance_m if p.tangential else -np.inf, p.tangential_speed_m_s, t.speed_m_s,
        p.tighten_m_s2, p.loosen_m_s2, t.control_period_s,
    )  # fmt: skip
    away = NullSpaceLimits(
        p.null_distance_m, p.null_speed_m_s, p.null_joint_rad_s, p.null_rate_rad_s2 * t.control_period_s
    )
    return NearSettings(limits, touch_limits(p), away, r.mode == "braking", p.null_space, t.mid_joint_projected)


def touching_at(settings: NearSettings, speed: float) -> NearSettings:
    """Return the settings with a touch speed [m/s] whatever the mass, and no heed of what moves by itself."""
    limits = settings.limits._replace(deadband_m_s=np.inf)
    return settings._replace(limits=limits, touching=TouchLimits(np.inf, 1.0, 1.0, speed))
