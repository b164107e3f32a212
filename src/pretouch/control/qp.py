"""The quadratic program for joint velocities: task, joint box and rows of eq. 2. Never without an answer."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.control.active_set import minimise_within
from pretouch.control.penalty import Minimum, Problem, minimise
from pretouch.modes import INFEASIBLE, SOLVED, outcome_of
from pretouch.params import TaskParams
from pretouch.robot.vectors import rotation_error
from pretouch.types import FloatArray, IntArray, Number, QpSolution
from pretouch.values import value


def task(
    ee_jacobian: FloatArray,
    velocity: FloatArray,
    rotation: FloatArray,
    rotation_goal: FloatArray,
    params: TaskParams,
) -> tuple[FloatArray, FloatArray]:
    """Jacobian (m, n) and desired velocity (m,) of the task: m = 3, or 6 when the orientation is held.

    Args:
        ee_jacobian: (6, n) of the end-effector origin.
        velocity: (3,) desired velocity [m/s].
        rotation: (3, 3) R_O_ee now.
        rotation_goal: (3, 3) R_O_ee to hold.
        params: orientation and its gain.
    """
    if params.orientation == "free":
        return ee_jacobian[:3], velocity
    return ee_jacobian, twist(velocity, rotation, rotation_goal, params.orientation_gain_1_s)


@compiled
def twist(velocity: FloatArray, rotation: FloatArray, goal: FloatArray, gain: float) -> FloatArray:
    """Task velocity (6,) of `task` when the orientation is held [m/s, then rad/s]."""
    error, both = rotation_error(rotation, goal), np.empty(6)
    for i in range(3):
        both[i], both[3 + i] = velocity[i], gain * error[i]
    return both


@value
class ApproachRows:
    """K rows of the QP: G @ qd <= h, softly or not."""

    G: FloatArray
    """(K, n) approach velocity of the closest body point per joint velocity [m]."""
    h: FloatArray
    """(K,) largest approach velocity [m/s]; negative asks for a retreat."""
    soft: bool
    """Whether a row may be violated at a cost."""


class Rows(NamedTuple):
    """Room for rows of the QP, as many as there may be."""

    G: FloatArray
    """(R, n) as in `ApproachRows`."""
    h: FloatArray
    """(R,) likewise."""
    which: IntArray
    """(K,) the obstacle that each of the first belongs to."""


@value
class Cost:
    """Cost 1/2 qd^T H qd + f^T qd."""

    H: FloatArray
    """(n, n), positive definite."""
    f: FloatArray
    """(n,)."""


class CostParams(NamedTuple):
    """What eq. 2 takes of `TaskParams`."""

    damping_max: float
    manipulability_threshold: float
    mid_joint_gain: float
    mid_joint_time_s: float


def cost_params(params: TaskParams) -> CostParams:
    """Return what eq. 2 takes of the parameters."""
    p = params
    return CostParams(p.damping_max, p.manipulability_threshold, p.mid_joint_gain, p.mid_joint_time_s)


@compiled
def manipulability(jacobian: FloatArray) -> float:
    """Yoshikawa's measure w = sqrt(det(J J^T)) of a Jacobian (m, n)."""
    # the volume its rows span, row by row: of the determinant rounding would leave half the digits near a singularity
    m, n = jacobian.shape
    rows, volume = jacobian.copy(), 1.0
    for i in range(m):
        height = 0.0
        for j in range(n):
            height += rows[i, j] * rows[i, j]
        volume *= np.sqrt(height)
        for k in range(i + 1, m):
            along = 0.0
            for j in range(n):
                along += rows[k, j] * rows[i, j]
            for j in range(n):
                # a row of no height depends on those before it, and the volume is 0 already
                rows[k, j] -= along * rows[i, j] / height if height > 0 else 0.0
    return volume


@compiled
def damping(w: float, damping_max: float, threshold: float) -> float:
    """Factor mu of eq. 2 after Nakamura and Hanafusa (1986): lambda_0 (1 - w / w_0)^2 below w_0, else zero."""
    return damping_max * (1.0 - w / threshold) ** 2 if w < threshold else 0.0


