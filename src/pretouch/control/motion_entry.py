"""What the compiled entry of each restriction ends with: the joint limits, and eq. 2 within the rows it wrote.

The same as `box_and_brake`, `task`, `task_cost` and `solve` one after the other, and made of the same functions: as
calls from Python they would cost more time than what they do.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry, inlined
from pretouch.control.active_set import minimise_within
from pretouch.control.joint_box import box_and_brake
from pretouch.control.null_space import NullSpaceLimits, away, cost_with_null_space
from pretouch.control.penalty import SOLVED, Minimum, Problem, excesses, minimise
from pretouch.control.qp import CostParams, Rows, cost_into, twist
from pretouch.groups import Arm, JointArrays, Kinematics, NearArrays
from pretouch.robot.kinematics import jacobian_into
from pretouch.types import FloatArray, IntArray

Ended = tuple[int, int, bool]
"""How many rows are of obstacles, how the solver ended, and whether a soft row is violated."""


class MotionNumbers(NamedTuple):
    """What compiled code takes of limits and parameters."""

    cost: CostParams
    orientation_gain_1_s: float
    holds_orientation: bool
    """Whether the end-effector keeps its orientation."""
    budget: int
    """Factorisations after which to give up."""
    limits: FloatArray
    """`JointLimits.table`."""
    q_mid: FloatArray
    """(n,) middle of the joint ranges [rad]."""
    projected: bool
    """Whether the mid-joint term is in the null space of the task."""
    away: NullSpaceLimits
    """How links before the hand move away in it; within no distance: they do not."""


class Fixed(NamedTuple):
    """What does not change from step to step."""

    arm: Arm
    numbers: MotionNumbers


class Asked(NamedTuple):
    """What compiled code takes of a `MotionRequest`."""

    velocity: FloatArray
    rotation_goal: FloatArray
    hold: bool
    joints: FloatArray
    """(n,) joint velocities asked for [rad/s], or none."""


class Answer(NamedTuple):
    """Room for the answer."""

    qd: FloatArray
    """(n,) joint velocities [rad/s]."""
    slack: FloatArray
    """(R,) violation of each row [m/s]."""
    multipliers: FloatArray
    """(n + R,) of box and rows."""
    velocities: FloatArray
    """(2, 3) of the end-effector origin, measured and answered [m/s]."""


class Step(NamedTuple):
    """What comes new with each step, and room for its answer."""

    robot: JointArrays
    near: NearArrays
    asked: Asked
    null_velocity: FloatArray
    """(n,) joint velocity asked for in the null space, which is remembered [rad/s]. Written to."""
    answer: Answer
    kin: Kinematics


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
    by_product: bool
    """Whether the end-effector's velocities are the product of matrix and vector, which has another last digit."""


class Given(NamedTuple):
    """What is given beside rows."""

    weight: float
    slowest: FloatArray
    fastest: FloatArray
    by_product: bool


@entry
def given_motion(step: Step, rows: Rows, fixed: Fixed, p: Given) -> Ended:
    """Write the answer within rows that are given."""
    allowed = Allowed(rows.G, rows.h, rows.which, p.weight, p.slowest, p.fastest, p.by_product)
    return motion_within(step, allowed, fixed)


@inlined
def motion_within(step: Step, allowed: Allowed, fixed: Fixed) -> Ended:
    """Write the answer, and change what is remembered."""
    robot, asked, null_velocity, answer, kin = step.robot, step.asked, step.null_velocity, step.answer, step.kin
    arm, p, near = fixed.arm, fixed.numbers, step.near
    n, seen, found = len(robot.q), len(allowed.which), len(allowed.h)
    G, h, which, slack, qd = allowed.G, allowed.h, allowed.which, answer.slack[:found], answer.qd
    # of the rows only the first, those of obstacles, are n^T J of something to move away from
    if p.away.distance_m > 0.0:
        null_velocity[:] = away(null_velocity, G[:seen], which, near, arm.moved_by, p.away)
    J = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J)
    # the box starts from commanded positions and speeds, where it is exact; Jacobian and cost from measured ones
    lower, upper, stop = _box(robot, allowed, p)
    ending = SOLVED
    if not asked.hold:
        H, f = np.empty((n, n)), np.empty(n)
        _pose(J, robot.q, asked, kin.rotation[arm.ee], null_velocity, p, H, f)
        problem = Problem(H, f, lower, upper, G, h, allowed.weight)
        minimum = Minimum(qd, slack, answer.multipliers[: n + found])
        if allowed.weight == 0.0:  # hard rows have no price
            ending = minimise_within(problem, p.budget, minimum)
        else:
            ending = minimise(problem, p.budget, minimum)
    if asked.hold or ending != SOLVED:
        # no answer is sent but one that is a minimum; by how much braking violates the rows is reported all the same
        qd[:], answer.multipliers[:] = stop, 0.0
        excesses(G, h, qd, slack)
    by_product = allowed.by_product or p.projected or p.away.distance_m > 0.0
    _hand_velocities(J, robot.qd, qd, by_product, answer.velocities)
    violated = False
    for k in range(found):
        violated = violated or (slack[k] > 0.0 and allowed.weight > 0.0)
    return seen, ending, violated


@inlined
def _box(robot: JointArrays, allowed: Allowed, p: MotionNumbers) -> tuple[FloatArray, FloatArray, FloatArray]:
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
    J: FloatArray, q: FloatArray, asked: Asked, rotation: FloatArray, null_velocity: FloatArray, p: MotionNumbers,
    H: FloatArray, f: FloatArray,
) -> None:  # fmt: skip
    """Write the cost of eq. 2, or of how far the joint velocities are from those asked for."""
    if len(asked.joints) > 0:
        # 1/2 |qd_asked - qd|^2, a reaction in joint space: H = I is regular in any posture and needs no damping
        H[:], f[:] = np.eye(len(q)), -asked.joints
        return
    m = 6 if p.holds_orientation else 3
    # 3 rows for the velocity alone: the rotation stays in the null space, and may drift
    x_d = twist(asked.velocity, rotation, asked.rotation_goal, p.orientation_gain_1_s)
    # eq. 2 as the paper has it needs no projector
    if p.projected or p.away.distance_m > 0.0:
        H[:], f[:] = cost_with_null_space(J[:m], x_d[:m], q, p.q_mid, p.cost, p.projected, null_velocity)
    else:
        cost_into(J[:m], x_d[:m], q, p.q_mid, p.cost, H, f)


@compiled
def _hand_velocities(
    J: FloatArray, measured: FloatArray, answered: FloatArray, by_product: bool, velocities: FloatArray
) -> None:
    """Write the end-effector's velocities (2, 3) [m/s], those measured and those answered."""
    if by_product:
        # what was published of such profiles has the last digit of this product, which is not that of the sum below
        velocities[0], velocities[1] = J[:3] @ measured, J[:3] @ answered
        return
    for i in range(3):
        velocities[0, i], velocities[1, i] = 0.0, 0.0
        for j in range(len(measured)):
            velocities[0, i] += J[i, j] * measured[j]
            velocities[1, i] += J[i, j] * answered[j]
