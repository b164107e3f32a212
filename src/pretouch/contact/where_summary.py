"""What a distribution over places comes to: the likeliest body, the place on it, how sure both are."""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import SurfaceArrays
from pretouch.robot.surface import SPACING_M
from pretouch.types import FloatArray, IntArray

_NEGLIGIBLE = 12.0
"""Nats below the most likely place from which on a place is left out."""


class ContactArrays(NamedTuple):
    """Room for two contacts, as of `Touched`."""

    link: IntArray
    point: FloatArray
    force: FloatArray
    sigma: FloatArray
    probability: FloatArray


@compiled
def summarise(
    ln: FloatArray, at: FloatArray, outwards: FloatArray, surface: SurfaceArrays, there: FloatArray,
    contacts: ContactArrays, k: int,
) -> None:  # fmt: skip
    """Write contact k: the likeliest rigid body, the mean place on it brought to the surface, force, spread."""
    link, first = surface.link, surface.first
    on, point, force, sigma, probability = contacts
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
    nearest, least = first[body], np.inf
    for c in range(first[body], first[body + 1]):
        gap = (at[c, 0] - mean[0]) ** 2 + (at[c, 1] - mean[1]) ** 2 + (at[c, 2] - mean[2]) ** 2
        if gap < least and ln[c] > top - _NEGLIGIBLE:
            nearest, least = c, gap
    above = 0.0
    for i in range(3):
        above += (mean[i] - at[nearest, i]) * outwards[nearest, i]
    for i in range(3):
        point[k, i] = mean[i] - above * outwards[nearest, i]
        force[k, i] = there[nearest, i]
    V = np.zeros((3, 3))
    for c in range(first[body], first[body + 1]):
        part = math.exp(ln[c] - most) / best
        for i in range(3):
            for j in range(3):
                V[i, j] += part * (at[c, i] - point[k, i]) * (at[c, j] - point[k, j])
    on[k], probability[k], sigma[k] = link[nearest], best / total, math.sqrt(_largest(V) + SPACING_M**2 / 12.0)


@compiled
def _largest(V: FloatArray) -> float:
    """Largest eigenvalue of a covariance (3, 3): the root of its characteristic polynomial in closed form."""
    q = (V[0, 0] + V[1, 1] + V[2, 2]) / 3.0
    off = V[0, 1] ** 2 + V[0, 2] ** 2 + V[1, 2] ** 2
    spread = (V[0, 0] - q) ** 2 + (V[1, 1] - q) ** 2 + (V[2, 2] - q) ** 2 + 2.0 * off
    if not spread > 0.0:
        return q
    r = math.sqrt(spread / 6.0)
    x, y, z = (V[0, 0] - q) / r, (V[1, 1] - q) / r, (V[2, 2] - q) / r
    u, v, w = V[0, 1] / r, V[0, 2] / r, V[1, 2] / r
    half = 0.5 * (x * (y * z - w * w) - u * (u * z - w * v) + v * (u * w - y * v))
    return q + 2.0 * r * math.cos(math.acos(min(1.0, max(-1.0, half))) / 3.0)


@compiled
def leave_out(ln: FloatArray, body: IntArray, out: int) -> None:
    """Leave the places (N,) of one rigid body out of a distribution."""
    for c in range(len(ln)):
        if body[c] == out:
            ln[c] = -np.inf


@compiled
def exchange(contacts: ContactArrays) -> None:
    """Exchange both contacts."""
    on, point, force, sigma, probability = contacts
    on[0], on[1] = on[1], on[0]
    sigma[0], sigma[1] = sigma[1], sigma[0]
    probability[0], probability[1] = probability[1], probability[0]
    for i in range(3):
        point[0, i], point[1, i] = point[1, i], point[0, i]
        force[0, i], force[1, i] = force[1, i], force[0, i]
