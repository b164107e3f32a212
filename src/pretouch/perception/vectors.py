"""Small vector products for compiled loops, where calling a linear algebra library for three numbers is slow."""

import numpy as np
from numba import njit

from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics
from pretouch.types import FloatArray, IntArray


@njit(cache=True, inline="always")
def dot(a: FloatArray, b: FloatArray) -> float:
    """Scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def rotated(R: FloatArray, v: FloatArray) -> FloatArray:
    """R @ v of a matrix (3, 3) and a vector (3,)."""
    out = np.empty(3)
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]
    return out


def placed(capsules: Capsules, kin: Kinematics) -> tuple[FloatArray, FloatArray]:
    """Both ends (C, 3) of each capsule's axis in the base frame [m]."""
    return _placed(capsules.link, capsules.a, capsules.b, kin.position, kin.rotation)


@njit(cache=True)
def _placed(
    link: IntArray, a: FloatArray, b: FloatArray, position: FloatArray, rotation: FloatArray
) -> tuple[FloatArray, FloatArray]:
    ends = np.empty((2, len(link), 3))
    for c in range(len(link)):
        ends[0, c] = position[link[c]] + rotated(rotation[link[c]], a[c])
        ends[1, c] = position[link[c]] + rotated(rotation[link[c]], b[c])
    return ends[0], ends[1]
