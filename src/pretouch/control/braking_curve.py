"""The part `braking` of a profile: the rows of `control.braking` in place of eqs. 5-7."""

import sys
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor
from pretouch.compiled import entry, flattened
from pretouch.control.braking import (
    MOST_ROWS,
    BrakingLimits,
    Mass,
    Slots,
    TouchLimits,
    braking_rows,
    slots_init,
    touch_limits,
    widened,
)
from pretouch.control.interface import CompiledRows, MotionBody, MotionRequest, Restriction
from pretouch.control.motion_entry import Allowed, Ended, Fixed, Step, motion_within
from pretouch.control.qp import Rows
from pretouch.groups import Chain, Kinematics, Links, Mechanism, ObstacleArrays
from pretouch.params import BrakingParams
from pretouch.robot.kinematics import mass_matrix_into
from pretouch.types import WHOLE, FloatArray, IntArray, Obstacles, RobotState


@dataclass(frozen=True)
class BrakingCurve(BrakingParams, Restriction, name="braking"):
    """How fast the body may come near, so that it could stop, or touch gently."""

    State = Slots

    def on(self, body: MotionBody) -> Restriction:
        """Return the same with what compiled code takes of the parameters."""
        return _OnBody(self, body)

    def init(self, body: MotionBody) -> Slots:
        """Return the rows with nothing near."""
        return slots_init(body.units)

    def step(
        self, state: Slots, body: MotionBody, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
        request: MotionRequest,
    ) -> tuple[CompiledRows, Slots]:  # fmt: skip
        """Return the rows of `braking_rows`, and how tight each is."""
        return _OnBody(self, body).step(state, body, kin, robot, obstacles, request)


_ALL = sys.maxsize
"""More units than there are: all that they show may be touched."""


class _OnBody(Restriction):
    """A `BrakingCurve` that works for one body."""

    def __init__(self, params: BrakingParams, body: MotionBody) -> None:
        p, across, mass = params, params.tangential, params.effective_mass
        self._weight = p.slack_weight
        self._limits = BrakingLimits(
            p.d_notice_m, p.deceleration_m_s2, p.latency_s, p.margin_m, p.retreat_max_m_s,
            # what is switched off never binds: no speed is above this deadband, no distance below -inf
            np.inf if p.closing_deadband_m_s is None else p.closing_deadband_m_s,
            -np.inf if across is None else across.distance_m, 0.0 if across is None else across.speed_m_s,
            body.task.speed_m_s, p.tighten_m_s2, p.loosen_m_s2, body.limits.period, _ALL,
        )  # fmt: skip
        # M is of the links alone; an impact has to stop the rotors too: I_r of docs/explanation/anticipation.md
        inertia = 0.0 if mass is None else mass.rotor_inertia_kg_m2
        self._arm = Inertia(mass is not None, inertia, body.model.mechanism.links)
        self._touching = touch_limits(p)
        self._numbers = flattened(self._touching, self._limits, self._weight, self._arm)

    def step(
        self, state: Slots, body: MotionBody, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
        request: MotionRequest,
    ) -> tuple[CompiledRows, Slots]:  # fmt: skip
        slots = widened(state, request.units)
        count, most = len(obstacles.unit), MOST_ROWS * (len(slots.link) // 2)
        room = np.empty((most, len(robot.q))), np.empty(most), np.empty(count, WHOLE)
        touching, limits = self._touching, self._limits
        if request.touch is not None:
            # a touch speed whatever the mass, and no heed of what moves by itself
            touching, limits = TouchLimits(np.inf, 1.0, 1.0, request.touch), limits._replace(deadband_m_s=np.inf)
        if request.untouched is not None:
            limits = limits._replace(untouched=request.untouched)
        numbers = self._numbers if limits is self._limits else flattened(touching, limits, self._weight, self._arm)
        return CompiledRows(
            _motion, room, self._weight, (obstacles.unit, obstacles.closing_speed, *slots, *numbers)
        ), slots


class _Seen(NamedTuple):
    """What the rows need to know of obstacles beside where they are."""

    unit: IntArray
    """(K,) index of the unit that shows each."""
    closing_speed: FloatArray
    """(K,) speed of the object itself towards the body [m/s]."""


class Inertia(NamedTuple):
    """What the arm's effective mass is made of."""

    counts: bool
    """Whether the touch speed follows from it."""
    rotor_inertia_kg_m2: float
    """Of each joint."""
    links: Links


class _Slowing(NamedTuple):
    """What the rows are made of."""

    touching: TouchLimits
    limits: BrakingLimits
    weight: float
    inertia: Inertia


@entry
def _motion(
    step: Step, rows: Rows, fixed: Fixed, seen: _Seen, slots: Slots, p: _Slowing
) -> Ended:  # fmt: skip
    """Change the slots, and write the rows and the answer within them."""
    kin, near, n = step.kin, step.near, len(step.robot.q)
    obstacles = ObstacleArrays(
        seen.unit, near.link, near.body_point, near.direction, near.body_distance, seen.closing_speed
    )
    # posture as measured, speeds as commanded: a row tightens from what the arm was sent last
    chain = Chain(kin.anchor, kin.axis, fixed.arm.moved_by, step.robot.qd_commanded)
    M, L, counts = np.empty((n, n)), np.eye(n), p.inertia.counts and len(near.link) > 0
    if counts:
        mass_matrix_into(kin, Mechanism(fixed.arm, p.inertia.links), M)
        for j in range(n):
            M[j, j] += p.inertia.rotor_inertia_kg_m2
        counts = factor(M, L)  # a mass matrix that cannot be factored leaves the largest touch speed
    count, found = braking_rows(slots, obstacles, chain, Mass(counts, L), p.touching, p.limits, rows)
    none = np.empty(0)
    allowed = Allowed(rows.G[:found], rows.h[:found], rows.which[:count], p.weight, none, none, False)
    return motion_within(step, allowed, fixed)
