"""Candidate points of contact on the arm's surface, and how likely each is before the torques are looked at."""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import kernel
from pretouch.contact.touch_cue import Cues
from pretouch.robot.body import Capsules, Surface
from pretouch.robot.kinematics import Kinematics
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles

_NEVER = 1e-12
"""Prior of what cannot be: its logarithm stays finite."""


@kernel
def candidate_poses(kin: Kinematics, surface: Surface, point: FloatArray, normal: FloatArray) -> None:
    """Write points [m] and outward normals (N, 3) of the surface in the base frame."""
    position, rotation, link = kin.position, kin.rotation, surface.link
    for c in range(len(link)):
        k = link[c]
        for i in range(3):
            point[c, i], normal[c, i] = position[k, i], 0.0
            for j in range(3):
                point[c, i] += rotation[k, i, j] * surface.point[c, j]
                normal[c, i] += rotation[k, i, j] * surface.normal[c, j]


@kernel
def hidden_candidates(
    point: FloatArray, body: IntArray, capsules: Capsules, capsule_body: IntArray, hidden: BoolArray
) -> None:
    """Write whether each point (N, 3) lies inside a capsule of another rigid body, so that nothing can touch it.

    The capsules are in the base frame; `body` (N,) and `capsule_body` (C,) are the rigid bodies of points and capsules.
    """
    a, b, radius = capsules.a, capsules.b, capsules.radius
    for c in range(len(point)):
        hidden[c] = False
        for k in range(len(radius)):
            if capsule_body[k] == body[c]:
                continue
            ux, uy, uz = b[k, 0] - a[k, 0], b[k, 1] - a[k, 1], b[k, 2] - a[k, 2]
            x, y, z = point[c, 0] - a[k, 0], point[c, 1] - a[k, 1], point[c, 2] - a[k, 2]
            # distance to the axis: r - t u with t = r.u / u.u clipped to the segment, 0 for a ball
            length2 = ux * ux + uy * uy + uz * uz
            t = 0.0 if length2 == 0.0 else min(1.0, max(0.0, (x * ux + y * uy + z * uz) / length2))
            x, y, z = x - t * ux, y - t * uy, z - t * uz
            if x * x + y * y + z * z < radius[k] * radius[k]:
                hidden[c] = True
                break


class LocalisationNumbers(NamedTuple):
    """What compiled code takes of `LocalisationParams`."""

    friction: float
    force_n: float
    relative: float
    tails: float
    seen_share: float
    seen_m: float
    near_m: float
    unit_share: float
    unit_m: float


@kernel
def log_prior(
    point: FloatArray, surface: Surface, hidden: BoolArray, seen: Obstacles, cues: Cues,
    p: LocalisationNumbers, ln: FloatArray,
) -> None:  # fmt: skip
    """Write ln of the prior (N,) of a contact at each candidate; all candidates together have probability 1.

    A mixture of three: contacts spread over the surface that is not hidden, times the units' gain of each link;
    contacts by what is seen, normally distributed about the points that are, the nearer to the body the likelier;
    contacts at touched units, spread by their own error. What no unit sees keeps its part.
    """
    link, area, distance = surface.link, surface.area, seen.body_distance
    count, base, nearest = len(point), 0.0, 0.0
    weight, kernel, touched = np.zeros(count), np.empty(count), np.zeros(count)
    located = np.zeros(len(cues.gain), np.bool_)
    # touched units, each with its own error; candidates lie too far apart for less than `unit_m`
    for k in range(len(cues.link)):
        sigma = max(cues.sigma[k], p.unit_m)
        if _normal_kernel(point, link, area, hidden, cues.link[k], cues.point[k], sigma, kernel):
            located[cues.link[k]] = True
            for c in range(count):
                touched[c] += kernel[c]
    # A touch whose point is known counts by that point, and not once more by the gain of its link: the part that is
    # left for a false touch would lie on that link too.
    for c in range(count):
        if not hidden[c]:
            weight[c] = area[c] if located[link[c]] else area[c] * cues.gain[link[c]]
            base += weight[c]
    for c in range(count):
        weight[c] /= max(base, 1e-300)
    # What is seen: a unit sees the side of what touches, so its points lie beside the contact by about `seen_m`. The
    # nearest one says how much of the probability goes there, and all share it by their nearness.
    by_seen = np.zeros(count)
    for k in range(len(distance)):
        nearness = min(1.0, max(0.0, 1.0 - distance[k] / p.near_m))
        if nearness > 0.0 and _normal_kernel(point, link, area, hidden, -1, seen.point[k], p.seen_m, kernel):
            nearest = max(nearest, nearness)
            for c in range(count):
                by_seen[c] += nearness * kernel[c]
    # touched units last: their share is of all, what is seen included
    _mix(weight, by_seen, p.seen_share * nearest)
    _mix(weight, touched, p.unit_share)
    for c in range(count):
        ln[c] = math.log(max(weight[c], _NEVER))


@kernel
def _normal_kernel(
    point: FloatArray, link: IntArray, area: FloatArray, hidden: BoolArray, only: int, mean: FloatArray, sigma: float,
    out: FloatArray,
) -> bool:  # fmt: skip
    """Write a normal distribution (N,) about a point (3,), over the candidates of one link if `only` is not -1.

    Returns False where no candidate is near enough for a sum that can be divided by.
    """
    total = 0.0
    for c in range(len(point)):
        out[c] = 0.0
        if not hidden[c] and (only < 0 or link[c] == only):
            x, y, z = point[c, 0] - mean[0], point[c, 1] - mean[1], point[c, 2] - mean[2]
            # times the area that a candidate stands for: a density on the surface, however it is sampled
            out[c] = area[c] * math.exp(-0.5 * (x * x + y * y + z * z) / (sigma * sigma))
            total += out[c]
    if not total > 1e-30:
        return False
    for c in range(len(point)):
        out[c] /= total
    return True


@kernel
def _mix(weight: FloatArray, kernels: FloatArray, share: float) -> None:
    """Mix a share of other distributions (N,), added up, into weights (N,) whose sum is 1."""
    total = sum(kernels)
    if total > 0.0:
        for c in range(len(weight)):
            weight[c] = (1.0 - share) * weight[c] + share * kernels[c] / total
