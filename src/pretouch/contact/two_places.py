"""Two contacts at once: what the second one explains of what the first leaves.

With a contact held at one place, its force of zero mean and of the spread V in the directions u is part of the noise:
the torques' covariance becomes S + J^T V J, and the evidence of each place for the other contact follows as for one
alone. In turns each of the two is moved to where it explains most, the other one being held; every turn only gains.

One begins behind some joint: the torques of the joints before it are left out, so that what is found there is what the
outer contact alone has to explain.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import compiled
from pretouch.contact.one_place import LEAST_N, ForcePrior, Whitened, evidence_of_places
from pretouch.groups import SurfaceArrays
from pretouch.robot.model import Kinematics
from pretouch.types import BoolArray, FloatArray, IntArray

_LEFT_OUT = 1e4
"""Variance of a torque that says nothing [Nm^2]."""


@compiled
def total_of(ln: FloatArray) -> float:
    """Return ln of the sum of exp(ln) (N,)."""
    most = ln.max()
    if not most > -1e300:
        return most
    total = 0.0
    for value in ln:
        total += math.exp(value - most)
    return most + math.log(total)


class Held(NamedTuple):
    """A contact held at a place."""

    moved: BoolArray
    """(n,) joints that move it."""
    at: FloatArray
    """(3,) [m]."""
    outwards: FloatArray
    """(3,) normal there."""
    size: float
    """Force into the surface [N]."""


@compiled
def held(C: FloatArray, kin: Kinematics, contact: Held, p: ForcePrior, out: FloatArray) -> None:
    """Write C + J^T V J (n, n) for a contact held at a place."""
    anchor, axis = kin.anchor, kin.axis
    moved, at, outwards, size = contact
    n, largest = len(C), p.largest
    J = np.zeros((n, 3))
    for j in range(n):
        if moved[j]:
            x, y, z = at[0] - anchor[j, 0], at[1] - anchor[j, 1], at[2] - anchor[j, 2]
            J[j, 0] = axis[j, 1] * z - axis[j, 2] * y
            J[j, 1] = axis[j, 2] * x - axis[j, 0] * z
            J[j, 2] = axis[j, 0] * y - axis[j, 1] * x
    across = (p.mu * max(size, LEAST_N)) ** 2
    for i in range(n):
        along_i = J[i, 0] * outwards[0] + J[i, 1] * outwards[1] + J[i, 2] * outwards[2]
        for j in range(n):
            along_j = J[j, 0] * outwards[0] + J[j, 1] * outwards[1] + J[j, 2] * outwards[2]
            dot = J[i, 0] * J[j, 0] + J[i, 1] * J[j, 1] + J[i, 2] * J[j, 2]
            out[i, j] = C[i, j] + across * dot + (largest * largest - across) * along_i * along_j


class Places(NamedTuple):
    """The places that a contact may be at, and the torques it is to explain."""

    mean: FloatArray
    """(n,) torques [Nm]."""
    kin: Kinematics
    moved_by: BoolArray
    """(L, n) whether a joint moves a link."""
    surface: SurfaceArrays
    """N places."""
    at: FloatArray
    """(N, 3) where they are [m]."""
    outwards: FloatArray
    """(N, 3) normals there."""
    prior: FloatArray
    """(N,) ln of the prior of a contact."""
    force: ForcePrior


@compiled
def evidence_under(C: FloatArray, places: Places, ln: FloatArray, force: FloatArray) -> float:
    """Write ln of prior and evidence (N,) of each place under a covariance C (n, n), comparable between covariances.

    Returns what `evidence_of_places` does; -1 where the covariance is none.
    """
    n = len(C)
    L, y = np.zeros((n, n)), np.empty(n)
    if not factor(C, L):
        return -1.0
    square, volume = forward(L, places.mean, y), 0.0
    for j in range(n):
        volume += math.log(L[j, j])
    torques = Whitened(L, y, square)
    left = evidence_of_places(places.kin, places.moved_by, places.surface, torques, places.force, ln, force)
    for c in range(len(ln)):
        ln[c] += places.prior[c] - volume
    return left


class Beginning(NamedTuple):
    """Where the search for two contacts begins."""

    place: int
    """At this one, if it is not negative."""
    size: float
    """Force into the surface there [N]."""
    behind: int
    """Else behind this joint."""
    turns: int
    """How often one of both is moved."""


class Pair(NamedTuple):
    """Room for two contacts."""

    place: IntArray
    """(2,)."""
    ln: FloatArray
    """(2, N) ln of the evidence of each one's place, the other being held."""
    force: FloatArray
    """(2, N, 3) forces there [N]."""


@compiled
def best_pair(C: FloatArray, places: Places, begin: Beginning, pair: Pair) -> float:
    """Move two contacts to where they explain most; return ln of the evidence of all pairs about the best one.

    -inf where there is none.
    """
    link, first, body = places.surface.link, places.surface.first, places.surface.body
    at, outwards, ln, force = places.at, places.outwards, pair.ln, pair.force
    count = len(link)
    D, total, top = C.copy(), -np.inf, 0.0
    place, size = begin.place, begin.size
    if place < 0:
        for j in range(begin.behind):
            D[j, j] += _LEFT_OUT
        if evidence_under(D, places, ln[0], force[0]) < 0.0:
            return -np.inf
        for c in range(count):
            if c < first[min(begin.behind, len(first) - 1)]:
                ln[0, c] = -np.inf
        place = int(np.argmax(ln[0]))
        size = -_along(force[0, place], outwards[place])
    known = -np.inf
    for turn in range(begin.turns):
        k = 1 - turn % 2
        contact = Held(places.moved_by[link[place]], at[place], outwards[place], size)
        held(C, places.kin, contact, places.force, D)
        if evidence_under(D, places, ln[k], force[k]) < 0.0:
            return -np.inf
        for c in range(count):
            if body[c] == body[place]:
                ln[k, c] = -np.inf
        other = int(np.argmax(ln[k]))
        # about the best pair the two places are taken to be independent
        total = known - top + total_of(ln[k]) if turn else -np.inf
        if turn == begin.turns - 1:
            total += places.prior[place]
        pair.place[k], pair.place[1 - k] = other, place
        known, top = total_of(ln[k]), ln[k, other]
        place, size = other, -_along(force[k, other], outwards[other])
    return total


@compiled
def _along(a: FloatArray, b: FloatArray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
