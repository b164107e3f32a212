"""Localisation of a contact by the torques that free motion does not explain, with the skin's view as a prior.

Candidate points on the arm's surface (`robot.body`) have as weights the likelihood of the torques under a force there
that pushes inwards, times the prior of a contact there (`posterior`). The state is the contact so far: the likelihoods
of earlier steps. In free motion nothing runs.
"""

import math
from dataclasses import replace

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import compiled, entry, kernel
from pretouch.contact.detector import Body, Sample
from pretouch.contact.posterior import Candidates, log_posterior, log_prior, summarise
from pretouch.contact.scatter import LENGTHS
from pretouch.contact.sequential_step import SampleTest
from pretouch.contact.touch_cue import Cues
from pretouch.params import LocalisationParams
from pretouch.robot.body import Capsules, Surface, placed, to_axis
from pretouch.robot.kinematics import Kinematics, rotate
from pretouch.types import NOT_TOUCHED, BoolArray, FloatArray, IntArray, Obstacles, Touched
from pretouch.values import value


def _independent_part(period: float, p: LocalisationParams) -> float:
    """Return the part of a sample, one a period [s], with noise independent of the samples before."""
    return min(1.0, period / p.independent_s)


def most_significant_mean(
    tested: SampleTest, period: float, p: LocalisationParams
) -> tuple[FloatArray, FloatArray] | None:
    """Return the most significant mean (n,) [Nm], and its covariance (n, n) in free motion [Nm^2].

    None where the covariance is not positive definite, or there are no samples.
    """
    covariance = np.empty_like(tested.covariance)
    window, _ = _most_significant(tested, _independent_part(period, p), 0.0, covariance)
    return None if window < 0 else (tested.means[window], covariance)


@compiled
def _most_significant(tested: SampleTest, independent: float, relative: float, S: FloatArray) -> tuple[int, float]:
    """Return the window with the largest z^T S^-1 z of its mean z, and that value; -1 without one.

    `independent` is the independent part of a sample. `S` (n, n) is written: the covariance of that mean, with an error
    of the part `relative` of each joint's torque.
    """
    # z^T S^-1 z grows with the window while the torques last, and falls once it holds samples from before the contact
    n = len(tested.model_variance)
    L, y, best, window = np.zeros((n, n)), np.empty(n), 0.0, -1
    for k in range(len(LENGTHS)):
        if LENGTHS[k] > tested.samples[0]:
            break
        # without the relative error, which would make all large means equally significant
        _covariance_of_mean(tested, k, independent, 0.0, S)
        if factor(S, L):
            square = forward(L, tested.means[k], y)
            if square > best:
                best, window = square, k
    if window >= 0:
        _covariance_of_mean(tested, window, independent, relative, S)
    return window, best


@kernel
def _covariance_of_mean(tested: SampleTest, k: int, independent: float, relative: float, S: FloatArray) -> None:
    """Write S = (C + U) / N + (1 - 1 / N) U + diag(relative z)^2 (n, n) of the mean z of window k.

    The noise C averages out over N independent samples, the model's variance U does not; windows hold C + U.
    """
    # successive samples share a part of their noise: the number of independent ones
    samples = max(1.0, independent * LENGTHS[k])
    mean, variance = tested.means[k], tested.model_variance
    for i in range(len(mean)):
        for j in range(len(mean)):
            S[i, j] = tested.covariance[i, j] / samples
        S[i, i] += variance[i] * (1.0 - 1.0 / samples) + (relative * mean[i]) ** 2


_OVER = 0.5
"""Normalised log-likelihood ratio below which a contact is over: less than 1, at which it begins, so that noise does
not end it."""


@value
class LocalisationState:
    """The contact so far. Recordings store these names."""

    ln: FloatArray
    """(N,) log-likelihood of each candidate, averaged over the steps of this contact; (0,) without a contact."""
    weight: float
    """Weight of that average."""
    steps: int
    """Inferences since the contact began."""
    since: float
    """Time since the last inference [s]."""
    touched: Touched
    """Result of the last inference."""


NO_CONTACT = LocalisationState(np.zeros(0), 0.0, 0, 0.0, NOT_TOUCHED)


