"""Two contacts at once: what the second one explains of what the first leaves.

With a contact held at one place, its force of zero mean and of the spread V in the directions u is part of the noise:
the torques' covariance becomes S + J^T V J, and the evidence of each place for the other contact follows as for one
alone. In turns each of the two is moved to where it explains most, the other one being held; every turn only gains.

One begins behind some joint: the torques of the joints before it are left out, so that what is found there is what the
outer contact alone has to explain.
"""

import math

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import compiled
from pretouch.contact.one_place import LEAST_N, evidence_of_places
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


@compiled
def held(
    C: FloatArray, anchor: FloatArray, axis: FloatArray, moved: BoolArray, at: FloatArray, outwards: FloatArray,
    size: float, mu: float, largest: float, out: FloatArray,
) -> None:  # fmt: skip
    """Write C + J^T V J (n, n) for a contact held at a place, with a force of so many newtons into the surface."""
    n = len(C)
    J = np.zeros((n, 3))
    for j in range(n):
        if moved[j]:
            x, y, z = at[0] - anchor[j, 0], at[1] - anchor[j, 1], at[2] - anchor[j, 2]
            J[j, 0] = axis[j, 1] * z - axis[j, 2] * y
            J[j, 1] = axis[j, 2] * x - axis[j, 0] * z
            J[j, 2] = axis[j, 0] * y - axis[j, 1] * x
    across = (mu * max(size, LEAST_N)) ** 2
    for i in range(n):
        along_i = J[i, 0] * outwards[0] + J[i, 1] * outwards[1] + J[i, 2] * outwards[2]
        for j in range(n):
            along_j = J[j, 0] * outwards[0] + J[j, 1] * outwards[1] + J[j, 2] * outwards[2]
            dot = J[i, 0] * J[j, 0] + J[i, 1] * J[j, 1] + J[i, 2] * J[j, 2]
            out[i, j] = C[i, j] + across * dot + (largest * largest - across) * along_i * along_j


@compiled
def evidence_under(
    C: FloatArray, mean: FloatArray, anchor: FloatArray, axis: FloatArray, position: FloatArray, rotation: FloatArray,
    moved_by: BoolArray, link: IntArray, point: FloatArray, normal: FloatArray, first: IntArray, prior: FloatArray,
    mu: float, largest: float, tails: float, ln: FloatArray, force: FloatArray,
) -> float:  # fmt: skip
    """Write ln of prior and evidence (N,) of each place under a covariance C (n, n), comparable between covariances.

    Returns what `evidence_of_places` does; -1 where the covariance is none.
    """
    n = len(C)
    L, y = np.zeros((n, n)), np.empty(n)
    if not factor(C, L):
        return -1.0
    square, volume = forward(L, mean, y), 0.0
    for j in range(n):
        volume += math.log(L[j, j])
    left = evidence_of_places(
        anchor, axis, position, rotation, moved_by, link, point, normal, first, L, y, square, mu, largest, tails, ln,
        force,
    )  # fmt: skip
    for c in range(len(ln)):
        ln[c] += prior[c] - volume
    return left


@compiled
def best_pair(
    C: FloatArray, mean: FloatArray, anchor: FloatArray, axis: FloatArray, position: FloatArray, rotation: FloatArray,
    moved_by: BoolArray, link: IntArray, point: FloatArray, normal: FloatArray, first: IntArray, body: IntArray,
    prior: FloatArray, at: FloatArray, outwards: FloatArray, mu: float, largest: float, tails: float,
    begin: int, begin_size: float, behind: int, turns: int,
    pair: IntArray, ln: FloatArray, force: FloatArray,
) -> float:  # fmt: skip
    """Move two contacts to where they explain most; return ln of the evidence of all pairs about the best one.

    The search begins with a contact at the place `begin`, if it is not negative, or behind the joint `behind`. `pair`
    (2,) becomes the two places; `ln` (2, N) is that of each one's place, the other being held, and `force` (2, N, 3)
    the forces there. -inf where there is none.
    """
    count = len(link)
    D, total, top = C.copy(), -np.inf, 0.0
    place, size = begin, begin_size
    if place < 0:
        for j in range(behind):
            D[j, j] += _LEFT_OUT
        if evidence_under(
            D, mean, anchor, axis, position, rotation, moved_by, link, point, normal, first, prior, mu, largest, tails,
            ln[0], force[0],
        ) < 0.0:  # fmt: skip
            return -np.inf
        for c in range(count):
            if c < first[min(behind, len(first) - 1)]:
                ln[0, c] = -np.inf
        place = int(np.argmax(ln[0]))
        size = -_along(force[0, place], outwards[place])
    known = -np.inf
    for turn in range(turns):
        k = 1 - turn % 2
        held(C, anchor, axis, moved_by[link[place]], at[place], outwards[place], size, mu, largest, D)
        if evidence_under(
            D, mean, anchor, axis, position, rotation, moved_by, link, point, normal, first, prior, mu, largest, tails,
            ln[k], force[k],
        ) < 0.0:  # fmt: skip
            return -np.inf
        for c in range(count):
            if body[c] == body[place]:
                ln[k, c] = -np.inf
        other = int(np.argmax(ln[k]))
        # about the best pair the two places are taken to be independent
        total = known - top + total_of(ln[k]) if turn else -np.inf
        if turn == turns - 1:
            total += prior[place]
        pair[k], pair[1 - k] = other, place
        known, top = total_of(ln[k]), ln[k, other]
        place, size = other, -_along(force[k, other], outwards[other])
    return total


@compiled
def _along(a: FloatArray, b: FloatArray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