@compiled
def mid_joint_velocity(q: Number, q_mid: Number, time: float) -> Number:
    """Joint velocities qd_mid (n,) [rad/s] of eq. 2 that would reach the middle of the joint ranges in `time` [s]."""
    return (q_mid - q) / time


def task_cost(jacobian: FloatArray, velocity: FloatArray, q: FloatArray, q_mid: FloatArray, params: TaskParams) -> Cost:
    """Cost g(qd) of eq. 2 of the paper, without its constant.

    1/2 |x_d - J qd|^2 + mu/2 |qd|^2 + k/2 |qd_mid - qd|^2, so H = J^T J + (mu + k) I, f = -J^T x_d - k qd_mid.

    Args:
        jacobian: (m, n) of the task.
        velocity: (m,) desired task velocity x_d [m/s, then rad/s].
        q: (n,) joint positions [rad].
        q_mid: (n,) middle of the joint ranges [rad].
        params: damping and mid-joint term.
    """
    n = len(q)
    H, f = np.empty((n, n)), np.empty(n)
    cost_into(jacobian, velocity, q, q_mid, cost_params(params), H, f)
    return Cost(H, f)


@compiled
def cost_into(
    J: FloatArray, x_d: FloatArray, q: FloatArray, q_mid: FloatArray, p: CostParams, H: FloatArray, f: FloatArray
) -> None:
    """Write H (n, n) and f (n,) of `task_cost`."""
    # J^T J has no more rank than the task has rows, and mu is 0 away from singularities: it is k that makes H regular
    mu, k = damping(manipulability(J), p.damping_max, p.manipulability_threshold), p.mid_joint_gain
    for i in range(len(q)):
        f[i] = -k * mid_joint_velocity(q[i], q_mid[i], p.mid_joint_time_s)
        for m in range(len(x_d)):
            f[i] -= J[m, i] * x_d[m]
        for j in range(i + 1):
            H[i, j] = mu + k if i == j else 0.0
            # with the orientation held, 1 rad/s of error weighs as much as 1 m/s
            for m in range(len(x_d)):
                H[i, j] += J[m, i] * J[m, j]
            H[j, i] = H[i, j]


def solve(
    cost: Cost,
    lower: FloatArray,
    upper: FloatArray,
    rows: ApproachRows,
    slack_weight: float,
    stop: FloatArray,
    budget: int = 500,
) -> QpSolution:
    """Minimise the cost over joint velocities within the box and the approach rows.

    A soft row may be violated by s at a cost of slack_weight / 2 s^2. Where hard rows contradict the box or each other,
    and where numbers are no usable problem, the answer is `stop`, and the outcome says so. The multipliers are then
    weights of what contradicts, so added up it reads 0 <= something negative; or 0.

    Args:
        cost: H (n, n), f (n,).
        lower: (n,) joint box [rad/s].
        upper: (n,) joint box [rad/s].
        rows: G (K, n), h (K,).
        slack_weight: weight of a squared violation.
        stop: (n,) braking command inside the box [rad/s].
        budget: iterations after which to brake. A limit in time would give another answer each time.
    """
    n, count, weight = len(lower), len(rows.h), slack_weight if rows.soft else 0.0
    x, slack, multipliers = answer = Minimum(np.empty(n), np.empty(count), np.empty(n + count))
    ending = _minimise(Problem(cost.H, cost.f, lower, upper, rows.G, rows.h, weight), budget, answer)
    if ending != SOLVED:
        weights = multipliers if ending == INFEASIBLE else np.zeros(n + count)
        return QpSolution(stop, np.maximum(rows.G @ stop - rows.h, 0.0), weights, *outcome_of(False, ending, False))
    violated = rows.soft and bool(slack.max(initial=0.0) > 0)
    return QpSolution(x, slack, multipliers, *outcome_of(False, ending, violated))


@compiled
def _minimise(problem: Problem, budget: int, answer: Minimum) -> int:
    # hard rows have no price
    return minimise_within(problem, budget, answer) if problem.weight == 0.0 else minimise(problem, budget, answer)
