"""How well a contact at each place of the surface explains the torques that are felt.

With L the Cholesky factor of the torques' covariance, a force f at the point p of a rigid body makes the torques J^T f,
which are linear in the wrench [f; m] at the body's origin o, m = (p - o) x f: tau = A w, A (n, 6) the same for all
points of the body. All that a place needs is A^T S^-1 A and A^T S^-1 tau of its body, so that thousands of places cost
little.

The force pushes inwards. Across the normal it is Gaussian, mu times as large as along it in each direction; along it,
its size has a wide prior. It is integrated out in closed form (Laplace), so that places are compared by evidence, not
by the best fit: a place where any force explains nearly anything pays for it.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import SurfaceArrays
from pretouch.robot.model import Kinematics
from pretouch.types import BoolArray, FloatArray

LEAST_N = 1.0
"""Force along the normal below which the one across it is no longer made smaller [N]."""


@compiled
def covariance_of_mean(
    mean: FloatArray, S: FloatArray, doubt: FloatArray, samples: float, relative: float, C: FloatArray
) -> None:
    """Write the covariance (n, n) of the mean (n,) of so many samples.

    `S` (n, n) is the spread of a sample, with `doubt` (n,) on its diagonal, which does not average out [Nm^2];
    `relative` times its torque is added to the deviation of each joint.
    """
    n = len(mean)
    for i in range(n):
        for j in range(n):
            C[i, j] = S[i, j] / samples
        C[i, i] += doubt[i] * (1.0 - 1.0 / samples) + (relative * mean[i]) ** 2


@compiled
def wrench_of_body(
    anchor: FloatArray, axis: FloatArray, moved: BoolArray, origin: FloatArray, L: FloatArray, W: FloatArray
) -> None:
    """Write L^-1 A (n, 6) of a body, moved by joints `moved` (n,), wrenches being taken about a point (3,)."""
    n = len(anchor)
    for j in range(n):
        for i in range(6):
            W[j, i] = 0.0
        if moved[j]:
            x, y, z = origin[0] - anchor[j, 0], origin[1] - anchor[j, 1], origin[2] - anchor[j, 2]
            W[j, 0] = axis[j, 1] * z - axis[j, 2] * y
            W[j, 1] = axis[j, 2] * x - axis[j, 0] * z
            W[j, 2] = axis[j, 0] * y - axis[j, 1] * x
            W[j, 3], W[j, 4], W[j, 5] = axis[j, 0], axis[j, 1], axis[j, 2]
        for i in range(6):
            rest = W[j, i]
            for k in range(j):
                rest -= L[j, k] * W[k, i]
            W[j, i] = rest / L[j, j]


@compiled
def directions(normal: FloatArray, arm: FloatArray, u: FloatArray) -> None:
    """Write the wrenches (3, 6) of unit forces inwards and in two directions across, at `arm` (3,) from the origin."""
    x, y, z = normal[0], normal[1], normal[2]
    u[0, 0], u[0, 1], u[0, 2] = -x, -y, -z
    # two directions across a unit vector, without a case that is singular (Duff et al. 2017)
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    u[1, 0], u[1, 1], u[1, 2] = 1.0 + sign * x * x * a, sign * b, -sign * x
    u[2, 0], u[2, 1], u[2, 2] = b, sign + y * y * a, -y
    for k in range(3):
        u[k, 3] = arm[1] * u[k, 2] - arm[2] * u[k, 1]
        u[k, 4] = arm[2] * u[k, 0] - arm[0] * u[k, 2]
        u[k, 5] = arm[0] * u[k, 1] - arm[1] * u[k, 0]


@compiled
def force_there(
    G: FloatArray, h: FloatArray, u: FloatArray, mu: float, largest: float, force: FloatArray
) -> tuple[float, float]:
    """Write the force (3,) along `u` that explains most, and return what it explains and ln of what its freedom costs.

    `G` (6, 6) is A^T S^-1 A and `h` (6,) A^T S^-1 tau of the body. The first value is to be taken off tau^T S^-1 tau.
    """
    g = np.empty((3, 3))
    b = np.empty(3)
    for i in range(3):
        b[i] = 0.0
        for k in range(6):
            b[i] += u[i, k] * h[k]
        for j in range(i + 1):
            total = 0.0
            for k in range(6):
                part = 0.0
                for m in range(6):
                    part += G[k, m] * u[j, m]
                total += u[i, k] * part
            g[i, j] = total
            g[j, i] = total
    size = b[0] / (g[0, 0] + 1.0 / largest**2)
    normal, across = 1.0 / largest**2, 0.0
    c00 = c10 = c11 = c20 = c21 = c22 = v0 = v1 = v2 = 0.0
    for _ in range(3):
        across = 1.0 / (mu * max(size, LEAST_N)) ** 2
        # the tangents first, so that the last pivot is the information on the normal force alone
        c00 = math.sqrt(g[1, 1] + across)
        c10 = g[2, 1] / c00
        c11 = math.sqrt(g[2, 2] + across - c10 * c10)
        c20 = g[0, 1] / c00
        c21 = (g[0, 2] - c20 * c10) / c11
        c22 = math.sqrt(max(g[0, 0] + normal - c20 * c20 - c21 * c21, normal))
        v0 = b[1] / c00
        v1 = (b[2] - c10 * v0) / c11
        v2 = (b[0] - c20 * v0 - c21 * v1) / c22
        size = v2 / c22
    force[0] = size
    force[2] = (v1 - c21 * size) / c11
    force[1] = (v0 - c10 * force[2] - c20 * size) / c00
    # how much of the normal force's distribution pushes
    pushes = math.log(max(1.0 + math.erf(v2 / math.sqrt(2.0)), 1e-30))
    explained = v0 * v0 + v1 * v1 + v2 * v2
    return explained, pushes + 0.5 * math.log(normal) + math.log(across) - math.log(c00 * c11 * c22)


class ForcePrior(NamedTuple):
    """What a contact's force is like, and the noise."""

    mu: float
    """Deviation of the force across the normal, as part of that along it."""
    largest: float
    """Deviation of the force along the normal [N]."""
    tails: float
    """Degrees of freedom of the Student distribution of the torques."""


