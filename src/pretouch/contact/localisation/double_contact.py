"""Two contacts at once: what the second one explains of what the first leaves.

With one contact fixed at a candidate, its force of zero mean and covariance V is part of the noise: the torques'
covariance becomes S + J^T V J, and the posterior of every candidate for the other contact follows as for one alone. In
turns each of the two is moved to where it explains most while the other is fixed; every turn only gains.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.localisation.single_contact import LEAST_N, Candidates, log_posterior
from pretouch.robot.model import jacobian_into
from pretouch.robot.vectors import dot
from pretouch.types import FloatArray, IntArray

_TURNS = 2
"""Times that one of both contacts is moved."""
_LEFT_OUT = 1e4
"""Variance of a torque that says nothing [Nm^2]."""


@compiled
def log_sum_exp(ln: FloatArray) -> float:
    """Return ln of the sum of exp(ln) (N,)."""
    most = ln.max()
    if not most > -1e300:  # all are -inf: their difference would be no number
        return most
    total = 0.0
    for value in ln:
        total += math.exp(value - most)
    return most + math.log(total)


@compiled
def exclude_body(ln: FloatArray, body: IntArray, excluded: int) -> None:
    """Take the candidates (N,) of one rigid body out of a distribution."""
    for c in range(len(ln)):
        if body[c] == excluded:
            ln[c] = -np.inf


@compiled
def covariance_with_contact(S: FloatArray, candidates: Candidates, c: int, size: float, out: FloatArray) -> None:
    """Write S + J^T V J (n, n): the covariance of the torques with a contact at candidate c, of a force `size` [N].

    V = mu^2 size^2 (1 - n n^T) + F^2 n n^T with the normal n, as in `single_contact`.
    """
    n, normal, p, kin = len(S), candidates.normal[c], candidates.p, candidates.kin
    J = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, candidates.moved_by[candidates.surface.link[c]], candidates.point[c], J)
    # J^T V J = a J^T J + (F^2 - a) (J^T n)(J^T n)^T with the variance a = (mu size)^2 across the normal
    across = (p.friction * max(size, LEAST_N)) ** 2
    for i in range(n):
        along_i = J[0, i] * normal[0] + J[1, i] * normal[1] + J[2, i] * normal[2]
        for j in range(n):
            along_j = J[0, j] * normal[0] + J[1, j] * normal[1] + J[2, j] * normal[2]
            both = J[0, i] * J[0, j] + J[1, i] * J[1, j] + J[2, i] * J[2, j]
            out[i, j] = S[i, j] + across * both + (p.force_n * p.force_n - across) * along_i * along_j


class Start(NamedTuple):
    """Where the search for two contacts starts."""

    candidate: int
    """Of the first one; if negative, the first one is looked for."""
    size: float
    """Force into the surface there [N]."""
    joint: int
    """Otherwise the joint behind which the first one is looked for."""


class Pair(NamedTuple):
    """Room for two contacts."""

    candidate: IntArray
    """(2,) of each."""
    ln: FloatArray
    """(2, N) ln of the posterior of each one's candidates, the other being fixed."""
    force: FloatArray
    """(2, N, 3) forces there [N]."""


@compiled
def find_pair(S: FloatArray, candidates: Candidates, start: Start, pair: Pair) -> float:
    """Move two contacts to where they explain most; return ln of the posterior of all pairs about the best one.

    `S` (n, n) is the covariance of the torques. -inf where no pair is found.
    """
    first, body, ln, force = candidates.surface.first, candidates.surface.body, pair.ln, pair.force
    C, total, known, top = S.copy(), -np.inf, -np.inf, 0.0
    held, size = start.candidate, start.size
    if held < 0:
        # Without the torques of the joints before `joint`, what is found behind it is what the outer contact alone has
        # to explain.
        for j in range(start.joint):
            C[j, j] += _LEFT_OUT
        if log_posterior(C, candidates, ln[0], force[0]) < 0.0:
            return -np.inf
        ln[0, : first[min(start.joint, len(first) - 1)]] = -np.inf
        held = int(np.argmax(ln[0]))
        size = -dot(force[0, held], candidates.normal[held])
    for turn in range(_TURNS):
        k = 1 - turn % 2
        covariance_with_contact(S, candidates, held, size, C)
        if log_posterior(C, candidates, ln[k], force[k]) < 0.0:
            return -np.inf
        # two contacts on one rigid body add up to one wrench, which tells little of two from one
        exclude_body(ln[k], body, body[held])
        moved = int(np.argmax(ln[k]))
        # about the best pair both contacts are taken to be independent: p(a, b) = p(a | b) p(b | a) / p(best | best)
        total = known - top + log_sum_exp(ln[k]) + candidates.log_prior[held]
        pair.candidate[k], pair.candidate[1 - k] = moved, held
        known, top = log_sum_exp(ln[k]), ln[k, moved]
        held, size = moved, -dot(force[k, moved], candidates.normal[moved])
    return total
