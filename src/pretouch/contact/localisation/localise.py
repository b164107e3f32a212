"""Contact localisation from the torques that free motion does not explain, with what the skin sees as a prior.

Candidate points on the arm's surface (`robot.body`) are weighed by how well a force there that pushes inwards
explains the torques (`posterior`), times how likely a contact is there beforehand (`prior`). The state is the contact
so far: what earlier steps said of each candidate. In free motion nothing runs.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import compiled, entry, kernel
from pretouch.contact.localisation.posterior import Candidates, log_posterior, summarise
from pretouch.contact.localisation.prior import (
    LocalisationNumbers,
    candidate_poses,
    hidden_candidates,
    log_prior,
)
from pretouch.contact.scatter import LENGTHS
from pretouch.contact.sequential_detector import Observation
from pretouch.contact.touch_cue import Cues
from pretouch.params import LocalisationParams
from pretouch.robot.body import Capsules, Surface, placed
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import NOT_TOUCHED, BoolArray, FloatArray, IntArray, Obstacles, Touched
from pretouch.values import value

_LENGTHS = np.array(LENGTHS)


class ResidualWindows(NamedTuple):
    """Means of the newest residuals, and what they are in free motion; see `SampleTest`."""

    means: FloatArray
    samples: int
    covariance: FloatArray
    model_variance: FloatArray


def independent_part(period: float, p: LocalisationParams) -> float:
    """Part of a sample, one a period [s], whose noise is not that of the samples before."""
    return min(1.0, period / p.independent_s)


def most_significant_mean(
    windows: ResidualWindows, period: float, p: LocalisationParams
) -> tuple[FloatArray, FloatArray] | None:
    """Return the mean (n,) that stands out most [Nm], and its covariance (n, n) in free motion [Nm^2].

    None where the covariance is not positive definite, or there are no samples.
    """
    covariance = np.empty_like(windows.covariance)
    window, _ = most_significant(windows, independent_part(period, p), 0.0, covariance)
    return None if window < 0 else (windows.means[window], covariance)


@compiled
def most_significant(windows: ResidualWindows, independent: float, relative: float, S: FloatArray) -> tuple[int, float]:
    """Return the window with the largest z^T S^-1 z of its mean z, and that value; -1 where there is none.

    `independent` is the part of a sample that says something new. `S` (n, n) is written: the covariance of that mean,
    with an error of the part `relative` of each joint's torque.
    """
    # z^T S^-1 z grows with the window while the torques last, and falls once it holds samples from before the contact
    n = len(windows.model_variance)
    L, y, best, window = np.zeros((n, n)), np.empty(n), 0.0, -1
    for k in range(len(_LENGTHS)):
        if _LENGTHS[k] > windows.samples:
            break
        # without the relative error, which would make every large mean stand out alike
        _covariance_of_mean(windows, k, independent, 0.0, S)
        if factor(S, L):
            square = forward(L, windows.means[k], y)
            if square > best:
                best, window = square, k
    if window >= 0:
        _covariance_of_mean(windows, window, independent, relative, S)
    return window, best


@kernel
def _covariance_of_mean(windows: ResidualWindows, k: int, independent: float, relative: float, S: FloatArray) -> None:
    """Write S = (C + U) / N + (1 - 1 / N) U + diag(relative z)^2 (n, n) of the mean z of window k.

    The noise C averages out over N independent samples, the model's variance U does not; windows hold C + U.
    """
    # samples that follow each other closely have the same noise in part: so many of them say something new
    samples = max(1.0, independent * _LENGTHS[k])
    mean, variance = windows.means[k], windows.model_variance
    for i in range(len(mean)):
        for j in range(len(mean)):
            S[i, j] = windows.covariance[i, j] / samples
        S[i, i] += variance[i] * (1.0 - 1.0 / samples) + (relative * mean[i]) ** 2


_OVER = 0.5
"""Normalised log-likelihood ratio below which a contact is over: a gap to 1, at which it begins, so that noise does not
end it."""


@value
class LocalisationState:
    """The contact so far. Recordings keep these names."""

    ln: FloatArray
    """(N,) log-likelihood of each candidate, averaged over the steps of this contact; (0,) without a contact."""
    weight: float
    """How much that average stands on."""
    steps: int
    """Inferences since the contact began."""
    since: float
    """Time since the last one [s]."""
    touched: Touched
    """Its result."""


def localisation_init() -> LocalisationState:
    """Return the state without a contact."""
    return _NOTHING


_NOTHING = LocalisationState(np.zeros(0), 0.0, 0, 0.0, NOT_TOUCHED)


def localise(
    state: LocalisationState, model: RobotModel, seen: Observation, windows: ResidualWindows,
    log_likelihood_ratio: float, period: float, p: LocalisationParams,
) -> tuple[Touched, LocalisationState]:  # fmt: skip
    """Return the contact in one step, none without a detection.

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
    ln = np.zeros(len(s.link)) if state.steps == 0 else state.ln.copy()
    touched = Touched(np.empty(1, np.int64), np.empty((1, 3)), np.empty((1, 3)), np.empty(1), np.empty(1))
    weight = _infer(
        seen.kin, _Body(model.moved_by, model.rigid, s, model.capsules),
        windows._replace(samples=_steady_samples(windows.samples, seen.robot.qd_commanded, period, p)),
        seen.obstacles, seen.cues, LocalisationNumbers(*(getattr(p, name) for name in LocalisationNumbers._fields)),
        _SoFar(
            ln, state.weight, math.exp(-max(since, period) / p.memory_s) if p.memory_s > 0.0 else 0.0,
            independent_part(period, p),
        ),
        touched,
    )  # fmt: skip
    if weight < 0.0:
        return NOT_TOUCHED, _NOTHING
    return touched, LocalisationState(ln, weight, state.steps + 1, 0.0, touched)


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
    surface: Surface
    capsules: Capsules