class Whitened(NamedTuple):
    """Torques (n,) in units of their deviations: y = L^-1 tau."""

    L: FloatArray
    """(n, n) Cholesky factor of their covariance."""
    y: FloatArray
    """(n,)."""
    square: float
    """y . y."""


@compiled
def evidence_of_places(
    kin: Kinematics, moved_by: BoolArray, surface: SurfaceArrays, torques: Whitened, p: ForcePrior, ln: FloatArray,
    force: FloatArray,
) -> float:  # fmt: skip
    """Write ln of the evidence (N,) of a contact at each place, and the most likely force (N, 3) there, base frame.

    Returns the least that any of them leaves unexplained of `square` = y . y.
    """
    position, rotation, anchor, axis = kin
    link, point, normal, first = surface.link, surface.point, surface.normal, surface.first
    L, y, square = torques
    n, left = len(anchor), square
    W, G, h, u = np.empty((n, 6)), np.empty((6, 6)), np.empty(6), np.empty((3, 6))
    f, arm, outwards = np.empty(3), np.empty(3), np.empty(3)
    for body in range(len(first) - 1):
        if first[body] == first[body + 1]:
            continue
        origin = position[link[first[body]]]
        wrench_of_body(anchor, axis, moved_by[link[first[body]]], origin, L, W)
        for i in range(6):
            h[i] = 0.0
            for j in range(n):
                h[i] += W[j, i] * y[j]
            for k in range(i + 1):
                total = 0.0
                for j in range(n):
                    total += W[j, i] * W[j, k]
                G[i, k] = total
                G[k, i] = total
        for c in range(first[body], first[body + 1]):
            k = link[c]
            for i in range(3):
                arm[i], outwards[i] = position[k, i] - origin[i], 0.0
                for j in range(3):
                    arm[i] += rotation[k, i, j] * point[c, j]
                    outwards[i] += rotation[k, i, j] * normal[c, j]
            directions(outwards, arm, u)
            explained, cost = force_there(G, h, u, p.mu, p.largest, f)
            rest = max(square - explained, 0.0)
            left = min(left, rest)
            ln[c] = cost - 0.5 * (p.tails + n) * math.log1p(rest / p.tails)
            for i in range(3):
                force[c, i] = f[0] * u[0, i] + f[1] * u[1, i] + f[2] * u[2, i]
    return left
