"""What the arm's motion is made with, set up once."""

from typing import Any, NamedTuple

from pretouch.compiled import flattened
from pretouch.control.interface import Body
from pretouch.control.null_space import NullSpaceLimits
from pretouch.control.qp import CostParams, cost_params
from pretouch.params import NullSpaceMotion
from pretouch.types import FloatArray
from pretouch.values import value


class MotionNumbers(NamedTuple):
    """What compiled code takes of limits and parameters."""

    cost: CostParams
    orientation_gain_1_s: float
    holds_orientation: bool
    """Whether the end-effector keeps its orientation."""
    budget: int
    """Factorisations after which to give up."""
    limits: FloatArray
    """`JointLimits.table`."""
    q_mid: FloatArray
    """(n,) middle of the joint ranges [rad]."""
    in_null_space: bool
    """Whether the cost has a term in the null space of the task."""
    projected: bool
    """Whether the mid-joint term is in it."""
    moves_away: bool
    """Whether links before the hand move away in it."""
    away: NullSpaceLimits
    """How, if so."""
    times_blocked: bool
    """Whether the time is counted for which the path is blocked."""
    period_s: float


@value
class MotionSetup:
    """A body, and how it moves."""

    body: Body
    numbers: MotionNumbers
    fields: tuple[Any, ...]
    """Of arm and numbers, for compiled code."""


def motion_setup(body: Body, null_space: NullSpaceMotion | None, budget: int) -> MotionSetup:
    """Return what `joint_motion` is made with; `budget` counts the factorisations after which it gives up."""
    model, t, p = body.model, body.task, null_space or NullSpaceMotion()
    away = NullSpaceLimits(p.distance_m, p.speed_m_s, p.joint_rad_s, p.rate_rad_s2 * t.control_period_s)
    numbers = MotionNumbers(
        cost_params(t), t.orientation_gain_1_s, t.orientation == "hold", budget, body.limits.table, model.q_mid,
        t.mid_joint_projected or null_space is not None, t.mid_joint_projected, null_space is not None, away,
        t.blocked_after_s is not None, body.limits.period,
    )  # fmt: skip
    return MotionSetup(body, numbers, flattened(model.arm, numbers))