def localise(
    state: LocalisationState, body: Body, sample: Sample, cues: Cues, tested: SampleTest, p: LocalisationParams
) -> LocalisationState:
    """Return the contact so far, updated by a sample; none without a detection.

    `cues` are those of the sample, `tested` is the sequential test's result for it.
    """
    model, qd, ratio = body.model, sample.robot.qd_commanded, float(tested.log_likelihood_ratio[0])
    if ratio < (1.0 if state.steps == 0 else _OVER):
        return NO_CONTACT
    since = state.since + body.period
    if state.steps and since < p.update_s * (1.0 - 1e-9):  # sums of periods are not exact
        return replace(state, since=since)
    s = model.surface
    # the state is a value: the average is a copy
    average = np.zeros(len(s.link)) if state.steps == 0 else state.ln.copy()
    touched = Touched(np.empty(1, np.int64), np.empty((1, 3)), np.empty((1, 3)), np.empty(1), np.empty(1))
    fading = math.exp(-max(since, body.period) / p.memory_s) if p.memory_s > 0.0 else 0.0
    # samples since half of whose time, on average, the posture has changed by `relative` [rad] at most: by so much a
    # force's torques change in part, if a joint turns so far
    steady, fastest = int(tested.samples[0]), float(np.abs(qd).max())
    if fastest * steady * body.period > 2.0 * p.relative:
        steady = int(2.0 * p.relative / (fastest * body.period)) + 1
    arm, so_far = (model.moved_by, model.rigid, s, model.capsules), (average, fading * state.weight)
    tested, independent = tested._replace(samples=np.array([steady])), _independent_part(body.period, p)
    weight = _infer(sample.kin, arm, (tested, independent), sample.obstacles, cues, p.numbers, so_far, touched)
    return NO_CONTACT if weight < 0.0 else LocalisationState(average, weight, state.steps + 1, 0.0, touched)


@kernel
def candidate_poses(kin: Kinematics, surface: Surface, point: FloatArray, normal: FloatArray) -> None:
    """Write points [m] and outward normals (N, 3) of the surface in the base frame."""
    for c in range(len(surface.link)):
        k = surface.link[c]
        rotate(kin.rotation[k], surface.normal[c], normal[c])
        rotate(kin.rotation[k], surface.point[c], point[c])
        for i in range(3):
            point[c, i] += kin.position[k, i]


@kernel
def hidden_candidates(
    point: FloatArray, body: IntArray, capsules: Capsules, capsule_body: IntArray, hidden: BoolArray
) -> None:
    """Mark each point (N, 3) inside a capsule of another rigid body, where nothing can touch it.

    The capsules are in the base frame; `body` (N,) and `capsule_body` (C,) are the rigid bodies of points and capsules.
    """
    a, b, radius = capsules.a, capsules.b, capsules.radius
    for c in range(len(point)):
        hidden[c] = False
        for k in range(len(radius)):
            if capsule_body[k] != body[c] and to_axis(point, c, a, b, k)[1] < radius[k]:
                hidden[c] = True
                break


@entry
def _infer(
    kin: Kinematics, arm: tuple[BoolArray, IntArray, Surface, Capsules], sample: tuple[SampleTest, float],
    near: Obstacles, cues: Cues, p: LocalisationParams, so_far: tuple[FloatArray, float], contact: Touched,
) -> float:  # fmt: skip
    """Write average and contact; return the weight of the average, -1 without a significant mean.

    `arm` has the joints that move each link (L, n), each link's rigid body (L,), surface and capsules; `sample` the
    means of the newest residuals and the independent part of a sample; `so_far` the contact's average (N,) and weight.
    """
    (moved_by, rigid, surface, capsules), (tested, independent), (average, before) = arm, sample, so_far
    n, count = len(kin.anchor), len(surface.link)
    point, normal, hidden = np.empty((count, 3)), np.empty((count, 3)), np.empty(count, np.bool_)
    candidate_poses(kin, surface, point, normal)
    hidden_candidates(point, surface.body, placed(capsules, kin), rigid[capsules.link], hidden)
    prior = np.empty(count)
    log_prior(point, surface, hidden, near, cues, p, prior)

    # the most significant mean, compared with a force at each candidate
    S = np.empty((n, n))
    window, square = _most_significant(tested, independent, p.relative, S)
    if window < 0:
        return -1.0
    ln, force = np.empty(count), np.empty((count, 3))
    candidates = Candidates(tested.means[window], kin, moved_by, surface, point, normal, prior, p)
    if not log_posterior(S, candidates, ln, force):
        return -1.0
    # likelihoods are averaged over the contact, each step weighted by its significance; the prior is of this step
    for c in range(count):
        average[c] = (before * average[c] + square * (ln[c] - prior[c])) / (before + square)
        ln[c] = average[c] + prior[c]
    summarise(ln, candidates, force, contact)
    return before + square
