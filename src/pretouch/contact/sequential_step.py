"""One sample of the sequential test in one compiled call: free motion, the test against contacts, what is learnt.

With tau the external torques, x the features and w the weights of free motion, the residual is r = tau - w^T x. It has
the noise covariance C = M A M^T + D and the model's variance u = x^T P x, which does not average out
(`residual_model`). The test holds means of the newest residuals against contacts (`sequential`).
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, inlined, kernel
from pretouch.contact.lasting_load import follow_lasting
from pretouch.contact.learning import add_to_block, learn_turning, queue_block
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
from pretouch.contact.sequential import (
    Moment,
    force_map_into,
    hypotheses,
    judge,
    link_prior,
    nearest_of,
)
from pretouch.records import Cell, IntCell
from pretouch.robot.kinematics import Mechanism, below, jacobian_into
from pretouch.types import FloatArray

CALM = BLOCK * QUEUE
"""Calm samples after which one is learnt."""
_SETTLED_S = 10.0
"""Time at rest, as far as free motion is learnt in it, after which a posture's offsets count as learnt [s]."""
_STIRS_RAD_S = 0.002
"""Joint speed from which an arm at rest sets out: friction turns round before it counts as moving [rad/s]."""


class SampleTest(NamedTuple):
    """What one sample says."""

    residual: Annotated[FloatArray, "n"]
    """(n,) torques less their mean [Nm]."""
    log_likelihood_ratio: Cell
    """ln R / ln A: a contact from 1 on."""
    detectable_n: Cell
    """Force at the end-effector that is found, see `detectable_force` [N]."""
    force: Annotated[FloatArray, 3]
    """(3,) at the end-effector that explains the window that says most best [N]; none of it moves the arm towards a
    seen object if what says most is that this object touches."""
    bands: Annotated[FloatArray, 6, 3]
    """(6, 3) bands of the force that say the same of one sample, the parts of `Thresholds` [N]."""
    means: Annotated[FloatArray, "W", "n"]
    """(6, n) of windows of each of `LENGTHS` [Nm]."""
    samples: IntCell
    """How many samples there are."""
    covariance: Annotated[FloatArray, "n", "n"]
    """(n, n) of one sample: its noise, and `model_variance` on the diagonal [Nm^2]."""
    model_variance: Annotated[FloatArray, "n"]
    """(n,) of the error of the mean of free motion, which does not average out [Nm^2]."""
    lasting: IntCell
    """Whether it is being found out if the residual is a load or a step of an estimate."""


@compiled
def assess_sample(
    state: SequentialState, now: Moment, numbers: SequentialNumbers, mechanism: Mechanism, results: SampleTest
) -> None:
    """Test one sample of the external torques for a contact, and learn from it if nothing can be one.

    Changes the state, and writes what the sample says.
    """
    arm, n, at, p, kin = mechanism.arm, len(now.qd), state.at[0], numbers.p, now.kin
    covariance, distance = results.covariance, now.obstacles.body_distance
    sample = FreeSample(
        now.tau_ext, results.residual, np.empty(n), np.empty((n, state.model.weights.shape[1])), np.empty((n, n)),
        np.empty(n), covariance, results.model_variance, np.zeros(1, np.int64),
    )  # fmt: skip
    describe_free_motion(now, state, numbers, mechanism, sample)
    state.ring[at] = results.residual
    results.samples[0] = min(state.samples[0] + 1, LONGEST)
    results.means[:] = 0.0  # of windows that are not whole yet
    whole = window_means(state.ring, (at + 1) % LONGEST, results.samples[0], results.means)

    # The test against contacts of each joint, of each link and of the nearest objects: R is the sum of prior weights
    # times likelihood ratios, A the level that it passes at the chosen rate of false alarms.
    contacts = hypotheses(now, mechanism, numbers.objects, numbers.near)
    settled = state.settled[0] if below(sample.speed, _STIRS_RAD_S) else 0
    # At rest the offsets of a posture are learnt in seconds; until then the arm errs as in motion. Time in which
    # nothing may be learnt, with somebody near, does not count.
    regime = 0 if settled * numbers.period >= _SETTLED_S else 1
    scatter, level = np.zeros((0, n + 2, n)), max(1.0, numbers.bound - p.slack_nats)
    if numbers.misfit_s > 0.0:
        scatter, level = state.scatter[regime], earned_level(state.level[regime], numbers.bound, p.slack_nats)
    means = means_in_free_motion(results.means, whole, covariance, results.model_variance, scatter)
    log_r, window, which = judge(means, contacts, p.contact_gain, p.tails)
    evidence = max(0.0, log_r / level)

    J_ee = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J_ee)
    results.detectable_n[0] = detectable_force(
        J_ee, numbers.period, means, level - link_prior(mechanism), p.contact_gain, p.tails
    )
    # nothing is learnt while anything that is seen could be what is measured
    clear = len(distance) == 0 or distance[nearest_of(distance, 1)[0]] >= p.clear_m
    alone = clear and (numbers.learns == 2 or (numbers.learns == 1 and now.watched))
    if numbers.misfit_s > 0.0 and alone and not now.reacting and whole == len(LENGTHS):
        learn_level(log_r, state.level[regime])
    _learn(state, now.reacting, numbers, sample, means, J_ee, alone, evidence >= p.suspect)

    for j in range(n):  # only now: what is learnt is learnt of the noise alone
        covariance[j, j] += results.model_variance[j]
    # the first n hypotheses, wrenches beyond a joint, have no direction
    away = contacts.away[max(which - n, 0)] if which >= n else np.zeros(3)
    _force_and_bands(J_ee, results.means[window], sample.mean, away, math.sqrt(2.0 * level), results)
    state.model.speed[:], state.at[0] = sample.speed, (at + 1) % LONGEST
    state.settled[0] = settled + 1 if alone and not now.reacting else settled
    if state.steady[0] < 0:  # the load that lasted is free motion now, and no contact
        evidence, results.force[:], results.samples[0] = 0.0, 0.0, 0
        state.steady[0] = state.calm[0] = state.model.filled[0] = state.model.waiting[0] = 0
    state.samples[0] = results.samples[0]
    results.log_likelihood_ratio[0], results.lasting[0] = evidence, 1 if state.steady[0] > 0 else 0


