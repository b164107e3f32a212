"""From what is asked and what is allowed to joint velocities, in one compiled call."""

import math
from typing import Any

import numpy as np

from pretouch.compiled import flattened
from pretouch.control.interface import CompiledRows, MotionBody, MotionRequest, Restricted, Restriction
from pretouch.control.motion_entry import Fixed, MotionNumbers, given_motion
from pretouch.control.null_space import NullSpaceLimits
from pretouch.control.penalty import INFEASIBLE, SOLVED
from pretouch.control.qp import ENDING, cost_params
from pretouch.errors import ParameterError
from pretouch.groups import Kinematics
from pretouch.params import NullSpaceMotion
from pretouch.types import WHOLE, FloatArray, IntArray, Obstacles, QpOutcome, QpSolution, RobotState
from pretouch.values import value


@value
class MotionState:
    """What the motion remembers from one step to the next."""

    null_velocity: FloatArray
    """(n,) joint velocity asked for in the null space [rad/s]."""


@value
class Motion:
    """What the arm is to do, and what kept it from doing more."""

    qp: QpSolution
    restricted: IntArray
    """(K',) which of the obstacles restrict the arm."""
    approach_limit: FloatArray
    """(K',) approach limit for each of them [m/s]."""
    ee_velocity: FloatArray
    """(3,) measured velocity of the end-effector origin [m/s]."""
    ee_velocity_commanded: FloatArray
    """(3,) velocity of the end-effector origin with the joint velocities of the answer [m/s]."""


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


_NONE = np.zeros(0)
"""What stands for joint velocities that are not given."""
_ANY = _NONE, _NONE


def joint_motion(
    state: MotionState, setup: MotionSetup, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
    request: MotionRequest, allowed: Restricted | CompiledRows,
) -> tuple[Motion, MotionState]:  # fmt: skip
    """Joint velocities that track the task (eq. 2) within the joint limits and what is allowed, and what to remember.

    Args:
        state: what is remembered.
        setup: body and parameters.
        kin: posture.
        robot: state of the arm.
        obstacles: what is near.
        request: what is asked.
        allowed: what a restriction allows.
    """
    n, o, velocity = len(robot.q), obstacles, request.velocity
    if isinstance(allowed, CompiledRows):
        rows = allowed
    else:
        rows = _given(allowed, n)
        velocity = velocity if allowed.velocity is None else velocity + allowed.velocity
    G, h, which = rows.room
    # compiled code writes to it, and a step leaves the state it was given as it is
    null_velocity = state.null_velocity.copy() if setup.moves_away else state.null_velocity
    qd, velocities = np.empty(n), np.empty((2, 3))
    slack, multipliers = np.empty(len(h)), np.empty(n + len(h))
    # Field by field in the order of `Step`, `Rows` and `Fixed`, 1 us faster than by groups. No type checker finds two
    # fields of one type that have changed places.
    seen, ending, violated = rows.motion.flat(
        robot.q, robot.qd, robot.q_commanded, robot.qd_commanded,
        o.link, o.body_point, o.direction, o.body_distance,
        velocity, request.rotation_goal, request.hold, _NONE if request.qd is None else request.qd,
        null_velocity, qd, slack, multipliers, velocities, *kin,
        G, h, which, *setup.fields, *rows.numbers,
    )  # fmt: skip
    # what remembers nothing hands its state on, and makes no new one in each step
    after = MotionState(null_velocity) if setup.moves_away else state
    which, limit = which[:seen], h[:seen]
    # a step reports the rows of obstacles; those that a restriction adds behind them belong to none
    qp = QpSolution(qd, slack[:seen], multipliers[: n + seen], *_how_it_ended(request.hold, ending, violated))
    return Motion(qp, which, limit, velocities[0], velocities[1]), after


def _how_it_ended(hold: bool, ending: int, violated: bool) -> tuple[QpOutcome, str, bool]:
    """Return outcome and sentence for how a minimisation ended, and whether its solution violates a row."""
    if hold:
        return QpOutcome.SKIPPED, "not posed: the arm holds", False
    if ending != SOLVED:
        return QpOutcome.INFEASIBLE if ending == INFEASIBLE else QpOutcome.FAILED, ENDING[ending], False
    return QpOutcome.SOLVED, "solved, an approach row is violated" if violated else "solved", violated


def _given(a: Restricted, n: int) -> CompiledRows:
    """Return what compiled code takes of rows that a part made itself."""
    count, seen = len(a.h), len(a.which)
    if a.G.shape != (count, n) or seen > count:
        shapes = f"G {a.G.shape}, h {a.h.shape}, which {a.which.shape}"
        raise ParameterError(f"A restriction's rows are {shapes}: G is (R, {n}), h is (R,), which is at most (R,).")
    # other types or orders in memory would be compiled for anew, while the arm waits
    rows = np.ascontiguousarray(a.G, float), np.ascontiguousarray(a.h, float), np.ascontiguousarray(a.which, WHOLE)
    slowest, fastest = (np.ascontiguousarray(speed, float) for speed in a.speeds or _ANY)
    return CompiledRows(given_motion, rows, a.weight, (float(a.weight), slowest, fastest, True))


class _Unrestricted(Restriction):
    """Allows everything."""

    def __init__(self, n: int) -> None:
        nothing = np.zeros((0, n)), np.zeros(0), np.zeros(0, WHOLE)
        self._all = CompiledRows(given_motion, nothing, 1.0, (1.0, *_ANY, False))  # any weight but 0, which is hard

    def step(
        self, state: Any, body: MotionBody, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
        request: MotionRequest,
    ) -> tuple[CompiledRows, Any]:  # fmt: skip
        return self._all, state


def restriction_on(part: Restriction | None, body: MotionBody) -> Restriction:
    """Return a restriction that works for a body; for None one that allows everything."""
    return _Unrestricted(body.model.n) if part is None else part.on(body)
