"""Constant bounds on torques and force, as the vendor's examples set them."""

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import compiled
from pretouch.params import DetectionParams
from pretouch.types import FloatArray


def bounds_of(p: DetectionParams, n: int) -> FloatArray:
    """Bounds (n,) on the joints' torques [Nm]: of the given ones those at the same place between base and hand."""
    given = np.array(p.joint_torques_nm)
    return given[np.rint(np.linspace(0, len(given) - 1, n)).astype(np.int64)]


def share_of_bounds(tau_ext: FloatArray, force: FloatArray | None, p: DetectionParams) -> float:
    """Largest torque (n,) [Nm] or norm of the force (3,) [N] as a part of its bound: a contact from 1 on."""
    share = float(np.max(np.abs(tau_ext) / bounds_of(p, len(tau_ext))))
    return share if force is None else max(share, float(np.sqrt(force @ force)) / p.force_n)


@compiled
def share_of_band(force: FloatArray, parts: FloatArray) -> float:
    """Largest |x - mu| of a force (3,) as a part of its band, by the parts (6, 3) of `Thresholds`."""
    largest = 0.0
    for i in range(3):
        off = force[i] - parts[2, i]
        band = parts[0, i] - parts[2, i] if off > 0.0 else parts[1, i] - parts[2, i]
        largest = max(largest, off / band)
    return largest


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
            A[i, k] = _DAMPING**2 if i == k else 0.0
            for j in range(J.shape[1]):
                A[i, k] += J[i, j] * J[k, j]
    factor(A, L)
    for i in range(3):
        unit[i] = 1.0
        forward(L, unit, y)
        backward(L, y, x)
        unit[i] = 0.0
        for j in range(J.shape[1]):
            W[i, j] = 0.0
            for k in range(6):
                W[i, j] += x[k] * J[k, j]
