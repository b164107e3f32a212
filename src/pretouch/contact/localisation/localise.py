"""Contact localisation from the torques that free motion does not explain, with what the skin sees as a prior.

Candidate points on the arm's surface (`robot.surface`) are weighed by how well a force there that pushes inwards
explains the torques (`single_contact`), times how likely a contact is there beforehand (`prior`); two contacts at once
by what both explain together (`double_contact`). The state is the contact so far: what earlier steps said of each
candidate, and the pair that was looked for last, so that a search goes on from step to step at a bounded cost. In free
motion nothing runs.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pretouch.compiled import ByName, compiled, entry
from pretouch.contact.localisation.double_contact import Pair, Start, exclude_body, find_pair, log_sum_exp
from pretouch.contact.localisation.posterior import ContactArrays, summarise, swap
from pretouch.contact.localisation.prior import (
    LocalisationNumbers,
    SeenNear,
    UnitCues,
    candidate_poses,
    hidden_candidates,
    log_prior,
)
from pretouch.contact.localisation.significance import independent_part, most_significant
from pretouch.contact.localisation.single_contact import Candidates, log_posterior
from pretouch.contact.sequential_detector import Observation, ResidualWindows
from pretouch.groups import CapsuleArrays, SurfaceArrays
from pretouch.params import LocalisationParams
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.vectors import dot, placed_capsules
from pretouch.types import NOT_TOUCHED, BoolArray, FloatArray, IntArray, Touched
from pretouch.values import value

_OVER = 0.5
"""Normalised log-likelihood ratio below which a contact is over: a gap to 1, at which it begins, so that noise does not
end it."""
_UNEXPLAINED = 6.0
"""What the best single contact has to leave unexplained before two are looked for [1]: less hardly pays for two."""


@value
class LocalisationState:
    """The contact so far. Recordings keep these names."""

    ln: FloatArray
    """(N,) log-likelihood of each candidate, averaged over the steps of this contact; (0,) without a contact."""
    weight: float
    """How much that average stands on."""
    pair: IntArray
    """(2,) candidates of the two contacts that explain most so far, -1 for none."""
    size: float
    """Force into the surface at the first of them [N]."""
    two: bool
    """Whether they are believed."""
    steps: int
    """Inferences since the contact began."""
    since: float
    """Time since the last one [s]."""
    touched: Touched
    """Its result."""


def localisation_init() -> LocalisationState:
    """Return the state without a contact."""
    return _NOTHING


_NOTHING = LocalisationState(np.zeros(0), 0.0, np.full(2, -1, np.int64), 0.0, False, 0, 0.0, NOT_TOUCHED)


def localise(
    state: LocalisationState, model: RobotModel, seen: Observation, windows: ResidualWindows,
    log_likelihood_ratio: float, period: float, p: LocalisationParams,
) -> tuple[Touched, LocalisationState]:  # fmt: skip
    """Return the contacts in one step, none without a detection.

    Args:
        state: memory.
        model: the arm.
        seen: what one step knows; of the robot's state the commanded joint velocities.
        windows: means of the newest residuals.
        log_likelihood_ratio: of a contact, normalised: one from 1 on.
        period: of control [s].
        p: parameters.
    """
    if log_likelihood_ratio < (1.0 if state.steps == 0 else _OVER):
        return NOT_TOUCHED, _NOTHING
    since = state.since + period
    if state.steps and since < p.update_s * (1.0 - 1e-9):  # sums of periods are not exact
        return state.touched, replace(state, since=since)
    s = model.surface
    # the state is a value: what is written to is copied
    ln = np.zeros(len(s)) if state.steps == 0 else state.ln.copy()
    pair, link = state.pair.copy(), np.empty(2, np.int64)
    point, force, sigma, probability = np.empty((2, 3)), np.empty((2, 3)), np.empty(2), np.empty(2)
    weight, size, found = _infer(
        seen.kin, _Body(model.moved_by, model.rigid, s.arrays, model.capsules.arrays),
        windows._replace(samples=_steady_samples(windows.samples, seen.robot.qd_commanded, period, p)),
        seen.obstacles, seen.cues, p,
        _SoFar(
            ln, pair, state.steps, state.weight, state.size, state.two, -math.log(p.two_odds),
            math.exp(-max(since, period) / p.memory_s) if p.memory_s > 0.0 else 0.0,
            independent_part(period, p),
        ),
        ContactArrays(link, point, force, sigma, probability),
    )  # fmt: skip
    if not found:
        return NOT_TOUCHED, _NOTHING
    touched = Touched(link[:found], point[:found], force[:found], sigma[:found], probability[:found])
    return touched, LocalisationState(ln, weight, pair, size, found == 2, state.steps + 1, 0.0, touched)


def _steady_samples(samples: int, qd: FloatArray, period: float, p: LocalisationParams) -> int:
    """Return how many samples there are since half of whose time the posture has changed by `relative` [rad] at most.

    By so much a force's torques change in part, if a joint turns so far.
    """
    fastest = float(np.abs(qd).max())
    # a window of T seconds lies T / 2 back on average
    return samples if fastest * samples * period <= 2.0 * p.relative else int(2.0 * p.relative / (fastest * period)) + 1


class _Body(NamedTuple):
    """The arm's body, as a contact meets it."""

    moved_by: BoolArray
    """(L, n) whether a joint moves a link."""
    rigid: IntArray
    """(L,) rigid body of each link."""
    surface: SurfaceArrays
    capsules: CapsuleArrays


