"""From what is near and what is asked to joint velocities: eqs. 5-7, the joint limits and eq. 2, in one compiled call.

The same as `approach_rows`, `box_and_brake`, `task`, `task_cost` and `solve` one after the other, and made of the same
functions: five calls from Python cost more time than what they do.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import entry
from pretouch.control.baselines import MODES, baseline_motion
from pretouch.control.joint_box import box_and_brake
from pretouch.control.penalty import SOLVED, Minimum, Problem, excesses, minimise
from pretouch.control.qp import ENDING, Cost, cost_into, solve, task_cost
from pretouch.control.restriction import Rows, approach_rows, rows_into
from pretouch.control.setup import NO_JOINTS, Asked, MotionNumbers, MotionRequest, MotionSetup
from pretouch.control.task import task, twist
from pretouch.groups import NOTHING_NEAR, Arm, JointArrays, ObstacleArrays
from pretouch.robot.model import Kinematics, jacobian_into
from pretouch.types import WHOLE, FloatArray, IntArray, Obstacles, QpOutcome, QpSolution, RobotState
from pretouch.values import value


@value
class Motion:
    """What the arm is to do, and what kept it from doing more."""

    qp: QpSolution
    restricted: IntArray
    """(K',) which of the obstacles restrict the arm."""
    approach_limit: FloatArray
    """(K',) approach limit for each of them, of eq. 7 or the braking curve [m/s]."""
    ee_velocity: FloatArray
    """(3,) measured velocity of the end-effector origin [m/s]."""
    ee_velocity_commanded: FloatArray
    """(3,) velocity of the end-effector origin with the joint velocities of the answer [m/s]."""


def joint_motion(
    setup: MotionSetup, kin: Kinematics, robot: RobotState, obstacles: Obstacles, request: MotionRequest
) -> Motion:
    """Joint velocities that track the task (eq. 2) within joint limits and approach limits (eqs. 5-7).

    Args:
        setup: arm, limits and parameters.
        kin: posture.
        robot: state of the arm.
        obstacles: what is near.
        request: what is asked.
    """
    model, restriction = setup.model, setup.profile.restriction
    if restriction.mode in MODES:
        return Motion(*baseline_motion(setup, kin, robot, obstacles, request))
    n, count = model.n, 0 if restriction.mode == "off" else len(obstacles.unit)
    qd, multipliers, velocities = np.empty(n), np.empty(n + count), np.empty((2, 3))
    restricted, rows = np.empty(count, WHOLE), np.empty((2, count))
    o = obstacles if count else NOTHING_NEAR
    found, ending, violated = _motion.flat(
        robot.q, robot.qd, robot.q_commanded, robot.qd_commanded,
        o.unit, o.link, o.body_point, o.direction, o.body_distance, o.closing_speed,
        request.velocity, request.rotation_goal, request.hold, request.tracks,
        request.qd is not None, NO_JOINTS if request.qd is None else request.qd,
        qd, multipliers, velocities, restricted, rows, *kin, *setup.fields,
    )  # fmt: skip
    if violated and restriction.mode == "hard" and not request.hold:
        return _motion_with_hard_rows(setup, kin, robot, obstacles, request)
    qp = QpSolution(qd, rows[1, :found], multipliers[: n + found], *how_it_ended(request.hold, ending, violated))
    return Motion(qp, restricted[:found], rows[0, :found], velocities[0], velocities[1])


def how_it_ended(hold: bool, ending: int, violated: bool) -> tuple[QpOutcome, str]:
    """Return outcome and sentence for how `minimise` ended, and for whether a row is violated."""
    if hold:
        return QpOutcome.SKIPPED, "not posed: the arm holds"
    if ending != SOLVED:
        return QpOutcome.FAILED, ENDING[ending]
    return QpOutcome.SOLVED, "solved, an approach row is violated" if violated else "solved"


class _Answer(NamedTuple):
    """Room for the answer."""

    qd: FloatArray
    """(n,) joint velocities [rad/s]."""
    multipliers: FloatArray
    """(n + K,) of box and rows."""
    velocities: FloatArray
    """(2, 3) of the end-effector origin, measured and answered [m/s]."""
    restricted: IntArray
    """(K,) which obstacles restrict the arm."""
    rows: FloatArray
    """(2, K) limit and violation of each row [m/s]."""


@entry
def _motion(
    robot: JointArrays, obstacles: ObstacleArrays, asked: Asked, answer: _Answer, kin: Kinematics, arm: Arm,
    numbers: MotionNumbers,
) -> tuple[int, int, bool]:  # fmt: skip
    """Write the answer; return how many rows, how the solver ended, and whether any is violated."""
    n, limit, slack, multipliers = len(robot.q), answer.rows[0], answer.rows[1], answer.multipliers
    J = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J)

    # eqs. 5-7
    G = np.empty((len(obstacles.link), n))
    found = rows_into(kin, arm.moved_by, obstacles, numbers.approach, Rows(G, limit, answer.restricted))
    G, h = G[:found], limit[:found]
    lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, numbers.limits)

    # eq. 2
    ending = SOLVED
    if not asked.hold:
        m = 6 if numbers.holds_orientation else 3
        x_d = twist(asked.velocity, kin.rotation[arm.ee], asked.rotation_goal, numbers.orientation_gain_1_s)
        H, f = np.empty((n, n)), np.empty(n)
        if asked.by_joint:
            H[:], f[:] = np.eye(n), -asked.joints
        else:
            cost_into(J[:m], x_d[:m], robot.q, numbers.q_mid, numbers.cost, H, f)
        minimum = Minimum(answer.qd, slack[:found], multipliers[: n + found])
        ending = minimise(Problem(H, f, lower, upper, G, h, numbers.row_weight), numbers.budget, minimum)
    if asked.hold or ending != SOLVED:
        for j in range(n):
            answer.qd[j] = stop[j]
        for j in range(len(multipliers)):
            multipliers[j] = 0.0
        excesses(G, h, answer.qd, slack)

    for i in range(3):
        answer.velocities[0, i], answer.velocities[1, i] = 0.0, 0.0
        for j in range(n):
            answer.velocities[0, i] += J[i, j] * robot.qd[j]
            answer.velocities[1, i] += J[i, j] * answer.qd[j]
    violated = False
    for k in range(found):
        violated = violated or slack[k] > 0
    return found, ending, violated


def _motion_with_hard_rows(
    setup: MotionSetup, kin: Kinematics, robot: RobotState, obstacles: Obstacles, request: MotionRequest
) -> Motion:
    """Answer of `joint_motion` where a hard row is in the way, which takes another solver."""
    model, profile = setup.model, setup.profile
    rows, restricted = approach_rows(kin, model.moved_by, obstacles, profile.restriction)
    J = model.ee_jacobian(kin)
    goal = task(J, request.velocity, kin.rotation[model.ee], request.rotation_goal, profile.task)
    cost = task_cost(*goal, robot.q, model.q_mid, profile.task)
    if request.qd is not None:
        cost = Cost(np.eye(model.n), -request.qd)
    lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, setup.limits.table)
    qp = solve(cost, lower, upper, rows, profile.restriction.slack_weight, stop, profile.failure.solver_iterations)
    return Motion(qp, restricted, rows.h, J[:3] @ robot.qd, J[:3] @ qp.qd)
