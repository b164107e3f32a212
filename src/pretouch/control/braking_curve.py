"""The part `braking` of a profile: the rows of `control.braking` in place of eqs. 5-7."""

from dataclasses import dataclass

import numpy as np

from pretouch.cholesky import factor
from pretouch.compiled import entry, flattened
from pretouch.control.braking import (
    MOST_ROWS,
    BrakingLimits,
    Mass,
    Slots,
    braking_rows,
    slots_init,
    widened,
)
from pretouch.control.interface import Body, MotionRequest, Restricted, Restriction
from pretouch.control.restriction import Rows
from pretouch.control.touch_speed import TouchLimits, touch_limits
from pretouch.groups import Chain, ObstacleArrays
from pretouch.params import BrakingParams
from pretouch.robot.model import Kinematics
from pretouch.types import WHOLE, FloatArray, Obstacles, RobotState


@dataclass(frozen=True)
class BrakingCurve(BrakingParams, Restriction, name="braking"):
    """How fast the body may come near, so that it could stop, or touch gently."""

    State = Slots

    def on(self, body: Body) -> Restriction:
        """Return the same with what compiled code takes of the parameters."""
        return _OnBody(self, body)

    def init(self, body: Body) -> Slots:
        """Return the rows with nothing near."""
        return slots_init(body.units)

    def step(
        self, state: Slots, body: Body, kin: Kinematics, robot: RobotState, obstacles: Obstacles, request: MotionRequest
    ) -> tuple[Restricted, Slots]:  # fmt: skip
        """Return the rows of `braking_rows`, and how tight each is."""
        return self.on(body).step(state, body, kin, robot, obstacles, request)


_NO_MASS = np.zeros((0, 0))


class _OnBody(Restriction):
    """A `BrakingCurve` that works for one body."""

    def __init__(self, params: BrakingParams, body: Body) -> None:
        p, across, mass = params, params.tangential, params.effective_mass
        self._weight, self._moved_by = p.slack_weight, body.model.moved_by
        self._rotors = None if mass is None else mass.rotor_inertia_kg_m2 * np.eye(body.model.n)
        self._limits = BrakingLimits(
            p.d_notice_m, p.deceleration_m_s2, p.latency_s, p.margin_m, p.retreat_max_m_s,
            np.inf if p.closing_deadband_m_s is None else p.closing_deadband_m_s,
            -np.inf if across is None else across.distance_m, 0.0 if across is None else across.speed_m_s,
            body.task.speed_m_s, p.tighten_m_s2, p.loosen_m_s2, body.limits.period,
        )  # fmt: skip
        self._numbers = flattened(touch_limits(p), self._limits)

    def step(
        self, state: Slots, body: Body, kin: Kinematics, robot: RobotState, obstacles: Obstacles, request: MotionRequest
    ) -> tuple[Restricted, Slots]:  # fmt: skip
        o, n, slots = obstacles, len(robot.q), widened(state, request.units)
        room, count = MOST_ROWS * (len(slots.link) // 2), len(o.unit)
        G, h, which = np.empty((room, n)), np.empty(room), np.empty(count, WHOLE)
        counts, mass = False, _NO_MASS
        if self._rotors is not None and count > 0:
            counts, mass = True, body.model.mass_matrix(robot.q) + self._rotors
        numbers = self._numbers
        if request.touch is not None:
            # a touch speed whatever the mass, and no heed of what moves by itself
            still = self._limits._replace(deadband_m_s=np.inf)
            numbers = flattened(TouchLimits(np.inf, 1.0, 1.0, request.touch), still)
        seen, found = _rows.flat(
            *slots, o.unit, o.link, o.body_point, o.direction, o.body_distance, o.closing_speed,
            kin.anchor, kin.axis, self._moved_by, robot.qd_commanded, counts, mass, G, h, which, *numbers,
        )  # fmt: skip
        return Restricted(G[:found], h[:found], which[:seen], self._weight), slots


@entry
def _rows(
    slots: Slots, obstacles: ObstacleArrays, chain: Chain, mass_counts: bool, mass: FloatArray, rows: Rows,
    touching: TouchLimits, limits: BrakingLimits,
) -> tuple[int, int]:  # fmt: skip
    """Change the slots and write the rows; return how many are of what is seen, and how many there are."""
    L = np.eye(len(chain.qd))
    return braking_rows(slots, obstacles, chain, Mass(mass_counts and factor(mass, L), L), touching, limits, rows)