class _SoFar(NamedTuple):
    """The contact so far, as of `LocalisationState`, and what the new samples count."""

    average: FloatArray
    pair: IntArray
    steps: int
    weight: float
    size: float
    two: bool
    margin: float
    """Log-likelihood by which two contacts have to be likelier than one [nats]."""
    keep: float
    """Part of the average that is kept."""
    independent: float
    """Part of a sample that says something new."""


@entry
def _infer(
    kin: Kinematics, body: _Body, windows: ResidualWindows, seen: ByName[SeenNear], cues: ByName[UnitCues],
    p: ByName[LocalisationNumbers], so_far: _SoFar, contacts: ContactArrays,
) -> tuple[float, float, int]:  # fmt: skip
    """Write average, pair and contacts; return the weight of the average, a force of the pair, and how many."""
    surface, capsules, rigid, average, pair = body.surface, body.capsules, body.rigid, so_far.average, so_far.pair
    n, count = len(kin.anchor), len(surface.link)
    point, normal, hidden = np.empty((count, 3)), np.empty((count, 3)), np.empty(count, np.bool_)
    candidate_poses(kin, surface, point, normal)
    hidden_candidates(point, surface.body, placed_capsules(capsules, kin), rigid[capsules.link], hidden)
    prior = np.empty(count)
    log_prior(point, surface, hidden, seen, cues, p, prior)

    # One contact: the mean that stands out most, held against a force at each candidate.
    S = np.empty((n, n))
    window, square = most_significant(windows, so_far.independent, p.relative, S)
    if window < 0:
        return 0.0, 0.0, 0
    ln, force = np.empty(count), np.empty((count, 3))
    candidates = Candidates(windows.means[window], kin, body.moved_by, surface, point, normal, prior, p)
    unexplained = log_posterior(S, candidates, ln, force)
    single = log_sum_exp(ln)
    # likelihoods are averaged over the contact, each step by how far it stands out; the prior is that of this step
    kept = so_far.keep * so_far.weight
    total = kept + square
    for c in range(count):
        average[c] = (kept * average[c] + square * (ln[c] - prior[c])) / total

    # Two contacts: looked for while one leaves something, from step to step from where the last search ended.
    size = so_far.size
    if unexplained > _UNEXPLAINED or so_far.two:
        found = Pair(np.empty(2, np.int64), np.empty((2, count)), np.empty((2, count, 3)))
        # a pair that is believed is followed; else it is improved, and another one tried, in turns
        again = pair[0] >= 0 and (so_far.two or so_far.steps % 2 == 1)
        # each other try starts behind the next joint, from 2 to n - 2
        joint = 2 + so_far.steps // 2 % max(1, n - 3)
        double = find_pair(S, candidates, Start(pair[0] if again else -1, size, joint), found)
        if double > -np.inf and (again or pair[0] < 0 or double > single):
            pair[:] = found.candidate
            size = -dot(found.force[0, pair[0]], normal[pair[0]])
        if double - single > (0.0 if so_far.two else so_far.margin):
            _summarise_pair(found, candidates, rigid, contacts)
            return total, size, 2
    # the single contact is reported by the average, though compared with two by this step's torques alone
    for c in range(count):
        ln[c] = average[c] + prior[c]
    summarise(ln, candidates, force, contacts, 0)
    return total, size, 1


@compiled
def _summarise_pair(found: Pair, candidates: Candidates, rigid: IntArray, contacts: ContactArrays) -> None:
    """Write both contacts, on two rigid bodies, the more certain one first."""
    probability = contacts.probability
    for k in range(2):
        summarise(found.ln[k], candidates, found.force[k], contacts, k)
    if rigid[contacts.link[0]] == rigid[contacts.link[1]]:
        # each contact excludes only the other's own body: the less certain one goes to the likeliest other body
        k = 0 if probability[0] < probability[1] else 1
        exclude_body(found.ln[k], candidates.surface.body, rigid[contacts.link[k]])
        summarise(found.ln[k], candidates, found.force[k], contacts, k)
    if probability[1] > probability[0]:
        swap(contacts)
