"""Where the arm is touched: from the torques that stand out of free motion, with what the skin sees as a prior.

Places spread over the surface (`robot.surface`) are weighed by how well a force there that pushes inwards explains the
torques (`one_place`), times how likely a contact is there beforehand (`where_prior`); two contacts at once by what both
explain together (`two_places`). The state is the contact so far: what earlier steps said of each place, and the pair
that was looked for last, so that a search goes on from step to step at a bounded cost. In free motion nothing runs.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import ByName, compiled, entry
from pretouch.contact.cues import Cues
from pretouch.contact.one_place import ForcePrior, covariance_of_mean
from pretouch.contact.sequential import LENGTHS
from pretouch.contact.two_places import Beginning, Pair, Places, best_pair, evidence_under, total_of
from pretouch.contact.where_prior import (
    PriorParams,
    SeenNear,
    UnitCues,
    hidden_places,
    place_surface,
    prior_of_places,
)
from pretouch.contact.where_summary import ContactArrays, exchange, leave_out, summarise
from pretouch.groups import CapsuleArrays, SurfaceArrays
from pretouch.params import LocalisationParams
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.vectors import placed_capsules
from pretouch.types import NOT_TOUCHED, BoolArray, FloatArray, IntArray, Obstacles, Touched
from pretouch.values import value

_LENGTHS = np.array(LENGTHS)
_OVER = 0.5
"""Evidence below which a contact is over: as soon as it is no longer more likely than not, in nats."""
_LEFT = 6.0
"""What the best single contact has to leave unexplained before two are looked for [1]: less hardly pays for two."""
_TURNS = 2
"""Times that one of two contacts is moved in a step."""


@value
class WhereState:
    """The contact so far."""

    ln: FloatArray
    """(N,) ln of the evidence at each place, averaged over the steps of this contact; (0,) while nothing is felt."""
    weight: float
    """How much that average stands on."""
    pair: IntArray
    """(2,) places of the two contacts that explain most so far, -1 for none."""
    size: float
    """Force into the surface at the first of them [N]."""
    two: bool
    """Whether they are believed."""
    steps: int
    """Inferences since the contact began."""
    since: float
    """Time since the last one [s]."""
    touched: Touched
    """What it said."""


def where_init() -> WhereState:
    """Return the state while nothing is felt."""
    return _NOTHING


_NOTHING = WhereState(np.zeros(0), 0.0, np.full(2, -1, np.int64), 0.0, False, 0, 0.0, NOT_TOUCHED)


def locate(
    state: WhereState, model: RobotModel, kin: Kinematics, means: FloatArray, samples: int, spread: FloatArray,
    doubt: FloatArray, evidence: float, qd: FloatArray, obstacles: Obstacles, cues: Cues, period: float,
    p: LocalisationParams,
) -> tuple[Touched, WhereState]:  # fmt: skip
    """Say where the arm is touched in one step, if it is.

    Args:
        state: memory.
        model: the arm.
        kin: its posture.
        means: (6, n) means of the newest residuals, of each of `sequential.LENGTHS` [Nm].
        samples: how many samples there are.
        spread: (n, n) of one of them, with the doubt on its diagonal [Nm^2].
        doubt: (n,) variance of the error of their mean, which does not average out [Nm^2].
        evidence: of a contact, one from 1 on.
        qd: (n,) commanded joint velocities [rad/s].
        obstacles: what is near.
        cues: what units say of a touch.
        period: of control [s].
        p: parameters.
    """
    if evidence < (1.0 if state.steps == 0 else _OVER):
        return NOT_TOUCHED, _NOTHING
    since = state.since + period
    if state.steps and since < p.update_s * (1.0 - 1e-9):
        return state.touched, WhereState(
            state.ln, state.weight, state.pair, state.size, state.two, state.steps, since, state.touched
        )  # fmt: skip
    s = model.surface
    ln = np.zeros(len(s)) if state.steps == 0 else state.ln.copy()
    pair, link = state.pair.copy(), np.empty(2, np.int64)
    point, force, sigma, probability = np.empty((2, 3)), np.empty((2, 3)), np.empty(2), np.empty(2)
    weight, size, found = _infer(
        kin, _Body(model.moved_by, model.rigid, s.arrays, model.capsules.arrays),
        _Residuals(means, _steady(samples, qd, period, p), spread, doubt, min(1.0, period / p.independent_s)),
        obstacles, cues, p,
        _SoFar(
            ln, pair, state.steps, state.weight, state.size, state.two, -math.log(p.two_odds),
            math.exp(-max(since, period) / p.memory_s) if p.memory_s > 0.0 else 0.0,
        ),
        ContactArrays(link, point, force, sigma, probability),
    )  # fmt: skip
    if not found:
        return NOT_TOUCHED, _NOTHING
    touched = Touched(link[:found], point[:found], force[:found], sigma[:found], probability[:found])
    return touched, WhereState(ln, weight, pair, size, found == 2, state.steps + 1, 0.0, touched)


def clearest_mean(
    means: FloatArray, samples: int, spread: FloatArray, doubt: FloatArray, period: float, p: LocalisationParams
) -> tuple[FloatArray, FloatArray] | None:
    """Return the mean (n,) of the residuals that stands out most [Nm], and its covariance (n, n) in free motion [Nm^2].

    Of `means`, `samples`, `spread` and `doubt` of `locate`; None where the covariance is none.
    """
    covariance = np.empty_like(spread)
    window, _ = _clearest(means, samples, spread, doubt, min(1.0, period / p.independent_s), 0.0, covariance)
    return None if window < 0 else (means[window], covariance)


def _steady(samples: int, qd: FloatArray, period: float, p: LocalisationParams) -> int:
    """Return how many samples there are since half of whose time the posture has changed by `relative` [rad] at most.

    By so much a force's torques change in part, if a joint turns so far.
    """
    fastest = float(np.abs(qd).max())
    return samples if fastest * samples * period <= 2.0 * p.relative else int(2.0 * p.relative / (fastest * period)) + 1


class _Body(NamedTuple):
    """The arm, as a contact finds it."""

    moved_by: BoolArray
    """(L, n) whether a joint moves a link."""
    rigid: IntArray
    """(L,) rigid body of each link."""
    surface: SurfaceArrays
    capsules: CapsuleArrays


class _Residuals(NamedTuple):
    """Torques that free motion does not explain, as `locate` is given them."""

    means: FloatArray
    samples: int
    spread: FloatArray
    doubt: FloatArray
    independent: float
    """Part of a sample that says something new."""


class _Params(NamedTuple):
    """What is taken of `LocalisationParams`."""

    friction: float
    force_n: float
    relative: float
    tails: float
    seen_share: float
    seen_m: float
    near_m: float
    unit_share: float
    unit_m: float


class _SoFar(NamedTuple):
    """The contact so far, as of `WhereState`, and how much more two contacts have to explain."""

    average: FloatArray
    pair: IntArray
    steps: int
    weight: float
    size: float
    two: bool
    margin: float
    """Evidence by which two contacts have to be likelier than one [nats]."""
    keep: float
    """Part of the average that is kept."""


@entry
def _infer(
    kin: Kinematics, body: _Body, felt: _Residuals, seen: ByName[SeenNear], cues: ByName[UnitCues],
    p: ByName[_Params], so_far: _SoFar, contacts: ContactArrays,
) -> tuple[float, float, int]:  # fmt: skip
    """Write average, pair and contacts; return the weight of the average, a force of the pair, and how many."""
    surface, capsules, rigid, average, pair, two = (
        body.surface, body.capsules, body.rigid, so_far.average, so_far.pair, so_far.two,
    )  # fmt: skip
    n, count = len(kin.anchor), len(surface.link)
    at, outwards, hidden = np.empty((count, 3)), np.empty((count, 3)), np.empty(count, np.bool_)
    place_surface(kin.position, kin.rotation, surface.link, surface.point, surface.normal, at, outwards)
    placed = placed_capsules(capsules, kin)
    hidden_places(at, surface.body, rigid[capsules.link], placed.a, placed.b, placed.radius, hidden)
    prior = np.empty(count)
    shares = PriorParams(p.seen_share, p.seen_m, p.near_m, p.unit_share, p.unit_m)
    prior_of_places(at, surface, hidden, seen, cues, shares, prior)

    # one contact
    C = np.empty((n, n))
    window, square = _clearest(felt.means, felt.samples, felt.spread, felt.doubt, felt.independent, p.relative, C)
    if window < 0:
        return 0.0, 0.0, 0
    ln, there = np.empty(count), np.empty((count, 3))
    force = ForcePrior(p.friction, p.force_n, p.tails)
    places = Places(felt.means[window], kin, body.moved_by, surface, at, outwards, prior, force)
    left = evidence_under(C, places, ln, there)
    one = total_of(ln)
    kept = so_far.keep * so_far.weight
    total = kept + square
    for c in range(count):
        average[c] = (kept * average[c] + square * (ln[c] - prior[c])) / total

    # two contacts
    size = so_far.size
    if left > _LEFT or two:
        found = Pair(np.empty(2, np.int64), np.empty((2, count)), np.empty((2, count, 3)))
        # a pair that is believed is followed; else it is improved, and another one tried, in turns
        again = pair[0] >= 0 and (two or so_far.steps % 2 == 1)
        behind = 2 + so_far.steps // 2 % max(1, n - 3)
        best = best_pair(C, places, Beginning(pair[0] if again else -1, size, behind, _TURNS), found)
        if best > -np.inf and (again or pair[0] < 0 or best > one):
            pair[:] = found.place
            size = 0.0
            for i in range(3):
                size -= found.force[0, pair[0], i] * outwards[pair[0], i]
        if best - one > (0.0 if two else so_far.margin):
            _summarise_two(found, places, rigid, contacts)
            return total, size, 2
    for c in range(count):
        ln[c] = average[c] + prior[c]
    summarise(ln, at, outwards, surface, there, contacts, 0)
    return total, size, 1


@compiled
def _summarise_two(found: Pair, places: Places, rigid: IntArray, contacts: ContactArrays) -> None:
    """Write both contacts, on two rigid bodies, the surer one first."""
    at, outwards, surface, probability = places.at, places.outwards, places.surface, contacts.probability
    for k in range(2):
        summarise(found.ln[k], at, outwards, surface, found.force[k], contacts, k)
    if rigid[contacts.link[0]] == rigid[contacts.link[1]]:
        # each place left out the other's own body only: the less sure contact is on the likeliest other one
        k = 0 if probability[0] < probability[1] else 1
        leave_out(found.ln[k], surface.body, rigid[contacts.link[k]])
        summarise(found.ln[k], at, outwards, surface, found.force[k], contacts, k)
    if probability[1] > probability[0]:
        exchange(contacts)


@compiled
def _clearest(
    means: FloatArray, samples: int, spread: FloatArray, doubt: FloatArray, independent: float, relative: float,
    C: FloatArray,
) -> tuple[int, float]:  # fmt: skip
    """Find the window whose mean stands out most; write its covariance (n, n), return it and z^T S^-1 z; -1: none."""
    n = len(doubt)
    L, y, best, window = np.zeros((n, n)), np.empty(n), 0.0, -1
    for k in range(len(_LENGTHS)):
        if _LENGTHS[k] > samples:
            break
        covariance_of_mean(means[k], spread, doubt, max(1.0, independent * _LENGTHS[k]), 0.0, C)
        if factor(C, L):
            square = forward(L, means[k], y)
            if square > best:
                best, window = square, k
    if window >= 0:
        covariance_of_mean(
            means[window], spread, doubt, max(1.0, independent * _LENGTHS[window]), relative, C
        )  # fmt: skip
    return window, best
