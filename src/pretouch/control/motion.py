"""From what is asked and what is allowed to joint velocities: the joint limits and eq. 2, in one compiled call.

The same as `box_and_brake`, `task`, `task_cost` and `solve` one after the other, and made of the same functions: four
calls from Python cost more time than what they do.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry, inlined
from pretouch.control.blocked import time_blocked
from pretouch.control.interface import MotionRequest, Restricted
from pretouch.control.joint_box import box_and_brake
from pretouch.control.null_space import Near, away, cost_with_null_space
from pretouch.control.penalty import SOLVED, Minimum, Problem, excesses, minimise
from pretouch.control.qp import ENDING, Cost, cost_into, solve
from pretouch.control.restriction import ApproachRows
from pretouch.control.setup import MotionNumbers, MotionSetup
from pretouch.control.task import twist
from pretouch.errors import ParameterError
from pretouch.groups import Arm, JointArrays
from pretouch.robot.model import Kinematics, jacobian_into
from pretouch.types import FloatArray, IntArray, Obstacles, QpOutcome, QpSolution, RobotState
from pretouch.values import value


@value
class MotionState:
    """What the motion remembers from one step to the next."""

    null_velocity: FloatArray
    """(n,) joint velocity asked for in the null space [rad/s]."""
    blocked: float = 0.0
    """How long the arm has been kept from its path [s]; 0 where that is not counted."""


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


_NONE = np.zeros(0)
"""What stands for joint velocities that are not given."""
_ANY = _NONE, _NONE


def joint_motion(
    state: MotionState, setup: MotionSetup, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
    request: MotionRequest, allowed: Restricted,
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
    numbers, a, o = setup.numbers, allowed, obstacles
    n, count, seen = len(robot.q), len(a.h), len(a.which)
    if a.G.shape != (count, n) or seen > count:
        shapes = f"G {a.G.shape}, h {a.h.shape}, which {a.which.shape}"
        raise ParameterError(f"A restriction's rows are {shapes}: G is (R, {n}), h is (R,), which is at most (R,).")
    slowest, fastest = a.speeds or _ANY
    null_velocity = state.null_velocity.copy() if numbers.moves_away else state.null_velocity
    velocity = request.velocity if a.velocity is None else request.velocity + a.velocity
    H, f = cost = np.empty((n, n)), np.empty(n)
    qd, slack, multipliers, velocities = np.empty(n), np.empty(count), np.empty(n + count), np.empty((2, 3))
    ending, violated, blocked = _motion.flat(
        robot.q, robot.qd, robot.q_commanded, robot.qd_commanded, o.link, o.direction, o.body_distance,
        a.G, a.h, a.which, a.weight, slowest, fastest,
        velocity, request.rotation_goal, request.hold, request.tracks,
        request.qd is not None, _NONE if request.qd is None else request.qd,
        null_velocity, state.blocked, H, f, qd, slack, multipliers, velocities, *kin, *setup.fields,
    )  # fmt: skip
    after = MotionState(null_velocity, blocked) if numbers.moves_away or numbers.times_blocked else state
    if violated and a.weight == 0.0 and not request.hold:
        return _motion_with_hard_rows(setup, kin, robot, a, Cost(*cost)), after
    if seen < count:
        slack, multipliers = slack[:seen], multipliers[: n + seen]
    qp = QpSolution(qd, slack, multipliers, *_how_it_ended(request.hold, ending, violated))
    return Motion(qp, a.which, a.h[:seen], velocities[0], velocities[1]), after


def _how_it_ended(hold: bool, ending: int, violated: bool) -> tuple[QpOutcome, str]:
    """Return outcome and sentence for how `minimise` ended, and for whether a row is violated."""
    if hold:
        return QpOutcome.SKIPPED, "not posed: the arm holds"
    if ending != SOLVED:
        return QpOutcome.FAILED, ENDING[ending]
    return QpOutcome.SOLVED, "solved, an approach row is violated" if violated else "solved"


class _Asked(NamedTuple):
    """What compiled code takes of a `MotionRequest`."""

    velocity: FloatArray
    rotation_goal: FloatArray
    hold: bool
    tracks: bool
    by_joint: bool
    """Whether joint velocities are asked for."""
    joints: FloatArray
    """(n,) these [rad/s]; without meaning if not."""


class _Allowed(NamedTuple):
    """What compiled code takes of `Restricted`."""

    G: FloatArray
    h: FloatArray
    which: IntArray
    weight: float
    slowest: FloatArray
    """(n,) or none."""
    fastest: FloatArray
    """(n,) or none."""


class _Memory(NamedTuple):
    """What is remembered."""

    null_velocity: FloatArray
    """Written to."""
    blocked: float


class _Answer(NamedTuple):
    """Room for the answer."""

    H: FloatArray
    """(n, n) of the cost."""
    f: FloatArray
    """(n,) of the cost."""
    qd: FloatArray
    """(n,) joint velocities [rad/s]."""
    slack: FloatArray
    """(R,) violation of each row [m/s]."""
    multipliers: FloatArray
    """(n + R,) of box and rows."""
    velocities: FloatArray
    """(2, 3) of the end-effector origin, measured and answered [m/s]."""


class _Fixed(NamedTuple):
    """What does not change from step to step."""

    arm: Arm
    numbers: MotionNumbers


@entry
def _motion(
    robot: JointArrays, near: Near, allowed: _Allowed, asked: _Asked, memory: _Memory, answer: _Answer,
    kin: Kinematics, fixed: _Fixed,
) -> tuple[int, bool, float]:  # fmt: skip
    """Write the answer, and change what is remembered.

    Returns how the solver ended, whether any row is violated, and for how long the path has been blocked [s].
    """
    arm, p = fixed.arm, fixed.numbers
    G, h, which, slack, qd = allowed.G, allowed.h, allowed.which, answer.slack, answer.qd
    n, seen = len(robot.q), len(which)
    if p.moves_away:
        memory.null_velocity[:] = away(memory.null_velocity, G[:seen], which, near, arm.moved_by, p.away)
    J = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J)
    lower, upper, stop = _box(robot, allowed, p)
    ending = SOLVED
    if not asked.hold:
        _pose(J, robot.q, asked, kin.rotation[arm.ee], memory.null_velocity, p, answer)
        minimum = Minimum(qd, slack, answer.multipliers)
        ending = minimise(Problem(answer.H, answer.f, lower, upper, G, h, allowed.weight), p.budget, minimum)
    if asked.hold or ending != SOLVED:
        qd[:], answer.multipliers[:] = stop, 0.0
        excesses(G, h, qd, slack)
    _hand_velocities(J, robot.qd, qd, p.in_null_space, answer.velocities)
    violated, blocked = False, memory.blocked
    for k in range(len(h)):
        violated = violated or slack[k] > 0.0
    if p.times_blocked and asked.tracks and not asked.hold:
        hand, towards = np.empty(seen, np.bool_), np.empty((seen, 3))
        for k in range(seen):
            hand[k] = arm.moved_by[near.link[which[k]]].all()
            towards[k] = near.direction[which[k]]
        moving = answer.velocities[1]
        blocked = time_blocked(blocked, asked.velocity, moving, towards, h[:seen], hand, p.period_s)
    return ending, violated, blocked


@inlined
def _box(robot: JointArrays, allowed: _Allowed, p: MotionNumbers) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the joint box, what is allowed of it, and how to brake in it (n,) [rad/s]."""
    lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, p.limits)
    slowest, fastest = allowed.slowest, allowed.fastest
    # what the acceleration does not allow comes later: the box is never empty
    for i in range(len(slowest)):
        least, most = lower[i], upper[i]
        lower[i], upper[i] = min(max(slowest[i], least), most), min(max(fastest[i], least), most)
    return lower, upper, stop


