"""Posterior of a single contact over candidate points, and its summary: body, point, and their certainty.

The prior does not use the torques. For the likelihood, with L the Cholesky factor of the torques' covariance
S, a force f at the point p of a rigid body makes the torques J^T f, which are linear in the wrench w = [f; m] at the
body's origin o, m = (p - o) x f: tau = A w with A (n, 6) the same for all points of the body. A candidate needs
only A^T S^-1 A and A^T S^-1 tau of its body, so that thousands of candidates cost little.

The force pushes inwards. Across the normal it is Gaussian, mu times as large as along it in each direction; along it,
its size has a wide prior. It is integrated out in closed form (Laplace), so that candidates are compared by marginal
likelihood, not by the best fit: that penalises a point where some force explains nearly any torques.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor, forward, largest_eigenvalue
from pretouch.compiled import kernel
from pretouch.contact.touch_cue import Cues
from pretouch.params import LocalisationParams
from pretouch.robot.body import SPACING_M, Surface
from pretouch.robot.kinematics import Kinematics, jacobian_into, tangents_of
from pretouch.types import BoolArray, FloatArray, Obstacles, Touched

_NEVER = 1e-12
"""Prior of an impossible contact: its logarithm stays finite."""


@kernel
def log_prior(
    point: FloatArray, surface: Surface, hidden: BoolArray, near: Obstacles, cues: Cues,
    p: LocalisationParams, ln: FloatArray,
) -> None:  # fmt: skip
    """Write ln of the prior (N,) of a contact at each candidate; all candidates together have probability 1.

    A mixture of three: contacts spread over the surface that is not hidden, times the units' gain of each link;
    contacts with obstacles, normally distributed about their points, and likelier near the body; contacts at touched
    units, spread by their own error. Contacts that no unit sees keep their part.
    """
    link, area, distance = surface.link, surface.area, near.body_distance
    count, base, nearest = len(point), 0.0, 0.0
    weight, kernel, touched = np.zeros(count), np.empty(count), np.zeros(count)
    located = np.zeros(len(cues.gain), np.bool_)
    # touched units, each with its own error; candidates lie too far apart for less than `unit_m`
    for k in range(len(cues.link)):
        sigma = max(cues.sigma[k], p.unit_m)
        if _normal_kernel(point, surface, hidden, cues.link[k], cues.point[k], sigma, kernel):
            located[cues.link[k]] = True
            for c in range(count):
                touched[c] += kernel[c]
    # A touch with a known point counts by that point, and not once more by the gain of its link: the part of the
    # probability for a false touch would be on that link too.
    for c in range(count):
        if not hidden[c]:
            weight[c] = area[c] if located[link[c]] else area[c] * cues.gain[link[c]]
            base += weight[c]
    for c in range(count):
        weight[c] /= max(base, 1e-300)
    # A unit sees the side of the touching object, so its points are beside the contact by about `seen_m`. The nearest
    # obstacle determines their share of the probability, and all divide it by their nearness.
    at_obstacles = np.zeros(count)
    for k in range(len(distance)):
        nearness = min(1.0, max(0.0, 1.0 - distance[k] / p.near_m))
        if nearness > 0.0 and _normal_kernel(point, surface, hidden, -1, near.point[k], p.seen_m, kernel):
            nearest = max(nearest, nearness)
            for c in range(count):
                at_obstacles[c] += nearness * kernel[c]
    # touched units last: their share is of all, obstacles included
    _mix(weight, at_obstacles, p.seen_share * nearest)
    _mix(weight, touched, p.unit_share)
    for c in range(count):
        ln[c] = math.log(max(weight[c], _NEVER))


@kernel
def _normal_kernel(
    point: FloatArray, surface: Surface, hidden: BoolArray, only: int, mean: FloatArray, sigma: float, out: FloatArray
) -> bool:
    """Write a normal distribution (N,) about a point (3,), over the candidates of one link if `only` is not -1.

    Returns False where no candidate is near enough for a sum above 0.
    """
    total = 0.0
    for c in range(len(point)):
        out[c] = 0.0
        if not hidden[c] and (only < 0 or surface.link[c] == only):
            x, y, z = point[c, 0] - mean[0], point[c, 1] - mean[1], point[c, 2] - mean[2]
            # times the area of the candidate: a density on the surface, independent of the sampling
            out[c] = surface.area[c] * math.exp(-0.5 * (x * x + y * y + z * z) / (sigma * sigma))
            total += out[c]
    if not total > 1e-30:
        return False
    for c in range(len(point)):
        out[c] /= total
    return True


@kernel
def _mix(weight: FloatArray, kernels: FloatArray, share: float) -> None:
    """Mix a share of the sum of other distributions (N,) into weights (N,) whose sum is 1."""
    total = sum(kernels)
    if total > 0.0:
        for c in range(len(weight)):
            weight[c] = (1.0 - share) * weight[c] + share * kernels[c] / total


_LEAST_N = 1.0
"""Force along the normal below which the one across it shrinks no further [N]."""


class Candidates(NamedTuple):
    """N possible points of a contact, and the torques that it has to explain."""

    torque: FloatArray
    """(n,) external torques less those of free motion [Nm]."""
    kin: Kinematics
    moved_by: BoolArray
    """(L, n) whether a joint moves a link."""
    surface: Surface
    point: FloatArray
    """(N, 3) in the base frame [m]."""
    normal: FloatArray
    """(N, 3) outward normals there."""
    log_prior: FloatArray
    """(N,) of a contact."""
    p: LocalisationParams


@kernel
def log_posterior(S: FloatArray, candidates: Candidates, ln: FloatArray, force: FloatArray) -> bool:
    """Write ln of prior times marginal likelihood (N,) of a contact at each candidate, and its likeliest force (N, 3).

    Forces are in the base frame [N]. The values are comparable between covariances S (n, n) of the torques [Nm^2]. With
    z^T S^-1 z = |L^-1 z|^2 and X the part that the force explains, Student's tails of nu degrees of freedom give

        ln = ln prior - ln det L + ln of the force's freedom - (nu + n) / 2 ln(1 + (z^T S^-1 z - X) / nu).

    Returns whether S is positive definite; otherwise nothing is written.
    """
    surface, p, kin, normal = candidates.surface, candidates.p, candidates.kin, candidates.normal
    position, link, first, n = kin.position, surface.link, surface.first, len(S)
    L, y, G, h, u = np.zeros((n, n)), np.empty(n), np.empty((6, 6)), np.empty(6), np.empty((3, 6))
    if not factor(S, L):
        return False
    square, log_det = forward(L, candidates.torque, y), 0.0
    for j in range(n):
        log_det += math.log(L[j, j])
    a, lever = np.empty(3), np.empty(3)
    for body in range(len(first) - 1):
        if first[body] == first[body + 1]:
            continue
        # links without a joint between them are one body: any of them gives the origin
        base = link[first[body]]
        _wrench_information(kin, candidates.moved_by[base], position[base], L, y, G, h)
        for c in range(first[body], first[body + 1]):
            for i in range(3):
                lever[i] = candidates.point[c, i] - position[base, i]
            # the directions of the force at this candidate, and the part that the best force along them explains
            _unit_wrenches(normal[c], lever, u)
            explained, freedom = _likeliest_force(G, h, u, p.friction, p.force_n, a)
            rest = max(square - explained, 0.0)  # rounding may take it below 0
            ln[c] = freedom - 0.5 * (p.tails + n) * math.log1p(rest / p.tails) + (candidates.log_prior[c] - log_det)
            for i in range(3):
                force[c, i] = a[0] * u[0, i] + a[1] * u[1, i] + a[2] * u[2, i]
    return True


@kernel
def _wrench_information(
    kin: Kinematics, moved: BoolArray, origin: FloatArray, L: FloatArray, y: FloatArray, G: FloatArray, h: FloatArray
) -> None:
    """Write G = A^T S^-1 A (6, 6) and h = A^T S^-1 tau (6,) of a body, from W = L^-1 A and y = L^-1 tau.

    A (n, 6) is the transposed Jacobian of the body's origin (3,), moved by the joints `moved` (n,).
    """
    n = len(y)
    J, W = np.empty((6, n)), np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, moved, origin, J)
    for i in range(6):
        forward(L, J[i], W[i])
        h[i] = 0.0
        for j in range(n):
            h[i] += W[i, j] * y[j]
        for k in range(i + 1):
            total = 0.0
            for j in range(n):
                total += W[i, j] * W[k, j]
            G[i, k] = total
            G[k, i] = total


@kernel
def _unit_wrenches(normal: FloatArray, lever: FloatArray, u: FloatArray) -> None:
    """Write the wrenches (3, 6) of unit forces inwards and in two directions across, `lever` (3,) from the origin."""
    u[0, 0], u[0, 1], u[0, 2] = -normal[0], -normal[1], -normal[2]
    tangents_of(normal, u[1:])
    # moments m = lever x f
    for k in range(3):
        u[k, 3] = lever[1] * u[k, 2] - lever[2] * u[k, 1]
        u[k, 4] = lever[2] * u[k, 0] - lever[0] * u[k, 2]
        u[k, 5] = lever[0] * u[k, 1] - lever[1] * u[k, 0]


@kernel
def _likeliest_force(
    G: FloatArray, h: FloatArray, u: FloatArray, mu: float, largest: float, a: FloatArray
) -> tuple[float, float]:
    """Write the components (3,) along `u` of the likeliest force [N]; return its explained part and ln of its freedom.

    With g = u G u^T, b = u h, F = `largest` and the prior's precision P = diag(1/F^2, 1/(mu a_0)^2, 1/(mu a_0)^2):

        a = (g + P)^-1 b,    X = b^T a,    freedom = ln[2 Phi(a_0 / sigma_0)] + ln|P| / 2 - ln|g + P| / 2.
    """
    g, b = np.empty((3, 3)), np.empty(3)
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
    # the start: the force that explains most without a component across
    size = b[0] / (g[0, 0] + 1.0 / largest**2)
    normal, across = 1.0 / largest**2, 0.0
    c00 = c10 = c11 = c20 = c21 = c22 = v0 = v1 = v2 = 0.0
    # The prior across depends on the size of the force along the normal, which follows from the prior: three rounds
    # of this fixed point are enough.
    for _ in range(3):
        across = 1.0 / (mu * max(size, _LEAST_N)) ** 2
        # Cholesky factor c of g + P, the tangents first, so that the last pivot is the information on a_0 alone
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
    # back substitution, the last pivot first
    a[0] = size
    a[2] = (v1 - c21 * size) / c11
    a[1] = (v0 - c10 * a[2] - c20 * size) / c00
    # v2 = a_0 / sigma_0: 2 Phi of it is the part of the distribution with a push
    pushes = math.log(max(1.0 + math.erf(v2 / math.sqrt(2.0)), 1e-30))
    explained = v0 * v0 + v1 * v1 + v2 * v2
    return explained, pushes + 0.5 * math.log(normal) + math.log(across) - math.log(c00 * c11 * c22)


_NEGLIGIBLE = 12.0
"""Nats below the most likely candidate from which a candidate is left out."""


@kernel
def summarise(ln: FloatArray, candidates: Candidates, there: FloatArray, contact: Touched) -> None:
    """Write the contact of a posterior exp(ln) (N,), not normalised, and the forces (N, 3) of the candidates [N].

    The body is the likeliest rigid one. The point is the mean on it, brought to the surface along the normal of the
    nearest candidate; a mean of points on a convex body lies inside.
    """
    at, normal, first = candidates.point, candidates.normal, candidates.surface.first
    # exp(ln - max) cannot overflow; the sum over a body is its probability, up to the sum over all
    most, total, best, body = -np.inf, 0.0, -1.0, 0
    for value in ln:
        most = max(most, value)
    for d in range(len(first) - 1):
        here = 0.0
        for c in range(first[d], first[d + 1]):
            here += math.exp(ln[c] - most)
        total += here
        if here > best:
            best, body = here, d
    mean = np.zeros(3)
    top = -np.inf
    for c in range(first[body], first[body + 1]):
        top = max(top, ln[c])
        for i in range(3):
            mean[i] += math.exp(ln[c] - most) / best * at[c, i]
    # the mean may be near an unlikely side of the body: its normal and force are not used
    nearest, least = first[body], np.inf
    for c in range(first[body], first[body + 1]):
        gap = (at[c, 0] - mean[0]) ** 2 + (at[c, 1] - mean[1]) ** 2 + (at[c, 2] - mean[2]) ** 2
        if gap < least and ln[c] > top - _NEGLIGIBLE:
            nearest, least = c, gap
    above = 0.0
    for i in range(3):
        above += (mean[i] - at[nearest, i]) * normal[nearest, i]
    for i in range(3):
        contact.point[0, i] = mean[i] - above * normal[nearest, i]
        contact.force[0, i] = there[nearest, i]
    # second moment about the reported point, not about the mean: the error of the report
    V = np.zeros((3, 3))
    for c in range(first[body], first[body + 1]):
        part = math.exp(ln[c] - most) / best
        for i in range(3):
            for j in range(3):
                V[i, j] += part * (at[c, i] - contact.point[0, i]) * (at[c, j] - contact.point[0, j])
    contact.link[0], contact.probability[0] = candidates.surface.link[nearest], best / total
    # a point anywhere between candidates, SPACING_M apart: the variance of a uniform distribution is d^2 / 12
    contact.sigma[0] = math.sqrt(largest_eigenvalue(V) + SPACING_M**2 / 12.0)
