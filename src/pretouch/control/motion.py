"""From what is near and what is asked to joint velocities: eqs. 5-7, the joint limits and eq. 2, in one compiled call.

The same as `approach_rows`, `box_and_brake`, `task`, `task_cost` and `solve` one after the other, and made of the same
functions: five calls from Python cost more time than what they do.
"""

import numpy as np

from pretouch.compiled import compiled
from pretouch.control.baselines import MODES, baseline_motion
from pretouch.control.joint_box import JointLimits, box_and_brake
from pretouch.control.penalty import SOLVED, excesses, minimise
from pretouch.control.qp import ENDING, Cost, cost_into, solve, task_cost
from pretouch.control.restriction import approach_rows, least_limit, rows_into
from pretouch.control.task import task, twist
from pretouch.params import Profile
from pretouch.robot.model import Kinematics, RobotModel, jacobian_into
from pretouch.types import WHOLE, BoolArray, FloatArray, IntArray, Obstacles, QpOutcome, QpSolution, RobotState
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
    model: RobotModel,
    kin: Kinematics,
    robot: RobotState,
    obstacles: Obstacles,
    velocity: FloatArray,
    rotation_goal: FloatArray,
    limits: JointLimits,
    profile: Profile,
    hold: bool,
    reaction_qd: FloatArray | None = None,
) -> Motion:
    """Joint velocities that track the task (eq. 2) within joint limits and approach limits (eqs. 5-7).

    Args:
        model: the arm.
        kin: its posture.
        robot: its state.
        obstacles: what is near.
        velocity: (3,) asked of the end-effector origin [m/s].
        rotation_goal: (3, 3) R_O_ee to hold, if the task asks for it.
        limits: joint limits.
        profile: parameters.
        hold: whether to brake, whatever is asked.
        reaction_qd: (n,) joint velocities asked for in place of the task's [rad/s]; within the same limits.
    """
    t, r = profile.task, profile.restriction
    if r.mode in MODES:
        return Motion(*baseline_motion(model, kin, robot, obstacles, velocity, rotation_goal, limits, profile, hold))
    n, count = model.n, 0 if r.mode == "off" else len(obstacles.unit)
    qd, multipliers, velocities = np.empty(n), np.empty(n + count), np.empty((2, 3))
    restricted, rows = np.empty(count, WHOLE), np.empty((2, count))
    soft = r.mode != "hard"
    found, ending, violated = _motion(
        kin.position, kin.rotation, kin.anchor, kin.axis, model.moved_by, model.ee,
        robot.q, robot.qd, robot.q_commanded, robot.qd_commanded,
        obstacles.link if count else _NO_LINK, obstacles.body_point, obstacles.direction, obstacles.body_distance,
        velocity, rotation_goal, model.q_mid, limits.table,
        r.v_max_m_s, r.beta, r.d_crit_m, r.d_repulse_m, r.d_notice_m, least_limit(r), r.slack_weight if soft else 0.0,
        t.orientation == "hold", t.orientation_gain_1_s, t.damping_max, t.manipulability_threshold, t.mid_joint_gain,
        t.mid_joint_time_s, profile.failure.solver_iterations, hold, _NO_JOINT if reaction_qd is None else reaction_qd,
        qd, multipliers, velocities, restricted, rows,
    )  # fmt: skip
    if violated and not soft and not hold:
        return _motion_with_hard_rows(
            model, kin, robot, obstacles, velocity, rotation_goal, limits, profile, reaction_qd
        )
    outcome, status = QpOutcome.SOLVED, "solved, an approach row is violated" if violated else "solved"
    if hold:
        outcome, status = QpOutcome.SKIPPED, "not posed: the arm holds"
    elif ending != SOLVED:
        outcome, status = QpOutcome.FAILED, ENDING[ending]
    qp = QpSolution(qd, rows[1, :found], multipliers[: n + found], outcome, status)
    return Motion(qp, restricted[:found], rows[0, :found], velocities[0], velocities[1])


