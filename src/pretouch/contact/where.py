"""Where the arm is touched: from the torques that stand out of free motion, with what the skin sees as a prior.

Places spread over the surface (`robot.surface`) are weighed by how well a force there that pushes inwards explains the
torques (`one_place`), times how likely a contact is there beforehand (`where_prior`); two contacts at once by what both
explain together (`two_places`). The state is the contact so far: what earlier steps said of each place, and the pair
that was looked for last, so that a search goes on from step to step at a bounded cost. In free motion nothing runs.
"""

import math

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import compiled
from pretouch.contact.cues import Cues
from pretouch.contact.one_place import covariance_of_mean
from pretouch.contact.sequential import LENGTHS
from pretouch.contact.two_places import best_pair, evidence_under, total_of
from pretouch.contact.where_prior import hidden_places, place_surface, prior_of_places
from pretouch.contact.where_summary import exchange, leave_out, summarise
from pretouch.params import LocalisationParams
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.vectors import placed_ends
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
    s, body, o = model.surface, model.capsules, obstacles
    ln = np.zeros(len(s)) if state.steps == 0 else state.ln.copy()
    pair, link = state.pair.copy(), np.empty(2, np.int64)
    point, force, sigma, probability = np.empty((2, 3)), np.empty((2, 3)), np.empty(2), np.empty(2)
    weight, size, found = _infer(
        kin.anchor, kin.axis, kin.position, kin.rotation, model.moved_by,
        s.link, s.point, s.normal, s.area, s.body, s.first,
        body.link, body.a, body.b, body.radius, model.rigid,
        means, _steady(samples, qd, period, p), spread, doubt, min(1.0, period / p.independent_s),
        o.point, o.body_distance, cues.gain, cues.link, cues.point, cues.sigma,
        p.friction, p.force_n, p.relative, p.tails, p.seen_share, p.seen_m, p.near_m, p.unit_share, p.unit_m,
        -math.log(p.two_odds), math.exp(-max(since, period) / p.memory_s) if p.memory_s > 0.0 else 0.0,
        state.steps, state.weight, state.size, state.two,
        ln, pair, link, point, force, sigma, probability,
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


@compiled
def _infer(
    anchor: FloatArray, axis: FloatArray, position: FloatArray, rotation: FloatArray, moved_by: BoolArray,
    link: IntArray, place: FloatArray, normal: FloatArray, area: FloatArray, body: IntArray, first: IntArray,
    capsule: IntArray, a: FloatArray, b: FloatArray, radius: FloatArray, rigid: IntArray,
    means: FloatArray, samples: int, spread: FloatArray, doubt: FloatArray, independent: float,
    seen: FloatArray, distance: FloatArray, gain: FloatArray,
    told_link: IntArray, told: FloatArray, told_sigma: FloatArray,
    mu: float, largest: float, relative: float, tails: float, seen_share: float, seen_m: float, near: float,
    unit_share: float, unit_m: float, margin: float, keep: float, steps: int, weight: float, size: float, two: bool,
    average: FloatArray, pair: IntArray, on: IntArray, point: FloatArray, force: FloatArray, sigma: FloatArray,
    probability: FloatArray,
) -> tuple[float, float, int]:  # fmt: skip
    """Write the last two lines of arguments; return the weight of the average, a force of the pair, and how many."""
    n, count = len(anchor), len(link)
    at, outwards, hidden = np.empty((count, 3)), np.empty((count, 3)), np.empty(count, np.bool_)
    place_surface(position, rotation, link, place, normal, at, outwards)
    ends = placed_ends(capsule, a, b, position, rotation)
    hidden_places(at, body, rigid[capsule], ends[0], ends[1], radius, hidden)
    prior = np.empty(count)
    prior_of_places(
        at, link, area, hidden, gain, seen, distance, seen_share, seen_m, near, told_link, told, told_sigma, unit_share,
        unit_m, prior,
    )  # fmt: skip

    C = np.empty((n, n))
    window, square = _clearest(means, samples, spread, doubt, independent, relative, C)
    if window < 0:
        return 0.0, 0.0, 0
    ln, there = np.empty(count), np.empty((count, 3))
    left = evidence_under(
        C, means[window], anchor, axis, position, rotation, moved_by, link, place, normal, first, prior, mu, largest,
        tails, ln, there,
    )  # fmt: skip
    one = total_of(ln)
    total = keep * weight + square
    for c in range(count):
        average[c] = (keep * weight * average[c] + square * (ln[c] - prior[c])) / total

    if left > _LEFT or two:
        lns, forces, other = np.empty((2, count)), np.empty((2, count, 3)), np.empty(2, np.int64)
        # a pair that is believed is followed; else it is improved, and another one tried, in turns
        again = pair[0] >= 0 and (two or steps % 2 == 1)
        behind = 2 + steps // 2 % max(1, n - 3)
        best = best_pair(
            C, means[window], anchor, axis, position, rotation, moved_by, link, place, normal, first, body, prior, at,
            outwards, mu, largest, tails, pair[0] if again else -1, size, behind, _TURNS, other, lns, forces,
        )  # fmt: skip
        if best > -np.inf and (again or pair[0] < 0 or best > one):
            pair[:] = other
            size = 0.0
            for i in range(3):
                size -= forces[0, pair[0], i] * outwards[pair[0], i]
        if best - one > (0.0 if two else margin):
            for k in range(2):
                summarise(lns[k], at, outwards, link, first, forces[k], on, point, force, sigma, probability, k)
            if rigid[on[0]] == rigid[on[1]]:
                # each place left out the other's own body only: the less sure contact is on the likeliest other one
                k = 0 if probability[0] < probability[1] else 1
                leave_out(lns[k], body, rigid[on[k]])
                summarise(lns[k], at, outwards, link, first, forces[k], on, point, force, sigma, probability, k)
            if probability[1] > probability[0]:
                exchange(on, point, force, sigma, probability)
            return total, size, 2
    for c in range(count):
        ln[c] = average[c] + prior[c]
    summarise(ln, at, outwards, link, first, there, on, point, force, sigma, probability, 0)
    return total, size, 1


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
