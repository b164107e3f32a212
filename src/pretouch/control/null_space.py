"""What the arm does with the joint motion that leaves its task as it is."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.control.qp import CostParams, damping, manipulability, mid_joint_velocity
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles

_DAMPING = 1e-6
"""Added to J J^T, so that the projector is defined at singularities too [m^2]."""


@kernel
def projector(J: FloatArray) -> FloatArray:
    """N = I - J^T (J J^T + c I)^-1 J (n, n), symmetric: onto joint velocities that leave the task of J (m, n) alone.

    Damped by c, so that it is defined everywhere: J N v is c (J J^T + c I)^-1 J v, nothing away from singularities.
    """
    m, n = J.shape
    A, X = np.empty((m, m)), J.copy()
    # Cholesky factor A of J J^T + c I, without that matrix
    for i in range(m):
        for j in range(i + 1):
            total = _DAMPING if i == j else 0.0
            for c in range(n):
                total += J[i, c] * J[j, c]
            for c in range(j):
                total -= A[i, c] * A[j, c]
            A[i, j] = np.sqrt(total) if i == j else total / A[j, j]
    # with A the Cholesky factor, N = I - X^T X for X = A^-1 J
    for i in range(m):
        for c in range(n):
            for j in range(i):
                X[i, c] -= A[i, j] * X[j, c]
            X[i, c] /= A[i, i]
    N = np.eye(n)
    for i in range(n):
        for j in range(n):
            for c in range(m):
                N[i, j] -= X[c, i] * X[c, j]
    return N


@kernel
def cost_with_null_space(
    J: FloatArray, x_d: FloatArray, q: FloatArray, q_mid: FloatArray, p: CostParams, projected: bool,
    null_velocity: FloatArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """H (n, n) and f (n,) of eq. 2 with its mid-joint term, and a motion asked for, in the task's null space.

    1/2 |x_d - J qd|^2 + mu/2 |qd|^2 + k/2 |N (z - qd)|^2, z the motion (n,) [rad/s] asked for. With `projected` the
    velocity to the middle of the joints is part of z, without it it stays a term of its own, k/2 |qd_mid - qd|^2.
    """
    n, N, k = len(q), projector(J), p.mid_joint_gain
    mu = damping(manipulability(J), p.damping_max, p.manipulability_threshold)
    H, f, z = np.empty((n, n)), np.empty(n), null_velocity.copy()
    for i in range(n):
        middle = mid_joint_velocity(q[i], q_mid[i], p.mid_joint_time_s)
        # a term of its own has the weight k in all directions; within z it is seen through N only
        f[i] = 0.0 if projected else -k * middle
        z[i] += middle if projected else 0.0
    for i in range(n):
        for m in range(len(x_d)):
            f[i] -= J[m, i] * x_d[m]
        for j in range(n):
            # |N v|^2 = v^T N v, for N is a projector (but for its damping). It keeps the directions that J loses, so H
            # is positive definite without mu too.
            f[i] -= k * N[i, j] * z[j]
            H[i, j] = k * N[i, j]
            if i == j:
                H[i, j] += mu if projected else mu + k
            for m in range(len(x_d)):
                H[i, j] += J[m, i] * J[m, j]
    return H, f


class NullSpaceLimits(NamedTuple):
    """How links before the hand move away."""

    distance_m: float
    """Body distance below which they do [m]."""
    speed_m_s: float
    """Speed of the closest point at no distance [m/s]."""
    joint_rad_s: float
    """Largest length of the joint velocity [rad/s]."""
    change_rad_s: float
    """Largest length of its change in a period [rad/s]."""


@compiled
def away(
    last: FloatArray, G: FloatArray, which: IntArray, obstacles: Obstacles, moved_by: BoolArray,
    limits: NullSpaceLimits,
) -> FloatArray:  # fmt: skip
    """Joint velocities (n,) [rad/s] that take body points before the hand away from what is near.

    Each row g = n^T J of G (R, n), that of obstacle `which` (R,), adds -g v / |g|^2 with v = v_0 (1 - d / d_0)^2: alone
    it would move its point away at v. Sum and change from `last` (n,) are no longer than `limits` allow.
    """
    n, within = G.shape[1], limits.distance_m
    link, distance = obstacles.link, obstacles.body_distance
    z = np.zeros(n)
    for r in range(len(which)):
        m = which[r]
        if distance[m] >= within or sum(moved_by[link[m]]) == n:
            continue  # far, or of the hand, whose place is the task's
        size2 = 0.0
        for j in range(n):
            size2 += G[r, j] * G[r, j]
        wanted = limits.speed_m_s * (1.0 - max(0.0, distance[m]) / within) ** 2
        # -g v / |g|^2 is the shortest z with g z = -v; the sum over several rows meets none of them exactly
        # a point that hardly moves asks for no more than one 0.1 m off an axis
        for j in range(n):
            z[j] -= G[r, j] * wanted / max(size2, 0.01)
    _shorten(z, limits.joint_rad_s)
    # An obstacle that appears, or goes, changes z by a step: the arm follows at a bounded rate.
    step = z - last
    _shorten(step, limits.change_rad_s)
    return last + step


@kernel
def _shorten(v: FloatArray, length: float) -> None:
    size = np.sqrt(sum(v * v))
    if size > length:
        v *= length / size
