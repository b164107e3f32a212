"""Where a contact is likely before its torques are looked at: outside, where something is near, where units say so."""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import SurfaceArrays
from pretouch.types import BoolArray, FloatArray, IntArray

_NEVER = 1e-12
"""Prior of what cannot be."""


@compiled
def place_surface(
    position: FloatArray, rotation: FloatArray, link: IntArray, point: FloatArray, normal: FloatArray, at: FloatArray,
    outwards: FloatArray,
) -> None:  # fmt: skip
    """Write places and normals (N, 3) of the surface in the base frame."""
    for c in range(len(link)):
        k = link[c]
        for i in range(3):
            at[c, i], outwards[c, i] = position[k, i], 0.0
            for j in range(3):
                at[c, i] += rotation[k, i, j] * point[c, j]
                outwards[c, i] += rotation[k, i, j] * normal[c, j]


@compiled
def hidden_places(
    at: FloatArray, body: IntArray, capsule_body: IntArray, a: FloatArray, b: FloatArray, radius: FloatArray,
    hidden: BoolArray,
) -> None:  # fmt: skip
    """Write whether each place (N, 3) lies inside a capsule of another rigid body, so that nothing can touch it.

    The capsules are in the base frame, `capsule_body` (C,) says which rigid body each belongs to.
    """
    for c in range(len(at)):
        hidden[c] = False
        for k in range(len(radius)):
            if capsule_body[k] == body[c]:
                continue
            ux, uy, uz = b[k, 0] - a[k, 0], b[k, 1] - a[k, 1], b[k, 2] - a[k, 2]
            x, y, z = at[c, 0] - a[k, 0], at[c, 1] - a[k, 1], at[c, 2] - a[k, 2]
            length2 = ux * ux + uy * uy + uz * uz
            part = 0.0 if length2 == 0.0 else min(1.0, max(0.0, (x * ux + y * uy + z * uz) / length2))
            x, y, z = x - part * ux, y - part * uy, z - part * uz
            if x * x + y * y + z * z < radius[k] * radius[k]:
                hidden[c] = True
                break


class SeenNear(NamedTuple):
    """What is seen, as of `Obstacles`."""

    point: FloatArray
    """(K, 3) [m]."""
    body_distance: FloatArray
    """(K,) from the body [m]."""


class UnitCues(NamedTuple):
    """What units say of a touch, as of `Cues`."""

    gain: FloatArray
    """(L,) times a contact on each link is likelier."""
    link: IntArray
    """(T,) link of each place that is touched."""
    point: FloatArray
    """(T, 3) these places [m]."""
    sigma: FloatArray
    """(T,) standard deviation of each [m]."""


class PriorParams(NamedTuple):
    """What is taken of `LocalisationParams`."""

    seen_share: float
    seen_m: float
    near_m: float
    unit_share: float
    unit_m: float


@compiled
def prior_of_places(
    at: FloatArray, surface: SurfaceArrays, hidden: BoolArray, seen: SeenNear, cues: UnitCues, p: PriorParams,
    ln: FloatArray,
) -> None:  # fmt: skip
    """Write ln of the prior (N,) of a contact at each place, all places together 1.

    A mixture: contacts spread over the surface that is not hidden, times what units say of each link (`gain`); contacts
    by what is seen, which lie near the points (K, 3) that are, the nearer to the body (K,) [m] the likelier; contacts
    where a unit says that it is touched (T,), spread by its own error. What is not seen keeps its part. A touch whose
    place is known counts by that place, and not once more by the gain of its link: else what is left for the case that
    it is false would lie on that link too.
    """
    link, area, distance = surface.link, surface.area, seen.body_distance
    count, base, most = len(at), 0.0, 0.0
    weight, extra, told_kernels = np.zeros(count), np.empty(count), np.zeros(count)
    by_place = np.zeros(len(cues.gain), np.bool_)
    for k in range(len(cues.link)):
        if _kernel(at, link, area, hidden, cues.link[k], cues.point[k], max(cues.sigma[k], p.unit_m), extra):
            by_place[cues.link[k]] = True
            for c in range(count):
                told_kernels[c] += extra[c]
    for c in range(count):
        if not hidden[c]:
            weight[c] = area[c] if by_place[link[c]] else area[c] * cues.gain[link[c]]
            base += weight[c]
    for c in range(count):
        weight[c] /= max(base, 1e-300)
    kernels = np.zeros(count)
    for k in range(len(distance)):
        nearness = min(1.0, max(0.0, 1.0 - distance[k] / p.near_m))
        if nearness > 0.0 and _kernel(at, link, area, hidden, -1, seen.point[k], p.seen_m, extra):
            most = max(most, nearness)
            for c in range(count):
                kernels[c] += nearness * extra[c]
    _mix(weight, kernels, p.seen_share * most)
    _mix(weight, told_kernels, p.unit_share)
    for c in range(count):
        ln[c] = math.log(max(weight[c], _NEVER))


@compiled
def _kernel(
    at: FloatArray, link: IntArray, area: FloatArray, hidden: BoolArray, only: int, point: FloatArray, sigma: float,
    out: FloatArray,
) -> bool:  # fmt: skip
    """Write a normal distribution (N,) about a point (3,) over the places, of one link if `only` is not -1."""
    total = 0.0
    for c in range(len(at)):
        out[c] = 0.0
        if not hidden[c] and (only < 0 or link[c] == only):
            x, y, z = at[c, 0] - point[0], at[c, 1] - point[1], at[c, 2] - point[2]
            out[c] = area[c] * math.exp(-0.5 * (x * x + y * y + z * z) / (sigma * sigma))
            total += out[c]
    if not total > 1e-30:
        return False
    for c in range(len(at)):
        out[c] /= total
    return True


@compiled
def _mix(weight: FloatArray, kernels: FloatArray, share: float) -> None:
    """Mix a share of other distributions (N,), added up, into weights (N,) whose sum is 1."""
    total = kernels.sum()
    if total > 0.0:
        for c in range(len(weight)):
            weight[c] = (1.0 - share) * weight[c] + share * kernels[c] / total
