"""The quadratic program for joint velocities: eq. 2 within joint box and approach rows. Never without an answer."""

from dataclasses import dataclass

import daqp
import numpy as np

from pretouch.control.restriction import ApproachRows
from pretouch.params import TaskParams
from pretouch.types import FloatArray, QpOutcome, QpSolution

_SOFT = 8
_NO_BOUND = -1e30
_OPTIMAL, _SOFT_OPTIMAL, _INFEASIBLE = 1, 2, -1
_EXIT = {
    _OPTIMAL: "solved",
    _SOFT_OPTIMAL: "solved, an approach row is violated",
    _INFEASIBLE: "the approach rows cannot be met within the acceleration limits",
    -2: "the solver cycled",
    -3: "the problem is unbounded",
    -4: "the iteration limit was reached",
    -5: "the Hessian is not convex",
    -6: "the problem is overdetermined at the start",
}


@dataclass(frozen=True, slots=True)
class Cost:
    """Cost 1/2 qd^T H qd + f^T qd."""

    H: FloatArray
    """(n, n), positive definite."""
    f: FloatArray
    """(n,)."""


def manipulability(jacobian: FloatArray) -> float:
    """Yoshikawa's measure w = sqrt(det(J J^T)) of a Jacobian (m, n)."""
    return float(np.sqrt(max(0.0, float(np.linalg.det(jacobian @ jacobian.T)))))


def damping(w: float, damping_max: float, threshold: float) -> float:
    """Factor mu of eq. 2 after Nakamura and Hanafusa (1986): lambda_0 (1 - w / w_0)^2 below w_0, else zero."""
    return damping_max * (1.0 - w / threshold) ** 2 if w < threshold else 0.0


def mid_joint_velocity(q: FloatArray, q_mid: FloatArray, time: float) -> FloatArray:
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
    mu = damping(manipulability(jacobian), params.damping_max, params.manipulability_threshold)
    k = params.mid_joint_gain
    H = jacobian.T @ jacobian + (mu + k) * np.eye(len(q))
    f = -jacobian.T @ velocity - k * mid_joint_velocity(q, q_mid, params.mid_joint_time_s)
    return Cost(H, f)


def solve(
    cost: Cost,
    lower: FloatArray,
    upper: FloatArray,
    rows: ApproachRows,
    slack_weight: float,
    stop: FloatArray,
) -> QpSolution:
    """Minimise the cost over joint velocities within the box and the approach rows.

    A soft row may be violated by s at a cost of slack_weight / 2 s^2. Where hard rows contradict the box, and where
    the solver gives no usable answer, the answer is `stop`, and the outcome says so.

    Args:
        cost: H (n, n), f (n,).
        lower: (n,) joint box [rad/s].
        upper: (n,) joint box [rad/s].
        rows: G (K, n), h (K,).
        slack_weight: weight of a squared violation.
        stop: (n,) braking command inside the box [rad/s].
    """
    n, count = len(lower), len(rows.h)
    if not all(np.isfinite(a).all() for a in (cost.H, cost.f, lower, upper, rows.G, rows.h)):
        # the solver would answer NaN with success, or drop a row in silence
        return _braking(stop, rows, QpOutcome.FAILED, "the problem holds numbers that are not finite")
    model = daqp.Model()
    sense = np.zeros(n + count, dtype=np.int32)
    sense[n:] = _SOFT if rows.soft else 0
    upper_bounds = np.concatenate([upper, rows.h])
    lower_bounds = np.concatenate([lower, np.full(count, _NO_BOUND)])
    flag, _ = model.setup(cost.H, cost.f, rows.G, upper_bounds, lower_bounds, sense)
    if flag > 0:
        model.settings = {"primal_tol": 1e-9}
        if rows.soft:
            reciprocal = np.full(n + count, 1.0 / slack_weight)
            model.soft_weights(reciprocal, reciprocal)
        x, _, flag, info = model.solve()
    if flag not in (_OPTIMAL, _SOFT_OPTIMAL) or not np.isfinite(x).all():
        outcome = QpOutcome.INFEASIBLE if flag == _INFEASIBLE else QpOutcome.FAILED
        return _braking(stop, rows, outcome, _EXIT.get(flag, f"the solver failed with exit code {flag}"))
    # the box holds to the solver's tolerance only; the clip makes it exact
    x = np.clip(x, lower, upper)
    return QpSolution(x, np.maximum(rows.G @ x - rows.h, 0.0), info["lam"], QpOutcome.SOLVED, _EXIT[flag])


def skipped(stop: FloatArray, rows: ApproachRows) -> QpSolution:
    """Return the braking command (n,) [rad/s] where no problem is posed: the arm holds."""
    return _braking(stop, rows, QpOutcome.SKIPPED, "not posed: the arm holds")


def _braking(stop: FloatArray, rows: ApproachRows, outcome: QpOutcome, status: str) -> QpSolution:
    slack = np.maximum(rows.G @ stop - rows.h, 0.0)
    return QpSolution(stop, slack, np.zeros(len(stop) + len(rows.h)), outcome, status)
