"""Two published ways to keep clear of obstacles, through the same joint box and QP: for comparison only.

Flacco, Kroeger, De Luca, Khatib, "A depth space approach to human-robot collision avoidance", ICRA 2012: a repulsive
velocity moves the end-effector, and near other points of the body the joints that carry these towards an obstacle are
slowed. Ding and Thomas, "Collision avoidance with proximity servoing for redundant serial robot manipulators", ICRA
2020: limits on the approach of each closest point, and a weighted sum of the distances that must not fall. What of each
is reproduced, and what not, stands in docs/explanation/baselines.md.
"""

import numpy as np

from pretouch.control.joint_box import box_and_brake
from pretouch.control.qp import skipped, solve, task_cost
from pretouch.control.restriction import ApproachRows
from pretouch.control.setup import MotionRequest, MotionSetup
from pretouch.control.task import task
from pretouch.params import BaselineParams
from pretouch.robot.model import Kinematics
from pretouch.types import FloatArray, IntArray, Obstacles, QpSolution, RobotState

MODES = ("flacco", "ding")
_NEAREST_M = 0.01
"""Least distance that weighs an obstacle [m], so that 1/d stays finite in contact."""
_STILL = 1e-9
"""Part of a joint in a motion below which it has none [rad/m]."""


def repulsion(distance: FloatArray, v_max: float, alpha: float, rho: float) -> FloatArray:
    """V_max / (1 + exp(alpha (2 d / rho - 1))) [m/s] at distances (K,) [m] (Flacco et al. 2012)."""
    exponent = np.clip(alpha * (2.0 * distance / rho - 1.0), -500.0, 500.0)
    return np.asarray(v_max / (1.0 + np.exp(exponent)))


def repulsive_velocity(position: FloatArray, obstacles: Obstacles, params: BaselineParams) -> FloatArray:
    """Velocity (3,) [m/s] that moves the end-effector's origin, at `position` (3,) [m], away from what is near.

    The hybrid vector of Flacco et al. 2012: as long as the repulsion of the nearest point, in the direction of the sum
    of the repulsions of all.
    """
    p = params
    if len(obstacles.unit) == 0:
        return np.zeros(3)
    away = position - obstacles.point
    far = np.linalg.norm(away, axis=1)
    size = repulsion(np.maximum(obstacles.ee_distance - p.flacco_size_m, 0.0), p.flacco_v_max_m_s, p.flacco_alpha,
                     p.flacco_rho_m)  # fmt: skip
    total = (size / np.maximum(far, _STILL)) @ away
    length = float(np.linalg.norm(total))
    return np.asarray(total * (size.max() / length)) if length > _STILL else np.zeros(3)


def slowed_joints(
    motion: FloatArray, distance: FloatArray, qd_max: FloatArray, params: BaselineParams
) -> tuple[FloatArray, FloatArray]:
    """Joint velocity limits (n,) [rad/s] by the risk of each of K body points (Flacco et al. 2012).

    With the risk f = 1 / (1 + exp(alpha (2 d / rho - 1))), joints that take part in moving a point towards its obstacle
    may turn that way at (1 - f) of their speed. Of several points the strictest limit holds.

    Args:
        motion: (K, n) least joint velocities that move each point towards its obstacle, and nowhere else [rad/m].
        distance: (K,) of each point [m].
        qd_max: (n,) [rad/s].
        params: steepness and reach.
    """
    lower, upper = -qd_max, qd_max.copy()
    for s, risk in zip(motion, repulsion(distance, 1.0, params.flacco_alpha, params.flacco_rho_m), strict=True):
        upper = np.where(s > _STILL, np.minimum(upper, (1.0 - risk) * qd_max), upper)
        lower = np.where(s < -_STILL, np.maximum(lower, -(1.0 - risk) * qd_max), lower)
    return lower, upper


