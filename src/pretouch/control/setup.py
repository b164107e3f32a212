"""What the arm's motion is made with, set up once."""

import math
from typing import Any

from pretouch.compiled import flattened
from pretouch.control.interface import MotionBody
from pretouch.control.motion_entry import Fixed, MotionNumbers
from pretouch.control.null_space import NullSpaceLimits
from pretouch.control.qp import cost_params
from pretouch.params import NullSpaceMotion
from pretouch.values import value


@value
class MotionSetup:
    """A body, and how it moves."""

    body: MotionBody
    numbers: MotionNumbers
    moves_away: bool
    """Whether links before the hand move away in the null space."""
    fields: tuple[Any, ...]
    """Of `Fixed`, for compiled code."""


def motion_setup(body: MotionBody, null_space: NullSpaceMotion | None, budget: int) -> MotionSetup:
    """Return what `joint_motion` is made with; `budget` counts the factorisations after which it gives up."""
    model, t, p, moves_away = body.model, body.task, null_space or NullSpaceMotion(), null_space is not None
    within = p.distance_m if moves_away else -math.inf  # nothing is nearer than that, so nothing moves away
    numbers = MotionNumbers(
        cost_params(t), t.orientation_gain_1_s, t.orientation == "hold", budget, body.limits.table, model.q_mid,
        t.mid_joint_projected, NullSpaceLimits(within, p.speed_m_s, p.joint_rad_s, p.rate_rad_s2 * t.control_period_s),
    )  # fmt: skip
    return MotionSetup(body, numbers, moves_away, flattened(Fixed(model.arm, numbers)))
