"""Small vector products for compiled loops, where calling a linear algebra library for three numbers is slow."""

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.groups import CapsuleArrays, Kinematics
from pretouch.robot.body import Capsules
from pretouch.types import FloatArray, IntArray


@kernel
def dot(a: FloatArray, b: FloatArray) -> float:
    """Scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def rotate(R: FloatArray, v: FloatArray, out: FloatArray) -> None:
    """Write R @ v of a matrix (3, 3) and a vector (3,) to `out` (3,), which is another array."""
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]


@compiled
def below(numbers: FloatArray, bound: float) -> bool:
    """Whether all numbers (k,) are smaller than a bound in size; one that is NaN is not."""
    for number in numbers:  # noqa: SIM110  compiled code knows no generators
        if not abs(number) < bound:
            return False
    return True


@compiled
def rotation_error(rotation: FloatArray, goal: FloatArray) -> FloatArray:
    """Rotation from one orientation to the other (3,): the unit axis times the sine of the angle, base frame."""
    error = np.zeros(3)
    # Half the sum of the cross products of each axis of the one with its like of the other. The sine falls again beyond
    # a right angle and is 0 for a half turn: good for holding an orientation, not for turning to a far one.
    for i in range(3):
        x, y, z = rotation[0, i], rotation[1, i], rotation[2, i]
        error[0] += 0.5 * (y * goal[2, i] - z * goal[1, i])
        error[1] += 0.5 * (z * goal[0, i] - x * goal[2, i])
        error[2] += 0.5 * (x * goal[1, i] - y * goal[0, i])
    return error


def placed(capsules: Capsules, kin: Kinematics) -> tuple[FloatArray, FloatArray]:
    """Both ends (C, 3) of each capsule's axis in the base frame [m]."""
    ends = placed_ends(capsules.link, capsules.a, capsules.b, kin.position, kin.rotation)
    return ends[0], ends[1]


@compiled
def placed_capsules(capsules: CapsuleArrays, kin: Kinematics) -> CapsuleArrays:
    """Return capsules of an arm in a posture, placed in the base frame."""
    ends = placed_ends(capsules.link, capsules.a, capsules.b, kin.position, kin.rotation)
    return CapsuleArrays(capsules.link, ends[0], ends[1], capsules.radius)


@compiled
def placed_ends(link: IntArray, a: FloatArray, b: FloatArray, position: FloatArray, rotation: FloatArray) -> FloatArray:
    """Both ends (2, C, 3) of the axis of each capsule in the base frame [m]; see `placed`."""
    ends = np.empty((2, len(link), 3))
    for c in range(len(link)):
        k = link[c]
        for i in range(3):
            ends[0, c, i] = position[k, i]
            ends[1, c, i] = position[k, i]
            for j in range(3):
                ends[0, c, i] += rotation[k, i, j] * a[c, j]
                ends[1, c, i] += rotation[k, i, j] * b[c, j]
    return ends