@inlined
def _pose(
    J: FloatArray, q: FloatArray, asked: _Asked, rotation: FloatArray, null_velocity: FloatArray, p: MotionNumbers,
    answer: _Answer,
) -> None:  # fmt: skip
    """Write the cost of eq. 2, or of how far the joint velocities are from those asked for."""
    H, f = answer.H, answer.f
    if asked.by_joint:
        H[:], f[:] = np.eye(len(q)), -asked.joints
        return
    m = 6 if p.holds_orientation else 3
    x_d = twist(asked.velocity, rotation, asked.rotation_goal, p.orientation_gain_1_s)
    if p.in_null_space:
        H[:], f[:] = cost_with_null_space(J[:m], x_d[:m], q, p.q_mid, p.cost, p.projected, null_velocity)
    else:
        cost_into(J[:m], x_d[:m], q, p.q_mid, p.cost, H, f)


@compiled
def _hand_velocities(
    J: FloatArray, measured: FloatArray, answered: FloatArray, in_null_space: bool, velocities: FloatArray
) -> None:
    """Write the end-effector's velocities (2, 3) [m/s], those measured and those answered."""
    if in_null_space:
        # what was published of such profiles has the last digit of this product, which is not that of the sum below
        velocities[0], velocities[1] = J[:3] @ measured, J[:3] @ answered
        return
    for i in range(3):
        velocities[0, i], velocities[1, i] = 0.0, 0.0
        for j in range(len(measured)):
            velocities[0, i] += J[i, j] * measured[j]
            velocities[1, i] += J[i, j] * answered[j]


def _motion_with_hard_rows(
    setup: MotionSetup, kin: Kinematics, robot: RobotState, allowed: Restricted, cost: Cost
) -> Motion:
    """Answer of `joint_motion` where a hard row is in the way, which takes another solver."""
    a, J = allowed, setup.body.model.ee_jacobian(kin)[:3]
    lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, setup.numbers.limits)
    if a.speeds is not None:
        slowest, fastest = a.speeds
        lower, upper = np.clip(slowest, lower, upper), np.clip(fastest, lower, upper)
    qp = solve(cost, lower, upper, ApproachRows(a.G, a.h, soft=False), 0.0, stop, setup.numbers.budget)
    seen = len(a.which)
    of_obstacles = QpSolution(qp.qd, qp.slack[:seen], qp.multipliers[: len(qp.qd) + seen], qp.outcome, qp.status)
    return Motion(of_obstacles, a.which, a.h[:seen], J @ robot.qd, J @ qp.qd)
