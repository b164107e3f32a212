"""One sample of the sequential test in one compiled call: free motion, the test against contacts, and learning.

With tau the external torques, x the features and w the weights of free motion, the residual is r = tau - w^T x. It has
the noise covariance C = M A M^T + D and the model's variance u = x^T P x, which does not average out
(`residual_model`). The test compares means of the newest residuals with contacts (`sequential`).
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, inlined, kernel
from pretouch.contact.lasting_load import follow_lasting, tilt_into
from pretouch.contact.learning import STIRS_RAD_S, add_to_block, learn_turning, queue_block, slide
from pretouch.contact.residual_model import (
    BLOCK,
    QUEUE,
    FreeSample,
    SequentialNumbers,
    SequentialState,
    describe_free_motion,
)
from pretouch.contact.scatter import (
    LENGTHS,
    LONGEST,
    WindowMeans,
    detectable_force,
    earned_level,
    learn_level,
    learn_scatter,
    means_in_free_motion,
    window_means,
)
from pretouch.contact.sequential import Moment, force_map_into, hypotheses, judge, link_prior
from pretouch.records import Cell, IntCell
from pretouch.robot.kinematics import Mechanism, below, jacobian_into
from pretouch.types import FloatArray

CALM = BLOCK * QUEUE
"""Calm samples before the first one is learnt."""
_UNLIKELY = 0.02
"""Probability of a touch by an object below which free motion is learnt."""
_SETTLED_S = 10.0
"""Time at rest with learning of free motion after which a posture's offsets count as learnt [s]."""


class SampleTest(NamedTuple):
    """Result of the test for one sample."""

    residual: Annotated[FloatArray, "n"]
    """(n,) torques less their mean [Nm]."""
    log_likelihood_ratio: Cell
    """ln R / ln A: a contact from 1 on."""
    detectable_n: Cell
    """Detectable force at the end-effector, see `detectable_force` [N]."""
    force: Annotated[FloatArray, 3]
    """(3,) force at the end-effector that best explains the most significant window [N]; it has no component towards an
    object if the most significant hypothesis is a touch by that object."""
    bands: Annotated[FloatArray, 6, 3]
    """(6, 3) equivalent bands of the force for one sample, the parts of `Thresholds` [N]."""
    means: Annotated[FloatArray, "W", "n"]
    """(6, n) means of the windows of each of `LENGTHS` [Nm]."""
    samples: IntCell
    """Number of samples."""
    covariance: Annotated[FloatArray, "n", "n"]
    """(n, n) covariance of one sample: its noise, and `model_variance` on the diagonal [Nm^2]."""
    model_variance: Annotated[FloatArray, "n"]
    """(n,) variance of the error of the mean of free motion, which does not average out [Nm^2]."""
    lasting: IntCell
    """1 while the test decides whether the residual is a load or a step of an estimate."""


