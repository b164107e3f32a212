"""How links move in one state of the joints: the usual recursion from the base outwards, compiled."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.types import FloatArray


@compiled
def chain_motion(
    anchor: FloatArray, axis: FloatArray, qd: FloatArray, qdd: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Motion, base frame, of what moves with the first 0, 1, ... n joints: (n + 1, 3) each.

    Angular velocity [rad/s], angular acceleration [rad/s^2], acceleration of a point [m/s^2], and that point [m]. The
    first two arguments are those of `Kinematics`; joint velocities [rad/s] and accelerations [rad/s^2] are (n,).
    """
    n = len(qd)
    w, alpha, a, point = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros((n + 1, 3))
    for j in range(n):
        a[j + 1] = a[j] + lever_acceleration(w[j], alpha[j], anchor[j] - point[j])
        point[j + 1] = anchor[j]
        turn = axis[j] * qd[j]
        alpha[j + 1] = alpha[j] + cross(w[j], turn) + axis[j] * qdd[j]
        w[j + 1] = w[j] + turn
    return w, alpha, a, point


@compiled
def lever_acceleration(w: FloatArray, alpha: FloatArray, r: FloatArray) -> FloatArray:
    """Acceleration (3,) [m/s^2] of one point of a body relative to another that is r (3,) [m] before it.

    `w` (3,) is the body's angular velocity [rad/s], `alpha` (3,) its angular acceleration [rad/s^2].
    """
    return cross(alpha, r) + cross(w, cross(w, r))


@compiled
def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product (3,)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
