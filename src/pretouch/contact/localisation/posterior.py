"""What a posterior over candidates comes to: the likeliest body, the point on it, how certain both are."""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.localisation.single_contact import Candidates
from pretouch.robot.surface import SPACING_M
from pretouch.types import FloatArray, IntArray

_NEGLIGIBLE = 12.0
"""Nats below the most likely candidate from which on a candidate is left out."""


class ContactArrays(NamedTuple):
    """Room for a contact, as of `Touched` with one row."""

    link: IntArray
    point: FloatArray
    force: FloatArray
    sigma: FloatArray
    probability: FloatArray


@compiled
def summarise(ln: FloatArray, candidates: Candidates, there: FloatArray, contact: ContactArrays) -> None:
    """Write the contact of a posterior exp(ln) (N,), not normalised, and the forces (N, 3) of the candidates [N].

    The body is the likeliest rigid one. The point is the mean on it, brought to the surface along the normal of the
    nearest candidate; a mean of points on a convex body lies inside.
    """
    at, normal, first = candidates.point, candidates.normal, candidates.surface.first
    # exp(ln - max) cannot overflow; the sum over a body is its probability, up to the sum over all
    most, total, best, body = ln.max(), 0.0, -1.0, 0
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
    # the mean may be near a side of the body that nothing speaks for: its normal and force are not taken
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
    # second moment about the reported point, not about the mean: the error of what is reported
    V = np.zeros((3, 3))
    for c in range(first[body], first[body + 1]):
        part = math.exp(ln[c] - most) / best
        for i in range(3):
            for j in range(3):
                V[i, j] += part * (at[c, i] - contact.point[0, i]) * (at[c, j] - contact.point[0, j])
    contact.link[0], contact.probability[0] = candidates.surface.link[nearest], best / total
    # a point anywhere between candidates, SPACING_M apart: the variance of a uniform distribution is d^2 / 12
    contact.sigma[0] = math.sqrt(_largest_eigenvalue(V) + SPACING_M**2 / 12.0)


@compiled
def _largest_eigenvalue(V: FloatArray) -> float:
    """Largest eigenvalue of a covariance (3, 3): the root of its characteristic polynomial in closed form.

    With q = tr V / 3 and B = (V - q 1) / r, r^2 = tr (V - q 1)^2 / 6, it is q + 2 r cos(arccos(det B / 2) / 3).
    """
    q = (V[0, 0] + V[1, 1] + V[2, 2]) / 3.0
    off = V[0, 1] ** 2 + V[0, 2] ** 2 + V[1, 2] ** 2
    spread = (V[0, 0] - q) ** 2 + (V[1, 1] - q) ** 2 + (V[2, 2] - q) ** 2 + 2.0 * off
    if not spread > 0.0:
        return q
    r = math.sqrt(spread / 6.0)
    x, y, z = (V[0, 0] - q) / r, (V[1, 1] - q) / r, (V[2, 2] - q) / r
    u, v, w = V[0, 1] / r, V[0, 2] / r, V[1, 2] / r
    half = 0.5 * (x * (y * z - w * w) - u * (u * z - w * v) + v * (u * w - y * v))
    # rounding may take it beyond 1
    return q + 2.0 * r * math.cos(math.acos(min(1.0, max(-1.0, half))) / 3.0)