class _SoFar(NamedTuple):
    """The contact so far, as of `LocalisationState`, and what the new samples count."""

    average: FloatArray
    weight: float
    keep: float
    """Part of the average that is kept."""
    independent: float
    """Part of a sample that says something new."""


@entry
def _infer(
    kin: Kinematics, body: _Body, windows: ResidualWindows, seen: Obstacles, cues: Cues,
    p: LocalisationNumbers, so_far: _SoFar, contact: Touched,
) -> float:  # fmt: skip
    """Write average and contact; return the weight of the average, -1 where nothing stands out."""
    surface, capsules, rigid, average = body.surface, body.capsules, body.rigid, so_far.average
    n, count = len(kin.anchor), len(surface.link)
    point, normal, hidden = np.empty((count, 3)), np.empty((count, 3)), np.empty(count, np.bool_)
    candidate_poses(kin, surface, point, normal)
    hidden_candidates(point, surface.body, placed(capsules, kin), rigid[capsules.link], hidden)
    prior = np.empty(count)
    log_prior(point, surface, hidden, seen, cues, p, prior)

    # the mean that stands out most, held against a force at each candidate
    S = np.empty((n, n))
    window, square = most_significant(windows, so_far.independent, p.relative, S)
    if window < 0:
        return -1.0
    ln, force = np.empty(count), np.empty((count, 3))
    candidates = Candidates(windows.means[window], kin, body.moved_by, surface, point, normal, prior, p)
    if not log_posterior(S, candidates, ln, force):
        return -1.0
    # likelihoods are averaged over the contact, each step by how far it stands out; the prior is that of this step
    kept = so_far.keep * so_far.weight
    total = kept + square
    for c in range(count):
        average[c] = (kept * average[c] + square * (ln[c] - prior[c])) / total
        ln[c] = average[c] + prior[c]
    summarise(ln, candidates, force, contact)
    return total
