"""Joint velocities: the joint limits, and eq. 2 within rows that a restriction wrote."""

import math
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from pretouch.compiled import inlined, kernel
from pretouch.control.active_set import minimise_within
from pretouch.control.joint_box import JointLimits, box_and_brake
from pretouch.control.null_space import NullSpaceLimits, away, cost_with_null_space
from pretouch.control.penalty import Minimum, Problem, excesses, minimise
from pretouch.control.qp import CostParams, cost_into, cost_params, twist
from pretouch.modes import SOLVED
from pretouch.params import NullSpaceMotion, TaskParams
from pretouch.robot.kinematics import Arm, Kinematics, jacobian_into
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, IntArray, Obstacles

if TYPE_CHECKING:
    from pretouch.faults import Report
    from pretouch.line_records import Answer, Request


class MotionNumbers(NamedTuple):
    """What compiled code takes of limits and parameters."""

    arm: Arm
    cost: CostParams
    orientation_gain_1_s: float
    holds_orientation: bool
    """Whether the end-effector keeps its orientation."""
    budget: int
    """Factorisations after which to give up."""
    limits: Annotated[FloatArray, 9, "n"]
    """`JointLimits.table`."""
    q_mid: Annotated[FloatArray, "n"]
    """(n,) middle of the joint ranges [rad]."""
    projected: bool
    """Whether the mid-joint term is in the null space of the task."""
    away: NullSpaceLimits
    """How links before the hand move away in it; within no distance: they do not."""


def motion_numbers(
    model: RobotModel, limits: JointLimits, task: TaskParams, null_space: NullSpaceMotion | None, budget: int
) -> MotionNumbers:
    """Return what compiled code takes; `budget` counts the factorisations after which the solver gives up."""
    p, t = null_space or NullSpaceMotion(), task
    within = -math.inf if null_space is None else p.distance_m  # nothing is nearer than that, so nothing moves away
    return MotionNumbers(
        model.mechanism.arm, cost_params(t), t.orientation_gain_1_s, t.orientation == "hold", budget, limits.table,
        model.q_mid, t.mid_joint_projected,
        NullSpaceLimits(within, p.speed_m_s, p.joint_rad_s, p.rate_rad_s2 * t.control_period_s),
    )  # fmt: skip


class Allowed(NamedTuple):
    """What compiled code takes of `Restricted`."""

    G: FloatArray
    h: FloatArray
    which: IntArray
    weight: float
    slowest: FloatArray
    """(n,) or none."""
    fastest: FloatArray
    """(n,) or none."""


@kernel
def move_within(
    p: MotionNumbers, robot: "Report", posture: tuple[Kinematics, FloatArray], near: Obstacles,
    request: "Request", allowed: Allowed, null_velocity: FloatArray, answer: "Answer",
) -> None:  # fmt: skip
    """Write the joint velocities of eq. 2 within the joint limits and rows; change the motion in the null space."""
    arm = p.arm
    n, seen, found, (kin, ee) = len(robot.q), len(allowed.which), len(allowed.h), posture
    G, h, qd = allowed.G, allowed.h, answer.command
    slack, multipliers = np.empty(found), np.empty(n + found)
    # of the rows only the first, those of obstacles, are n^T J of something to move away from
    if p.away.distance_m > 0.0:
        null_velocity[:] = away(null_velocity, G[:seen], allowed.which, near, arm.moved_by, p.away)
    J = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], ee, J)
    # the box starts from commanded positions and speeds, where it is exact; Jacobian and cost from measured ones
    lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, p.limits)
    # what the acceleration does not allow comes later: the box is never empty
    for i in range(len(allowed.slowest)):
        least, most = lower[i], upper[i]
        lower[i] = min(max(allowed.slowest[i], least), most)
        upper[i] = min(max(allowed.fastest[i], least), most)
    ending = SOLVED
    if request.hold[0] == 0:
        H, f = np.empty((n, n)), np.empty(n)
        _pose(J, robot.q, request, kin.rotation[arm.ee], null_velocity, p, H, f)
        problem, minimum = Problem(H, f, lower, upper, G, h, allowed.weight), Minimum(qd, slack, multipliers)
        if allowed.weight == 0.0:  # hard rows have no price
            ending = minimise_within(problem, p.budget, minimum)
        else:
            ending = minimise(problem, p.budget, minimum)
    if request.hold[0] == 1 or ending != SOLVED:
        # no answer is sent but one that is a minimum; by how much braking violates the rows is reported all the same
        qd[:], multipliers[:] = stop, 0.0
        excesses(G, h, qd, slack)
    answer.seen[0], answer.ending[0], answer.violated[0] = seen, ending, 0
    answer.velocities[:] = 0.0
    for i in range(3):
        for j in range(n):
            answer.velocities[0, i] += J[i, j] * robot.qd[j]
            answer.velocities[1, i] += J[i, j] * qd[j]
    for k in range(found):
        if slack[k] > 0.0 and allowed.weight > 0.0:
            answer.violated[0] = 1
    answer.which[:seen], answer.limit[:seen], answer.slack[:seen] = allowed.which, h[:seen], slack[:seen]
    answer.multipliers[: n + seen] = multipliers[: n + seen]


@inlined
def _pose(
    J: FloatArray, q: FloatArray, request: "Request", rotation: FloatArray, null_velocity: FloatArray, p: MotionNumbers,
    H: FloatArray, f: FloatArray,
) -> None:  # fmt: skip
    """Write the cost of eq. 2, or of how far the joint velocities are from those asked for."""
    if request.by_joints[0] == 1:
        # 1/2 |qd_asked - qd|^2, a reaction in joint space: H = I is regular in any posture and needs no damping
        H[:], f[:] = np.eye(len(q)), -request.qd
        return
    m = 6 if p.holds_orientation else 3
    # 3 rows for the velocity alone: the rotation stays in the null space, and may drift
    x_d = twist(request.velocity, rotation, request.goal, p.orientation_gain_1_s)
    # eq. 2 as the paper has it needs no projector
    if p.projected or p.away.distance_m > 0.0:
        H[:], f[:] = cost_with_null_space(J[:m], x_d[:m], q, p.q_mid, p.cost, p.projected, null_velocity)
    else:
        cost_into(J[:m], x_d[:m], q, p.q_mid, p.cost, H, f)
