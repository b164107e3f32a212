"""The force at the end-effector that explains joint torques best."""

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import compiled
from pretouch.types import FloatArray


def force_map(jacobian: FloatArray) -> FloatArray:
    """Map (3, n) from joint torques [Nm] to the force at the end-effector that explains them best [N].

    Damped least squares: the first three rows of (J J^T + d^2 I)^-1 J of the Jacobian (6, n). A force so found does
    work on the arm's end in the direction in which the torques do work on the joints, wherever the contact is.
    """
    W = np.empty((3, jacobian.shape[1]))
    force_map_into(jacobian, W)
    return W


_DAMPING = 0.02
"""Damping d: below it a direction is singular, and the force in it is taken to be smaller than it may be."""


@compiled
def force_map_into(J: FloatArray, W: FloatArray) -> None:
    """Write what `force_map` returns, of the Jacobian (6, n)."""
    A, L, unit, y, x = np.empty((6, 6)), np.zeros((6, 6)), np.zeros(6), np.empty(6), np.empty(6)
    for i in range(6):
        for k in range(i + 1):
            # J J^T + d^2 I, of which `factor` reads the lower triangle only
            A[i, k] = _DAMPING**2 if i == k else 0.0
            for j in range(J.shape[1]):
                A[i, k] += J[i, j] * J[k, j]
    factor(A, L)
    for i in range(3):
        # x = A^-1 e_i, a row of A^-1 too, for A is symmetric
        unit[i] = 1.0
        forward(L, unit, y)
        backward(L, y, x)
        unit[i] = 0.0
        for j in range(J.shape[1]):
            W[i, j] = 0.0
            for k in range(6):
                W[i, j] += x[k] * J[k, j]