@inlined
def _learn(
    state: SequentialState, reacting: bool, numbers: SequentialNumbers, sample: FreeSample, means: WindowMeans,
    J: FloatArray, alone: bool, suspected: bool,
) -> None:  # fmt: skip
    """Learn from a sample: of the state, count what is calm and what lasts.

    `J` (6, n) is the Jacobian of the end-effector, `alone` says whether nothing that is seen can touch the arm,
    `suspected` whether a contact is.
    """
    model, p, period, at, full = state.model, numbers.p, numbers.period, state.at[0], means.whole == len(LENGTHS)
    # What was gathered before a contact is suspected may be its beginning: it is thrown away, not learnt. Where misfit
    # is learnt it only counts less: a spread without what it does not expect shrinks, and expects less and less.
    lost = (suspected and numbers.misfit_s == 0.0) or reacting or not alone
    state.calm[0] = 0 if lost else min(state.calm[0] + 1, CALM)
    # learnt also where a contact is suspected: an alarm at a reversal would otherwise come at each of them
    if p.widen_at_turns and alone and not reacting and full:
        learn_turning(at, means, period / p.memory_s, state.turning)
    if numbers.misfit_s > 0.0 and alone and not reacting:
        learn_scatter(at, means, p.tails, period / numbers.misfit_s)
    if state.calm[0] >= CALM:
        add_to_block(model, sample, means.scatter[-1, -1] if numbers.misfit_s > 0.0 else np.zeros(0), p)
        queue_block(model, numbers)
    else:
        model.filled[0] = model.waiting[0] = 0
    # something that lasts is worth finding only if it troubles the arm; calm samples learn it anyway
    unclear = state.steady[0] > 0 or suspected or reacting
    if numbers.settle > 0 and alone and full and (state.calm[0] < CALM or suspected) and unclear:
        follow_lasting(state, reacting, suspected, numbers, sample, means, J)
    else:
        state.steady[0] = 0


@kernel
def _force_and_bands(
    J: FloatArray, torque: FloatArray, mean: FloatArray, away: FloatArray, wide: float, results: SampleTest
) -> None:
    """Write force (3,) and bands (6, 3) of `SampleTest`, of torques (n,) and of the mean in free motion.

    With the damped inverse W of J^T the force is W tau, and its variance diag(W C W^T). The bands are `wide` deviations
    about the mean: sqrt(2 ln A), where a single Gaussian's likelihood ratio, exp(z^2 / 2), is A.
    """
    force, bands, covariance, n = results.force, results.bands, results.covariance, len(torque)
    W = np.empty((3, n))
    force_map_into(J, W)  # damped: near a singularity the force is taken to be smaller than it may be
    against = 0.0
    for i in range(3):
        force[i], usual, variance = 0.0, 0.0, 0.0
        for j in range(n):
            force[i] += W[i, j] * torque[j]
            usual += W[i, j] * mean[j]
            for k in range(n):
                variance += W[i, j] * covariance[j, k] * W[i, k]
        sigma = math.sqrt(variance)
        bands[0, i], bands[1, i], bands[2, i] = usual + sigma * wide, usual - sigma * wide, usual
        # the objects' parts of eqs. 9-11 are none here: proximity is a prior of the test
        bands[3, i], bands[4, i], bands[5, i] = sigma, 0.0, 0.0
        against += force[i] * away[i]
    # an object that is seen pushes the arm away: the part towards it is an error of the torques
    if against < 0.0:
        for i in range(3):
            force[i] -= against * away[i]
