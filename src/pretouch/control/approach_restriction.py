"""The part `paper` of a profile: what the approach to obstacles may be, eqs. 5-7."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch.compiled import entry, flattened
from pretouch.control.interface import CompiledRows, MotionBody, MotionRequest, Restricted, Restriction
from pretouch.control.motion_entry import Allowed, Ended, Fixed, Step, motion_within
from pretouch.control.restriction import ApproachParams, Rows, approach_params, approach_rows, rows_into
from pretouch.groups import Kinematics
from pretouch.params import RestrictionParams
from pretouch.types import WHOLE, Obstacles, RobotState


@dataclass(frozen=True)
class ApproachRestriction(RestrictionParams, Restriction, name="paper"):
    """Restricting the body's approach to obstacles, as in the paper (eqs. 5-7)."""

    def on(self, body: MotionBody) -> Restriction:
        """Return the same for compiled code, which writes the rows where it solves."""
        return _OnBody(self)

    def step(
        self, state: Any, body: MotionBody, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
        request: MotionRequest,
    ) -> tuple[Restricted, Any]:  # fmt: skip
        """Return the rows of `approach_rows`; nothing is remembered."""
        rows, which = approach_rows(kin, body.model.moved_by, obstacles, self)
        return Restricted(rows.G, rows.h, which, self.slack_weight if rows.soft else 0.0), state


class _OnBody(Restriction):
    """An `ApproachRestriction` that works."""

    def __init__(self, params: RestrictionParams) -> None:
        self._weight = 0.0 if params.rows == "hard" else params.slack_weight  # 0 marks hard rows, see `Restricted`
        self._numbers = flattened(approach_params(params), self._weight)

    def step(
        self, state: Any, body: MotionBody, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
        request: MotionRequest,
    ) -> tuple[CompiledRows, Any]:  # fmt: skip
        count = len(obstacles.unit)
        # a row for each obstacle at most: which of them are within d_notice is found out while the rows are written
        room = np.empty((count, len(robot.q))), np.empty(count), np.empty(count, WHOLE)
        return CompiledRows(_motion, room, self._weight, self._numbers), state


@entry
def _motion(step: Step, rows: Rows, fixed: Fixed, params: ApproachParams, weight: float) -> Ended:
    """Write the rows of eqs. 5-7 and the answer within them."""
    found = rows_into(step.kin, fixed.arm.moved_by, step.near, params, rows)
    # eqs. 5-7 bound no joint speed; an empty array says so, for None would be another type to compile for
    none = np.empty(0)
    allowed = Allowed(rows.G[:found], rows.h[:found], rows.which[:found], weight, none, none, False)
    return motion_within(step, allowed, fixed)


def of_table_i(part: Restriction | None) -> ApproachRestriction:
    """Return a profile's restriction if it is of eqs. 5-7, else one with the values of Table I."""
    return part if isinstance(part, ApproachRestriction) else ApproachRestriction()


def notice_m(part: Restriction | None) -> float:
    """Return from which body distance on a restriction allows everything [m]: its own, or Table I's."""
    return float(getattr(part, "d_notice_m", ApproachRestriction.d_notice_m))
