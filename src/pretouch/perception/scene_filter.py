"""Which returns come from the arm itself or from declared fixtures: ray casting against the model."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pretouch.perception.vectors import dot, placed, rotated
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics
from pretouch.sensing.unit import CONE_ANGLE, cone_rays
from pretouch.types import FloatArray, IntArray

_RAYS = cone_rays(2)

_TOUCHING = 1e-9
"""Distance to a capsule's side below which rounding may put the start of a ray on either side of it [m]."""


@dataclass(frozen=True)
class Fixtures:
    """What is known to stand around the arm: planes, and capsules on link 0, the world."""

    planes: FloatArray
    """(P, 4) rows (normal, offset): normal . p = offset, the normal pointing into free space."""
    capsules: Capsules


def no_fixtures() -> Fixtures:
    """Return an empty surrounding."""
    return Fixtures(np.zeros((0, 4)), Capsules(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)))


def expected_range(
    kin: Kinematics,
    position: FloatArray,
    rotation: FloatArray,
    own_link: IntArray,
    body: Capsules,
    fixtures: Fixtures,
) -> FloatArray:
    """Distance (K,) [m] at which each sensor would see the arm or a fixture, infinite where it would not.

    The least over rays that fill the sensor's cone. A unit does not see the link it sits on.

    Args:
        kin: posture.
        position: (K, 3) sensor origins, base frame [m].
        rotation: (K, 3, 3) sensor orientations, z outwards.
        own_link: (K,) link each sensor sits on.
        body: the arm as capsules, base included.
        fixtures: what stands around it.
    """
    near = np.full(len(own_link), np.inf)
    for part in (body, fixtures.capsules):
        a, b = placed(part, kin)
        _see_capsules(near, position, rotation, own_link, part.link, a, b, part.radius, _RAYS)
    _see_planes(near, position, rotation, fixtures.planes, _RAYS)
    return near


@njit(cache=True)
def _see_capsules(
    near: FloatArray, position: FloatArray, rotation: FloatArray, own: IntArray, link: IntArray, a: FloatArray,
    b: FloatArray, radius: FloatArray, rays: FloatArray,
) -> None:  # fmt: skip
    beam = np.empty(3)
    for k in range(len(own)):
        p, R = position[k], rotation[k]
        beam[:] = R[:, 2]
        for c in range(len(link)):
            if link[c] != own[k] and _may_meet(p, beam, a[c], b[c], radius[c]):
                for i in range(len(rays)):
                    near[k] = min(near[k], ray_capsule(p, rotated(R, rays[i]), a[c], b[c], radius[c]))


@njit(cache=True)
def _see_planes(
    near: FloatArray, position: FloatArray, rotation: FloatArray, planes: FloatArray, rays: FloatArray
) -> None:
    for k in range(len(near)):
        for m in range(len(planes)):
            height = dot(planes[m], position[k]) - planes[m, 3]
            for i in range(len(rays)):
                rate = dot(planes[m], rotated(rotation[k], rays[i]))
                if rate < 0 and height >= 0:
                    near[k] = min(near[k], -height / rate)


@njit(cache=True)
def _may_meet(p: FloatArray, beam: FloatArray, a: FloatArray, b: FloatArray, radius: float) -> bool:
    """Whether a sensor's cone can meet the sphere round a capsule."""
    to, axis = (a + b) / 2 - p, b - a
    reach = np.sqrt(dot(axis, axis)) / 2 + radius
    distance = np.sqrt(dot(to, to))
    if distance <= reach:
        return True
    off_axis = np.arccos(min(1.0, max(-1.0, dot(to, beam) / distance)))
    return bool(off_axis <= CONE_ANGLE / 2 + np.arcsin(reach / distance))


@njit(cache=True)
def ray_capsule(p: FloatArray, ray: FloatArray, a: FloatArray, b: FloatArray, radius: float) -> float:
    """Distance [m] along a unit ray (3,) from p (3,) to a capsule, 0 from inside, infinite for a miss."""
    axis, offset = b - a, p - a
    aa, ar, ao = dot(axis, axis), dot(axis, ray), dot(axis, offset)
    rest, oo = dot(ray, offset), dot(offset, offset)
    along = 0.0 if aa == 0 else min(1.0, max(0.0, ao / aa))
    gap = offset - along * axis
    if dot(gap, gap) <= radius * radius:
        return 0.0
    best = np.inf
    quad = aa - ar * ar
    if quad > 1e-12 * aa:
        half_b = aa * rest - ao * ar
        free = aa * oo - ao * ao - radius * radius * aa
        disc = half_b * half_b - quad * free
        if disc >= 0:
            t = (-half_b - np.sqrt(disc)) / quad
            y = ao + t * ar
            if t >= -_TOUCHING and 0 < y < aa:
                best = max(t, 0.0)
    for end in (a, b):
        to = p - end
        half_b, free = dot(ray, to), dot(to, to) - radius * radius
        disc = half_b * half_b - free
        if disc >= 0:
            t = -half_b - np.sqrt(disc)
            if 0 <= t < best:
                best = t
    return best