def ding_limit(distance: FloatArray, params: BaselineParams) -> FloatArray:
    """Largest approach (K,) [m/s] at body distances (K,) [m], infinite from `ding_notice_m` on; negative: a retreat.

    Piecewise linear (Ding and Thomas 2020): full retreat, none, neither, and the full approach at the outer end.
    """
    p = params
    places = [p.ding_repulse_m, p.ding_zero_low_m, p.ding_zero_high_m, p.ding_notice_m]
    limit = np.interp(distance, places, [-p.ding_retreat_m_s, 0.0, 0.0, p.ding_approach_m_s])
    return np.where(distance < p.ding_notice_m, limit, np.inf)


def ding_rows(rows: FloatArray, distance: FloatArray, params: BaselineParams) -> tuple[ApproachRows, IntArray]:
    """Rows G qd <= h of Ding and Thomas 2020, and which points (K',) all but the last belong to.

    With C = -rows, how each distance changes with the joints, and w = 1 / d, the last is -w^T C qd <= 0: the weighted
    sum of the distances must not fall. It is divided by the sum of w, so that its violation is a speed too.

    Args:
        rows: (K, n) speed of each of K points towards its obstacle per joint velocity [m].
        distance: (K,) of each point [m].
        params: distances and speeds.
    """
    limit = ding_limit(distance, params)
    which, seen = np.flatnonzero(np.isfinite(limit)), distance < params.ding_weighted_m
    weights = seen / np.maximum(distance, _NEAREST_M)
    weighted = weights @ rows / max(float(weights.sum()), _STILL)
    return ApproachRows(np.vstack([rows[which], weighted]), np.append(limit[which], 0.0), soft=True), which


def baseline_motion(
    setup: MotionSetup, kin: Kinematics, robot: RobotState, obstacles: Obstacles, request: MotionRequest
) -> tuple[QpSolution, IntArray, FloatArray, FloatArray, FloatArray]:
    """Answer of `joint_motion` in the modes flacco and ding, in the order of the fields of `Motion`.

    The rows of Ding and Thomas are soft: as hard ones, which they are in a box without acceleration limits, they ask
    an arm at rest for a retreat that no arm can have reached after one period.
    """
    model, limits, profile, velocity = setup.model, setup.limits, setup.profile, request.velocity
    p, t, distance = profile.baselines, profile.task, obstacles.body_distance
    moved = [model.jacobian(kin, int(k), at)[:3] for k, at in zip(obstacles.link, obstacles.body_point, strict=True)]
    lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, limits.table)
    rows, which = ApproachRows(np.zeros((0, model.n)), np.zeros(0), soft=True), np.zeros(0, np.int64)
    if profile.restriction.mode == "flacco":
        velocity = velocity + repulsive_velocity(kin.position[model.ee], obstacles, p)
        motion = [np.linalg.pinv(J_c) @ d for J_c, d in zip(moved, obstacles.direction, strict=True)]
        slow = slowed_joints(np.reshape(motion, (-1, model.n)), distance, limits.qd_max, p)
        # what the acceleration does not allow comes later: the box is never empty
        lower, upper = np.clip(slow[0], lower, upper), np.clip(slow[1], lower, upper)
    elif moved:
        approach = np.array([d @ J_c for J_c, d in zip(moved, obstacles.direction, strict=True)])
        rows, which = ding_rows(approach, distance, p)
    J = model.ee_jacobian(kin)
    goal = task(J, velocity, kin.rotation[model.ee], request.rotation_goal, t)
    cost = task_cost(*goal, robot.q, model.q_mid, t)
    weight, budget = profile.restriction.slack_weight, profile.failure.solver_iterations
    qp = skipped(stop, rows) if request.hold else solve(cost, lower, upper, rows, weight, stop, budget)
    found = len(which)
    of_points = QpSolution(qp.qd, qp.slack[:found], qp.multipliers[: model.n + found], qp.outcome, qp.status)
    return of_points, which, rows.h[:found], J[:3] @ robot.qd, J[:3] @ qp.qd