_NO_LINK = np.zeros(0, np.int64)
_NO_JOINT = np.zeros(0)


@compiled
def _motion(
    position: FloatArray, rotation: FloatArray, anchor: FloatArray, axis: FloatArray, moved_by: BoolArray, ee: int,
    q: FloatArray, qd: FloatArray, q_commanded: FloatArray, qd_commanded: FloatArray,
    link: IntArray, body_point: FloatArray, direction: FloatArray, body_distance: FloatArray,
    velocity: FloatArray, rotation_goal: FloatArray, q_mid: FloatArray, limits: FloatArray,
    v_max: float, beta: float, d_crit: float, d_repulse: float, d_notice: float, floor: float, weight: float,
    keep_orientation: bool, orientation_gain: float, damping_max: float, threshold: float, mid_gain: float,
    mid_time: float, budget: int, hold: bool, reaction_qd: FloatArray,
    answer: FloatArray, multipliers: FloatArray, velocities: FloatArray, restricted: IntArray, rows: FloatArray,
) -> tuple[int, int, bool]:  # fmt: skip
    """Write the last line of arguments; return how many rows, how the solver ended, and whether any is violated."""
    n, limit, slack = len(q), rows[0], rows[1]
    J = np.empty((6, n))
    jacobian_into(anchor, axis, moved_by[ee], position[ee], J)

    G = np.empty((len(link), n))
    found = rows_into(
        anchor, axis, moved_by, link, body_point, direction, body_distance, v_max, beta, d_crit, d_repulse, d_notice,
        floor, G, limit, restricted,
    )  # fmt: skip
    G, h = G[:found], limit[:found]
    lower, upper, stop = box_and_brake(q_commanded, qd_commanded, limits)
    ending = SOLVED
    if not hold:
        m = 6 if keep_orientation else 3
        x_d = twist(velocity, rotation[ee], rotation_goal, orientation_gain)
        H, f = np.empty((n, n)), np.empty(n)
        if len(reaction_qd):
            H[:], f[:] = np.eye(n), -reaction_qd
        else:
            cost_into(J[:m], x_d[:m], q, q_mid, damping_max, threshold, mid_gain, mid_time, H, f)
        ending = minimise(H, f, lower, upper, G, h, weight, budget, answer, slack[:found], multipliers[: n + found])
    if hold or ending != SOLVED:
        for j in range(n):
            answer[j] = stop[j]
        for j in range(len(multipliers)):
            multipliers[j] = 0.0
        excesses(G, h, answer, slack)

    for i in range(3):
        velocities[0, i], velocities[1, i] = 0.0, 0.0
        for j in range(n):
            velocities[0, i] += J[i, j] * qd[j]
            velocities[1, i] += J[i, j] * answer[j]
    violated = False
    for k in range(found):
        violated = violated or slack[k] > 0
    return found, ending, violated


def _motion_with_hard_rows(
    model: RobotModel, kin: Kinematics, robot: RobotState, obstacles: Obstacles, velocity: FloatArray,
    rotation_goal: FloatArray, limits: JointLimits, profile: Profile, reaction_qd: FloatArray | None,
) -> Motion:  # fmt: skip
    """Answer of `joint_motion` where a hard row is in the way, which takes another solver."""
    rows, restricted = approach_rows(kin, model.moved_by, obstacles, profile.restriction)
    J = model.ee_jacobian(kin)
    goal = task(J, velocity, kin.rotation[model.ee], rotation_goal, profile.task)
    cost = task_cost(*goal, robot.q, model.q_mid, profile.task)
    if reaction_qd is not None:
        cost = Cost(np.eye(model.n), -reaction_qd)
    lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, limits.table)
    qp = solve(cost, lower, upper, rows, profile.restriction.slack_weight, stop, profile.failure.solver_iterations)
    return Motion(qp, restricted, rows.h, J[:3] @ robot.qd, J[:3] @ qp.qd)
