"""The force that the sequential test can find: how well an arm's free motion is known, said in newtons.

A force f at the end-effector adds J^T f to the mean z of a window, and so f^T G f with G = J S^-1 J^T to z^T S^-1 z.
Solved for the likelihood ratio of an alarm, this gives the force: of all its directions the one in which the torques
tell least of it. Evidence by something near, by a touch or by other windows comes on top.
"""

import math

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import compiled
from pretouch.contact.window_scatter import LENGTHS, FreeMeans, covariance_of_mean, spread_out
from pretouch.types import FloatArray

HELD_S = 0.1
"""For how long the force is there [s]."""
_SURE = 1.645
"""Deviations of the noise above what would do in half of all cases: so that it does in 95 % of them."""
_LENGTHS = np.array(LENGTHS)


@compiled
def detectable_force(J: FloatArray, period: float, free: FreeMeans, needed: float, gain: float, tails: float) -> float:
    """Return the force at the end-effector that the test finds in 95 of 100 cases if it is held for `HELD_S` [N].

    Args:
        J: (6, n) Jacobian of the end-effector.
        period: of control [s].
        free: the windows' means in free motion; the longest window within `HELD_S` counts.
        needed: ln of the likelihood ratio of one hypothesis in one window that is an alarm.
        gain: g, how much larger a contact's spread is than that of free motion.
        tails: degrees of freedom of the Student distribution.

    Returns:
        Infinite where no force is found.
    """
    k, n = 0, J.shape[1]
    while k + 1 < len(_LENGTHS) and _LENGTHS[k + 1] * period <= HELD_S:
        k += 1
    S, L, A = np.empty((n, n)), np.zeros((n, n)), np.empty((3, n))
    # a mean over less time has more noise, and one over more is not whole while the force lasts
    covariance_of_mean(free, k, S)
    if not factor(S, L):
        return np.inf
    if len(free.scatter):
        spread_out(free.scatter[k], L, np.empty((n, n)))
    for a in range(3):
        forward(L, J[a, ::-1].copy(), A[a])  # the last joint first
    least, squares = _least_eigenvalue(A @ A.T), _squares(needed, n, gain, tails)
    return (math.sqrt(squares) + _SURE) / math.sqrt(least) if least > 0.0 else np.inf


@compiled
def _squares(needed: float, n: int, gain: float, tails: float) -> float:
    """Return the f^T G f from which on the mean's likelihood ratio passes exp(`needed`).

    With c = g / (1 + g), z^T S^-1 z = T + n of which the force explains T + 3, the ratio of `log_ratio` has the root
    E = exp(2 (needed + 3/2 ln(1 + g)) / (nu + n)) = (nu + n + T) / (nu + n - 3 c + (1 - c) T), which is linear in T.
    """
    E, c = math.exp(2.0 * (needed + 1.5 * math.log1p(gain)) / (tails + n)), gain / (1.0 + gain)
    # with few degrees of freedom no residual is so large that it could not be an outlier
    slope = 1.0 - E * (1.0 - c)
    return max(0.0, (E * (tails + n - 3.0 * c) - tails - n) / slope) if slope > 0.0 else np.inf


@compiled
def _least_eigenvalue(G: FloatArray) -> float:
    """Return the least eigenvalue of a symmetric matrix (3, 3), in closed form."""
    mean = (G[0, 0] + G[1, 1] + G[2, 2]) / 3.0
    a, b, c, d, e, f = G[0, 0] - mean, G[1, 1] - mean, G[2, 2] - mean, G[0, 1], G[0, 2], G[1, 2]
    size = math.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    if size == 0.0:
        return mean
    # of G less its mean, over `size`, half the determinant is the cosine of three times the angle of each root
    half = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / size**3
    return mean + 2.0 * size * math.cos((math.acos(max(-1.0, min(half, 1.0))) + 2.0 * math.pi) / 3.0)
