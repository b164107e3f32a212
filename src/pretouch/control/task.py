"""The task: the cost of eq. 2, and the joint motion in the null space of the task."""

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import compiled, kernel
from pretouch.params import NullSpaceMotion, TaskParams
from pretouch.robot.kinematics import rotation_error
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles

_DAMPING = 1e-6
"""Added to J J^T, so that the projector is defined at singularities too [m^2]."""


@kernel
def twist(velocity: FloatArray, rotation: FloatArray, goal: FloatArray, gain: float) -> FloatArray:
    """Return the task velocity (6,) [m/s, then rad/s] that holds the orientation R_O_ee (3, 3) with a gain [1/s]."""
    error, both = rotation_error(rotation, goal), np.empty(6)
    for i in range(3):
        both[i], both[3 + i] = velocity[i], gain * error[i]
    return both


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


@kernel
def damping(w: float, damping_max: float, threshold: float) -> float:
    """Factor mu of eq. 2 after Nakamura and Hanafusa (1986): lambda_0 (1 - w / w_0)^2 below w_0, else zero."""
    return damping_max * (1.0 - w / threshold) ** 2 if w < threshold else 0.0


@kernel
def cost_into(
    J: FloatArray, x_d: FloatArray, q: FloatArray, q_mid: FloatArray, p: TaskParams, z: FloatArray,
    H: FloatArray, f: FloatArray,
) -> None:  # fmt: skip
    """Write H (n, n) and f (n,) of the cost g(qd) of eq. 2 of the paper, without its constant.

    1/2 |x_d - J qd|^2 + mu/2 |qd|^2 + k/2 |qd_mid - qd|^2, so H = J^T J + (mu + k) I, f = -J^T x_d - k qd_mid, with the
    Jacobian (m, n) of the task, its velocity x_d (m,) [m/s, then rad/s], joint positions (n,) [rad], and the joint
    velocities qd_mid = (q_mid - q) / t (n,) [rad/s] that would reach the middle of the joint ranges in the time t.

    With a motion z (n,) [rad/s] for the null space of the task, k/2 |N (z - qd)|^2 is added, N the projector onto it.
    With `mid_joint_projected` qd_mid is part of z, in place of a term of its own. The paper's eq. 2 has z (0,).
    """
    n, projected, k = len(q), p.mid_joint_projected, p.mid_joint_gain
    mu, alone = damping(manipulability(J), p.damping_max, p.manipulability_threshold), 0.0 if projected else k
    for i in range(n):
        f[i] = -alone * (q_mid[i] - q[i]) / p.mid_joint_time_s
        for m in range(len(x_d)):
            f[i] -= J[m, i] * x_d[m]
        for j in range(i + 1):
            # J^T J has no more rank than the task has rows, and mu is 0 away from singularities: k makes H regular
            H[i, j] = mu + alone if i == j else 0.0
            # with the orientation held, 1 rad/s of error weighs as much as 1 m/s
            for m in range(len(x_d)):
                H[i, j] += J[m, i] * J[m, j]
            H[j, i] = H[i, j]
    if not projected and len(z) == 0:
        return
    N = projector(J)
    for j in range(n):
        motion = z[j] if len(z) > 0 else 0.0
        if projected:
            motion += (q_mid[j] - q[j]) / p.mid_joint_time_s
        for i in range(n):
            # |N v|^2 = v^T N v, for N is a projector (but for its damping). It keeps the directions that J loses, so H
            # is positive definite without mu too.
            f[i] -= k * N[i, j] * motion
            H[i, j] += k * N[i, j]


@kernel
def projector(J: FloatArray) -> FloatArray:
    """Return N = I - J^T (J J^T + c I)^-1 J (n, n), symmetric: the projector onto the null space of J (m, n).

    The damping c makes it defined everywhere: J N v is c (J J^T + c I)^-1 J v, zero away from singularities.
    """
    m, n = J.shape
    S, L, X, N = _DAMPING * np.eye(m), np.empty((m, m)), np.empty((n, m)), np.eye(n)
    for i in range(m):
        for j in range(m):
            for c in range(n):
                S[i, j] += J[i, c] * J[j, c]
    factor(S, L)
    # with L the Cholesky factor, N = I - X X^T for X^T = L^-1 J
    for i in range(n):
        for c in range(m):
            X[i, c] = J[c, i]
        forward(L, X[i], X[i])
    for i in range(n):
        for j in range(n):
            for c in range(m):
                N[i, j] -= X[i, c] * X[j, c]
    return N


@kernel
def away(
    last: FloatArray, G: FloatArray, which: IntArray, obstacles: Obstacles, moved_by: BoolArray, p: NullSpaceMotion,
    period: float,
) -> FloatArray:  # fmt: skip
    """Return joint velocities (n,) [rad/s] that move body points before the hand away from obstacles.

    Each row g = n^T J of G (R, n), that of obstacle `which` (R,), adds -g v / |g|^2 with v = v_0 (1 - d / d_0)^2: alone
    it would move its point away at v. The sum, and its change from `last` (n,) in a period, are bounded.
    """
    n, within = G.shape[1], p.distance_m
    link, distance = obstacles.link, obstacles.body_distance
    z = np.zeros(n)
    for r in range(len(which)):
        m = which[r]
        if distance[m] >= within or sum(moved_by[link[m]]) == n:
            continue  # far, or on the hand, whose motion is the task's
        size2 = 0.0
        for j in range(n):
            size2 += G[r, j] * G[r, j]
        speed = p.speed_m_s * (1.0 - max(0.0, distance[m]) / within) ** 2
        # -g v / |g|^2 is the shortest z with g z = -v; a sum over several rows fulfils none of them exactly;
        # a point that hardly moves counts as one 0.1 m off an axis
        for j in range(n):
            z[j] -= G[r, j] * speed / max(size2, 0.01)
    _shorten(z, p.joint_rad_s)
    # An obstacle that appears or vanishes changes z by a step: the arm follows at a bounded rate.
    step = z - last
    _shorten(step, p.rate_rad_s2 * period)
    return last + step


@kernel
def _shorten(v: FloatArray, length: float) -> None:
    size = np.sqrt(sum(v * v))
    if size > length:
        v *= length / size
