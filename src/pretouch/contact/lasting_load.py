"""A load that stays: something gripped or put down, told from a contact by what it can and cannot be.

While the arm stands and nothing is near, a torque that does not change and that a weight at the end-effector explains
is learnt as free motion. A person who is caught is none of that: near, or not constant, or not straight down.
"""

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import compiled
from pretouch.types import FloatArray

MOST_KG = 3.0
"""Largest load: a Panda's payload [kg]."""
_LEAST_KG = -0.2
"""A load that seems to be less than nothing by more than this is a force from below [kg]."""
_FAR_M = 0.15
"""How far its centre may be from the end-effector's axis [m]."""
_UNKNOWN_NM = 0.3
"""What the mean of a joint's torque may be off where the arm came to stand, by friction [Nm]."""
_CHANGE_NM = 0.6
"""How much a constant torque may change while the arm creeps, by friction [Nm]."""
_DEVIATIONS = 4.0
"""How many deviations a constant torque may seem to change, and what is not a load may be."""
_GRAVITY = 9.81


@compiled
def still_constant(mean: FloatArray, held: FloatArray, S: FloatArray, samples: int) -> bool:
    """Whether the mean torque (n,) of so many samples, of spread S (n, n) each, is what it was."""
    for j in range(len(mean)):
        allowed = _DEVIATIONS**2 * (2.0 * S[j, j] / samples + (_CHANGE_NM / _DEVIATIONS) ** 2)
        if (mean[j] - held[j]) ** 2 > allowed:
            return False
    return True


@compiled
def is_load(
    residual: FloatArray, learnt: FloatArray, unit: FloatArray, J: FloatArray, S: FloatArray, samples: int
) -> bool:
    """Whether a weight at the end-effector, or one less, explains a lasting residual.

    Args:
        residual: (n,) mean of the torques that free motion does not explain [Nm].
        learnt: (n,) what the load known so far makes [Nm].
        unit: (n,) torques of 1 kg at the end-effector [Nm].
        J: (6, n) Jacobian there.
        S: (n, n) spread of a sample [Nm^2].
        samples: how many the mean is of.
    """
    n = len(residual)
    C, L, y, a = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty((3, n))
    G, K, b, u, f = np.zeros((3, 3)), np.zeros((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for i in range(n):
        for j in range(n):
            C[i, j] = S[i, j] / samples
        C[i, i] += _UNKNOWN_NM**2
    if not factor(C, L):
        return False
    forward(L, unit, a[0])
    for k in range(2):  # what its centre off the axis adds: moments about the horizontal axes
        forward(L, J[3 + k] * _GRAVITY, a[1 + k])
    for i in range(3):
        for k in range(3):
            for j in range(n):
                G[i, k] += a[i, j] * a[k, j]
        G[i, i] += 1.0 / (MOST_KG if i == 0 else MOST_KG * _FAR_M) ** 2
    if not factor(G, K):
        return False
    total, kg = 0.0, np.empty(2)
    for k in range(2):  # the change, then all of the load
        square = forward(L, residual if k == 0 else residual + learnt, y)
        for i in range(3):
            b[i] = 0.0
            for j in range(n):
                b[i] += a[i, j] * y[j]
        explained = forward(K, b, u)
        backward(K, u, f)
        kg[k] = f[0]
        if k == 0:
            total = square - explained
            if abs(f[1]) + abs(f[2]) > 2.0 * _FAR_M * max(abs(f[0]), 0.1):
                return False
    return bool(total < n + _DEVIATIONS * np.sqrt(2.0 * n) and abs(kg[0]) < MOST_KG and _LEAST_KG < kg[1] < MOST_KG)
