"""Joint velocities: the joint limits, and eq. 2 within rows that a restriction wrote."""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import inlined, kernel
from pretouch.control.active_set import minimise_within
from pretouch.control.approach import MotionRequest, Rows
from pretouch.control.joint_box import joint_box
from pretouch.control.penalty import Minimum, Problem, excesses, minimise
from pretouch.control.task import away, cost_into, twist
from pretouch.modes import SOLVED
from pretouch.params import NullSpaceMotion, TaskParams
from pretouch.records import IntCell
from pretouch.robot.kinematics import Arm, Kinematics, jacobian_into
from pretouch.types import FloatArray, IntArray, Obstacles, Report


class MotionNumbers(NamedTuple):
    """What compiled code takes of limits and parameters."""

    arm: Arm
    task: TaskParams
    holds_orientation: bool
    """Whether the end-effector keeps its orientation."""
    budget: int
    """Factorisations after which to give up."""
    limits: Annotated[FloatArray, 9, "n"]
    """`JointLimits.table`."""
    q_mid: Annotated[FloatArray, "n"]
    """(n,) middle of the joint ranges [rad]."""
    away: NullSpaceMotion
    """How links before the hand move away in the null space of the task; within no distance: they do not."""


class Answer(NamedTuple):
    """The answer of eq. 2, see `QpSolution`."""

    command: Annotated[FloatArray, "n"]
    velocities: Annotated[FloatArray, 2, 3]
    """(2, 3) of the end-effector origin, measured and commanded [m/s]."""
    which: Annotated[IntArray, "M"]
    limit: Annotated[FloatArray, "M"]
    slack: Annotated[FloatArray, "M"]
    multipliers: Annotated[FloatArray, "n + M"]
    seen: IntCell
    """Rows that are of obstacles."""
    ending: IntCell
    violated: IntCell


@kernel
def move_within(
    p: MotionNumbers, robot: Report, scene: tuple[Kinematics, FloatArray, Obstacles], request: MotionRequest,
    rows: Rows, speeds: tuple[FloatArray, FloatArray], null_velocity: FloatArray, answer: Answer,
) -> None:  # fmt: skip
    """Write the joint velocities of eq. 2 within the joint limits and rows; change the motion in the null space.

    `scene` is the posture, the end-effector origin (3,) [m], and what is near. `speeds` are least and largest joint
    velocities (n,) [rad/s], or (0,) where only the joint limits count.
    """
    (kin, ee, near), (slowest, fastest), arm, qd = scene, speeds, p.arm, answer.command
    n, seen, count, z = len(qd), len(rows.which), len(rows.h), null_velocity[:0]
    slack, multipliers = np.empty(count), np.empty(n + count)
    if p.away.distance_m > 0.0:
        # of the rows only the first, those of obstacles, are n^T J of something to move away from
        null_velocity[:] = away(
            null_velocity, rows.G[:seen], rows.which, near, arm.moved_by, p.away, p.task.control_period_s
        )
        z = null_velocity[:n]
    J = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], ee, J)
    # the box starts from commanded positions and speeds, where it is exact; Jacobian and cost from measured ones
    lower, upper, stop = joint_box(robot.q_commanded, robot.qd_commanded, p.limits)
    # what the acceleration does not allow comes later: the box is never empty
    for i in range(len(slowest)):
        least, most = lower[i], upper[i]
        lower[i] = min(max(slowest[i], least), most)
        upper[i] = min(max(fastest[i], least), most)
    ending = SOLVED
    if request.hold[0] == 0:
        H, f = np.empty((n, n)), np.empty(n)
        _cost(p, J, robot.q, request, kin.rotation[arm.ee], z, H, f)
        problem, minimum = Problem(H, f, lower, upper, rows.G, rows.h, rows.weight), Minimum(qd, slack, multipliers)
        if rows.weight == 0.0:  # hard rows have no price
            ending = minimise_within(problem, p.budget, minimum)
        else:
            ending = minimise(problem, p.budget, minimum)
    if request.hold[0] == 1 or ending != SOLVED:
        # no answer is sent but one that is a minimum; by how much braking violates the rows is reported all the same
        qd[:], multipliers[:] = stop, 0.0
        excesses(rows.G, rows.h, qd, slack)
    answer.seen[0], answer.ending[0], answer.violated[0] = seen, ending, 0
    answer.velocities[:] = 0.0
    for i in range(3):
        for j in range(n):
            answer.velocities[0, i] += J[i, j] * robot.qd[j]
            answer.velocities[1, i] += J[i, j] * qd[j]
    for k in range(count):
        if slack[k] > 0.0 and rows.weight > 0.0:
            answer.violated[0] = 1
    answer.which[:seen], answer.limit[:seen], answer.slack[:seen] = rows.which, rows.h[:seen], slack[:seen]
    answer.multipliers[: n + seen] = multipliers[: n + seen]


@inlined
def _cost(
    p: MotionNumbers, J: FloatArray, q: FloatArray, request: MotionRequest, rotation: FloatArray, z: FloatArray,
    H: FloatArray, f: FloatArray,
) -> None:  # fmt: skip
    """Write the cost of eq. 2, or of how far the joint velocities are from those asked for."""
    if request.by_joints[0] == 1:
        # 1/2 |qd_asked - qd|^2, a reaction in joint space: H = I is regular in any posture and needs no damping
        H[:], f[:] = np.eye(len(q)), -request.qd
    else:
        # 3 rows for the velocity alone: the rotation stays in the null space, and may drift
        m = 6 if p.holds_orientation else 3
        x_d = twist(request.velocity, rotation, request.goal, p.task.orientation_gain_1_s)
        cost_into(J[:m], x_d[:m], q, p.q_mid, p.task, z, H, f)