@compiled
def assess_sample(
    state: SequentialState, now: Moment, numbers: SequentialNumbers, mechanism: Mechanism, results: SampleTest
) -> None:
    """Test one sample of the external torques for a contact, and learn from it if no contact is possible.

    Updates the state, and writes the results.
    """
    arm, n, at, p, kin, model = mechanism.arm, len(now.qd), state.at[0], numbers.p, now.kin, state.model
    covariance, distance = results.covariance, now.obstacles.body_distance
    speed, mean, M, moving = np.empty(n), np.empty(n), np.empty((n, n)), np.zeros(1, np.int64)
    x, variance = np.empty((n, model.weights.shape[1])), results.model_variance
    sample = FreeSample(now.tau_ext, results.residual, speed, x, M, mean, covariance, variance, moving)
    slide(model, now.qd_commanded, numbers.period, p.presliding_rad)
    describe_free_motion(now, state, numbers, mechanism, sample)
    state.ring[at] = results.residual
    results.samples[0] = min(state.samples[0] + 1, LONGEST)
    results.means[:] = 0.0  # for windows that are not full yet
    whole = window_means(state.ring, (at + 1) % LONGEST, results.samples[0], results.means)

    # The test against contacts of each joint, of each link and of the nearest objects: R is the sum of prior weights
    # times likelihood ratios, A the level that it exceeds at the chosen rate of false alarms.
    contacts, touching = hypotheses(now, mechanism, numbers.near)
    settled = state.settled[0] if below(sample.speed, STIRS_RAD_S) else 0
    # At rest the offsets of a posture are learnt in seconds; until then the errors are as in motion. Time without
    # learning, with somebody near, does not count.
    regime = 0 if settled * numbers.period >= _SETTLED_S else 1
    scatter, level = model.scatter[regime], earned_level(model.level[regime], numbers.bound, p.slack_nats)
    means = means_in_free_motion(results.means, whole, covariance, results.model_variance, scatter)
    log_r, window, which = judge(means, contacts, p.contact_gain, p.tails)
    evidence = max(0.0, log_r / level)

    J_ee, tilt = np.empty((6, n)), np.empty((2, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J_ee)
    tilt_into(mechanism.upright, J_ee, tilt)
    results.detectable_n[0] = detectable_force(
        J_ee, numbers.period, means, level - link_prior(mechanism), p.contact_gain, p.tails, p.observer_gain_1_s
    )
    # no learning while an obstacle could cause the torques
    alone = touching < _UNLIKELY and (numbers.learns == 2 or (numbers.learns == 1 and now.watched))
    clear = not np.any(distance < p.clear_m)
    if alone and not now.reacting and whole == len(LENGTHS):
        learn_level(log_r, model.level[regime])
    _learn(state, now.reacting, numbers, sample, means, tilt, (alone, clear), evidence >= p.suspect)

    for j in range(n):  # only now: the learning uses the noise alone
        covariance[j, j] += results.model_variance[j]
    # the first n hypotheses, wrenches beyond a joint, have no direction
    away = contacts.away[max(which - n, 0)] if which >= n else np.zeros(3)
    _force_and_bands(J_ee, results.means[window], sample.mean, away, math.sqrt(2.0 * level), results)
    model.speed[:], state.at[0] = sample.speed, (at + 1) % LONGEST
    state.settled[0] = settled + 1 if alone and not now.reacting else settled
    if state.steady[0] < 0:  # the load that lasted is free motion now, and no contact
        evidence, results.force[:], results.samples[0] = 0.0, 0.0, 0
        state.steady[0] = state.calm[0] = model.filled[0] = model.waiting[0] = 0
    state.samples[0] = results.samples[0]
    results.log_likelihood_ratio[0], results.lasting[0] = evidence, 1 if state.steady[0] > 0 else 0


@inlined
def _learn(
    state: SequentialState, reacting: bool, numbers: SequentialNumbers, sample: FreeSample, means: WindowMeans,
    tilt: FloatArray, free: tuple[bool, bool], suspected: bool,
) -> None:  # fmt: skip
    """Learn from a sample; update the counts of calm and lasting samples.

    `tilt` (2, n) is of `tilt_into`, `free` says whether no obstacle touches the arm and whether none is
    near it, `suspected` whether a contact is suspected.
    """
    model, p, period, at, full = state.model, numbers.p, numbers.period, state.at[0], means.whole == len(LENGTHS)
    alone, clear = free
    # Unexpected samples are not dropped, but have less weight: a spread without them shrinks, and expects fewer and
    # fewer, and an alarm at a reversal would repeat at each of them.
    learns = alone and not reacting
    state.calm[0] = min(state.calm[0] + 1, CALM) if learns else 0
    if learns and full:
        learn_turning(at, means, period / p.memory_s, model.turning)
        learn_scatter(at, means, p.tails, period / p.scatter_memory_s)
    if state.calm[0] >= CALM:
        add_to_block(model, sample, means.scatter[-1, -1], p)
        queue_block(model, numbers)
    else:
        model.filled[0] = model.waiting[0] = 0
    # a lasting residual matters only if it disturbs the arm; calm samples learn it anyway
    unclear = state.steady[0] > 0 or suspected or reacting
    if numbers.settle > 0 and alone and clear and full and (state.calm[0] < CALM or suspected) and unclear:
        follow_lasting(state, reacting, suspected, numbers, sample, means, tilt)
    else:
        state.steady[0] = 0


@kernel
def _force_and_bands(
    J: FloatArray, torque: FloatArray, mean: FloatArray, away: FloatArray, wide: float, results: SampleTest
) -> None:
    """Write force (3,) and bands (6, 3) of `SampleTest`, from torques (n,) and the mean in free motion.

    With the damped inverse W of J^T the force is W tau, and its variance diag(W C W^T). The bands are `wide` deviations
    about the mean: sqrt(2 ln A), where a single Gaussian's likelihood ratio, exp(z^2 / 2), is A.
    """
    force, bands, covariance, n = results.force, results.bands, results.covariance, len(torque)
    W = np.empty((3, n))
    force_map_into(J, W)  # damped: near a singularity the force is underestimated
    against = 0.0
    for i in range(3):
        force[i], free, variance = 0.0, 0.0, 0.0
        for j in range(n):
            force[i] += W[i, j] * torque[j]
            free += W[i, j] * mean[j]
            for k in range(n):
                variance += W[i, j] * covariance[j, k] * W[i, k]
        sigma = math.sqrt(variance)
        bands[0, i], bands[1, i], bands[2, i] = free + sigma * wide, free - sigma * wide, free
        # the objects' parts of eqs. 9-11 are 0 here: proximity is a prior of the test
        bands[3, i], bands[4, i], bands[5, i] = sigma, 0.0, 0.0
        against += force[i] * away[i]
    # an object pushes the arm away: a component towards it is an error of the torques
    if against < 0.0:
        for i in range(3):
            force[i] -= against * away[i]
