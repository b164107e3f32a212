"""Which link's contact explains what accelerometers all over an arm measured at once.

A force f on link l accelerates the joints by M^-1 J_l^T f, and the unit u by A_ul f, A_ul = R_u^T J_u M^-1 J_l^T. The
likelihood ratio of the pattern z of all units is that of the sequential test: the force is integrated out with a prior
that is g times as wide as what z without a contact is (Zellner 1986).
"""

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import compiled
from pretouch.contact.sequential import log_ratio
from pretouch.groups import Mechanism, SkinArrays
from pretouch.robot.mass_matrix import mass_matrix_into
from pretouch.robot.model import Kinematics, jacobian_into
from pretouch.types import BoolArray, FloatArray

_LARGEST = 100.0
"""Logarithm of a likelihood ratio from which on it is all the same."""
_SINGULAR = 1e-6
"""Part of its trace by which a force's information is made regular: one that no unit measures has none."""


@compiled
def responses(kin: Kinematics, mechanism: Mechanism, rotor: float, skin: SkinArrays) -> FloatArray:
    """Return A (P, K, 3, 3) [1/kg]: sensor frame of each unit, base frame of a force at the middle of each link.

    `rotor` is the drives' inertia [kg m^2], which moves with the joints.
    """
    position, rotation, anchor, axis = kin
    moved_by, parts, middle = mechanism.arm.moved_by, mechanism.links.parts, mechanism.links.middle
    link, T_link_sensor = skin.link, skin.T_link_sensor
    n, units = len(anchor), len(link)
    M, L, J = np.empty((n, n)), np.zeros((n, n)), np.empty((6, n))
    y, X = np.empty(n), np.empty((n, 3))
    A, Jacobian = np.zeros((len(parts), units, 3, 3)), np.empty((units, 3, n))
    mass_matrix_into(kin, mechanism, M)
    for j in range(n):
        M[j, j] += rotor
    if not factor(M, L):
        return A
    for u in range(units):
        R = rotation[link[u]] @ np.ascontiguousarray(T_link_sensor[u, :3, :3])
        place = position[link[u]] + rotation[link[u]] @ np.ascontiguousarray(T_link_sensor[u, :3, 3])
        jacobian_into(anchor, axis, moved_by[link[u]], place, J)
        Jacobian[u] = R.T @ np.ascontiguousarray(J[:3])
    for h in range(len(parts)):
        touched = parts[h]
        jacobian_into(anchor, axis, moved_by[touched], position[touched] + rotation[touched] @ middle[h], J)
        for a in range(3):
            forward(L, J[a], y)
            backward(L, y, X[:, a])
        for u in range(units):
            A[h, u] = Jacobian[u] @ X
    return A


@compiled
def likelihoods(
    z: FloatArray, variance: FloatArray, known: BoolArray, A: FloatArray, gain: float, tails: float,
    likelihood: FloatArray,
) -> None:  # fmt: skip
    """Write how much likelier accelerations are with a contact on each link than without one (P,).

    Args:
        z: (K, 3) accelerations less those of free motion [m/s^2].
        variance: (K, 3) of them [m^2/s^4].
        known: (K,) which of them count.
        A: (P, K, 3, 3) see `responses`.
        gain: g, how much larger the spread with a contact is, in each direction it can push.
        tails: degrees of freedom of the Student distribution without one.
        likelihood: (P,) result; 0 where no unit counts.
    """
    size = 3 * known.sum()
    likelihood[:] = 0.0
    if size == 0:
        return
    square = 0.0
    for u in range(len(z)):
        if known[u]:
            for i in range(3):
                square += z[u, i] ** 2 / variance[u, i]
    alone, widened = np.log1p(square / tails), np.log1p(gain)
    G, b, c, y = np.empty((3, 3)), np.empty(3), np.zeros((3, 3)), np.empty(3)
    for h in range(len(A)):
        G[:], b[:] = 0.0, 0.0
        for u in range(len(z)):
            if not known[u]:
                continue
            for i in range(3):
                for j in range(3):
                    part = A[h, u, i, j] / variance[u, i]
                    b[j] += part * z[u, i]
                    for k in range(3):
                        G[j, k] += part * A[h, u, i, k]
        regular = _SINGULAR * (G[0, 0] + G[1, 1] + G[2, 2])
        for j in range(3):
            G[j, j] += regular
        if factor(G, c):
            explained = forward(c, b, y)
            ratio = log_ratio(alone, square, explained, 3, size, gain, widened, tails)
            likelihood[h] = np.exp(min(ratio, _LARGEST))
