"""The joint-space mass matrix from where everything is: what a compiled step needs of it, without MuJoCo."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import Mechanism
from pretouch.robot.model import Kinematics
from pretouch.types import FloatArray


@compiled
def mass_matrix_into(kin: Kinematics, mechanism: Mechanism, M: FloatArray) -> None:
    """Write M = sum of m Jv^T Jv + Jw^T I Jw over the links (n, n) [kg m^2].

    Jv (3, n) is the Jacobian of a link's centre of mass and Jw that of its angular velocity.
    """
    position, rotation, anchor, axis = kin
    moved_by = mechanism.arm.moved_by
    mass, com, inertia = mechanism.links.mass, mechanism.links.com, mechanism.links.inertia
    n = len(anchor)
    V, W, H, turned = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty((3, 3))
    c, RI = np.empty(3), np.empty((3, 3))
    M[:] = 0.0
    for m in range(len(mass)):
        if mass[m] <= 0.0 or not moved_by[m].any():
            continue
        R = rotation[m]
        for i in range(3):
            c[i] = position[m, i]
            for j in range(3):
                c[i] += R[i, j] * com[m, j]
                RI[i, j] = R[i, 0] * inertia[m, 0, j] + R[i, 1] * inertia[m, 1, j] + R[i, 2] * inertia[m, 2, j]
        for i in range(3):
            for j in range(3):
                turned[i, j] = RI[i, 0] * R[j, 0] + RI[i, 1] * R[j, 1] + RI[i, 2] * R[j, 2]
        for j in range(n):
            if not moved_by[m, j]:
                continue
            x, y, z = c[0] - anchor[j, 0], c[1] - anchor[j, 1], c[2] - anchor[j, 2]
            V[j, 0] = axis[j, 1] * z - axis[j, 2] * y
            V[j, 1] = axis[j, 2] * x - axis[j, 0] * z
            V[j, 2] = axis[j, 0] * y - axis[j, 1] * x
            for i in range(3):
                W[j, i] = axis[j, i]
                H[j, i] = turned[i, 0] * axis[j, 0] + turned[i, 1] * axis[j, 1] + turned[i, 2] * axis[j, 2]
            for k in range(j + 1):
                if moved_by[m, k]:
                    M[j, k] += mass[m] * (V[j, 0] * V[k, 0] + V[j, 1] * V[k, 1] + V[j, 2] * V[k, 2])
                    M[j, k] += H[j, 0] * W[k, 0] + H[j, 1] * W[k, 1] + H[j, 2] * W[k, 2]
    for j in range(n):
        for k in range(j):
            M[k, j] = M[j, k]
