"""Joint velocities: eq. 2 within the joint limits and the rows of a restriction."""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import inlined, kernel
from pretouch.control.active_set import minimise_within
from pretouch.control.approach import ConstraintRows, MotionRequest
from pretouch.control.joint_box import joint_box
from pretouch.control.penalty import Minimum, QuadraticProgram, excesses, minimise
from pretouch.control.task import away, cost_into, twist
from pretouch.modes import SOLVED
from pretouch.params import NullSpaceMotion, TaskParams
from pretouch.records import IntCell
from pretouch.robot.kinematics import ArmTopology, Kinematics, jacobian_into
from pretouch.types import FloatArray, IntArray, Obstacles, Report


class MotionNumbers(NamedTuple):
    """Limits and parameters for compiled code."""

    arm: ArmTopology
    task: TaskParams
    holds_orientation: bool
    """True if the end-effector keeps its orientation."""
    budget: int
    """Largest number of factorisations."""
    limits: Annotated[FloatArray, 9, "n"]
    """`JointLimits.table`."""
    q_mid: Annotated[FloatArray, "n"]
    """(n,) middle of the joint ranges [rad]."""
    away: NullSpaceMotion
    """Motion of links before the hand away from obstacles in the null space of the task; none at a distance of -inf."""


class MotionAnswer(NamedTuple):
    """The solution of eq. 2, see `QpSolution`."""

    command: Annotated[FloatArray, "n"]
    velocities: Annotated[FloatArray, 2, 3]
    """(2, 3) of the end-effector origin, measured and commanded [m/s]."""
    which: Annotated[IntArray, "M"]
    limit: Annotated[FloatArray, "M"]
    slack: Annotated[FloatArray, "M"]
    multipliers: Annotated[FloatArray, "n + M"]
    rows: IntCell
    """Number of rows that belong to obstacles."""
    ending: IntCell
    violated: IntCell


@kernel
def move_within(
    p: MotionNumbers, robot: Report, scene: tuple[Kinematics, FloatArray, Obstacles], request: MotionRequest,
    rows: ConstraintRows, speeds: tuple[FloatArray, FloatArray], null_velocity: FloatArray, answer: MotionAnswer,
) -> None:  # fmt: skip
    """Write the joint velocities of eq. 2 within the joint limits and rows; update the motion in the null space.

    `scene` is the posture, the end-effector origin (3,) [m], and the obstacles. `speeds` are least and largest joint
    velocities (n,) [rad/s], or (0,) where only the joint limits count.
    """
    (kin, ee, near), (slowest, fastest), arm, qd = scene, speeds, p.arm, answer.command
    n, obstacles, count, z = len(qd), len(rows.which), len(rows.h), null_velocity[:0]
    slack, multipliers = np.empty(count), np.empty(n + count)
    if p.away.distance_m > 0.0:
        # only the first rows, those of obstacles, are n^T J
        null_velocity[:] = away(
            null_velocity, rows.G[:obstacles], rows.which, near, arm.moved_by, p.away, p.task.control_period_s
        )
        z = null_velocity[:n]
    J = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], ee, J)
    # the box starts from commanded positions and speeds, where it is exact; Jacobian and cost from measured ones
    lower, upper, stop = joint_box(robot.q_commanded, robot.qd_commanded, p.limits)
    # within what the acceleration allows: the box is never empty
    for i in range(len(slowest)):
        least, most = lower[i], upper[i]
        lower[i] = min(max(slowest[i], least), most)
        upper[i] = min(max(fastest[i], least), most)
    ending = SOLVED
    if request.hold[0] == 0:
        H, f = np.empty((n, n)), np.empty(n)
        _cost(p, J, robot.q, request, kin.rotation[arm.ee], z, H, f)
        minimum = Minimum(qd, slack, multipliers)
        problem = QuadraticProgram(H, f, lower, upper, rows.G, rows.h, rows.weight)
        if rows.weight == 0.0:  # hard rows have no price
            ending = minimise_within(problem, p.budget, minimum)
        else:
            ending = minimise(problem, p.budget, minimum)
    if request.hold[0] == 1 or ending != SOLVED:
        # only a minimum is sent to the arm; the violation of the rows by braking is reported too
        qd[:], multipliers[:] = stop, 0.0
        excesses(rows.G, rows.h, qd, slack)
    answer.rows[0], answer.ending[0], answer.violated[0] = obstacles, ending, 0
    answer.velocities[:] = 0.0
    for i in range(3):
        for j in range(n):
            answer.velocities[0, i] += J[i, j] * robot.qd[j]
            answer.velocities[1, i] += J[i, j] * qd[j]
    for k in range(count):
        if slack[k] > 0.0 and rows.weight > 0.0:
            answer.violated[0] = 1
    answer.which[:obstacles], answer.limit[:obstacles] = rows.which, rows.h[:obstacles]
    answer.slack[:obstacles], answer.multipliers[: n + obstacles] = slack[:obstacles], multipliers[: n + obstacles]


@inlined
def _cost(
    p: MotionNumbers, J: FloatArray, q: FloatArray, request: MotionRequest, rotation: FloatArray, z: FloatArray,
    H: FloatArray, f: FloatArray,
) -> None:  # fmt: skip
    """Write the cost of eq. 2, or that of the deviation from requested joint velocities."""
    if request.by_joints[0] == 1:
        # 1/2 |qd_r - qd|^2, a reaction in joint space: H = I is regular in any posture and needs no damping
        H[:], f[:] = np.eye(len(q)), -request.qd
    else:
        # 3 rows for the velocity alone: the rotation stays in the null space, and may drift
        m = 6 if p.holds_orientation else 3
        x_d = twist(request.velocity, rotation, request.goal, p.task.orientation_gain_1_s)
        cost_into(J[:m], x_d[:m], q, p.q_mid, p.task, z, H, f)
