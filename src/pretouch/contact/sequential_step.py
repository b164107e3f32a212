"""One sample of the sequential detector in one compiled call: free motion, the test against contacts, what is learnt.

With tau the external torques, x the features and w the weights of free motion, the residual is r = tau - w^T x. It has
the noise covariance C = M A M^T + D and the model's variance u = x^T P x, which does not average out
(`residual_model`). The test holds means of the newest residuals against contacts (`sequential`).
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, inlined, kernel
from pretouch.contact.alarm_level import detectable_force, earned_level
from pretouch.contact.model_update import CALM, SequentialNumbers, SequentialState, Situation, Tested, update_model
from pretouch.contact.residual_model import CalmSample, features_into, mean_and_variance, spread_of_sample
from pretouch.contact.scatter import LENGTHS, LONGEST, add_reversal_variance, scattered_means, white_means, window_means
from pretouch.contact.sequential import force_map_into, hypotheses, judge, link_prior, nearest_of
from pretouch.records import Cell, IntCell
from pretouch.robot.kinematics import Kinematics, Mechanism, below, jacobian_into, mass_matrix_into
from pretouch.types import FloatArray, Obstacles

_SETTLED_S = 10.0
"""Time at rest, as far as free motion is learnt in it, after which a posture's offsets count as learnt [s]."""
_STIRS_RAD_S = 0.002
"""Joint speed from which an arm at rest sets out: friction turns round before it counts as moving [rad/s]."""


class Joints(NamedTuple):
    """What is taken of `RobotState`."""

    qd: FloatArray
    qd_commanded: FloatArray
    tau_ext: FloatArray


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
    learning: IntCell
    """Whether the sample is to be learnt as free motion."""
    lasting: IntCell
    """Whether it is being found out if the residual is a load or a step of an estimate."""


def sample_test(n: int) -> SampleTest:
    """Return room for what a sample of n joints says."""
    return SampleTest(
        np.zeros(n), np.zeros(1), np.full(1, np.nan), np.zeros(3), np.zeros((6, 3)), np.zeros((len(LENGTHS), n)),
        np.zeros(1, np.int64), np.zeros((n, n)), np.zeros(n), np.zeros(1, np.int64), np.zeros(1, np.int64),
    )  # fmt: skip


@compiled
def assess_sample(
    state: SequentialState, robot: Joints, obstacles: Obstacles, now: Situation, p: SequentialNumbers,
    kin: Kinematics, mechanism: Mechanism, results: SampleTest,
) -> None:  # fmt: skip
    """Test one sample of the external torques for a contact, and learn from it if nothing can be one.

    Changes the state, and writes what the sample says. The torques must be numbers.
    """
    arm, n, at = mechanism.arm, len(robot.qd), state.at[0]
    count = min(state.samples[0] + 1, LONGEST)
    covariance, means, distance = results.covariance, results.means, obstacles.body_distance
    means[:] = 0.0  # of windows that are not whole yet
    x, M = np.empty((n, state.model.weights.shape[1])), np.empty((n, n))
    free = _FreeMotion(np.empty(n), x, M, np.empty(n), covariance, results.model_variance)
    moving = _free_motion(robot.qd_commanded, state, p, kin, mechanism, free)
    for j in range(n):
        results.residual[j] = robot.tau_ext[j] - free.mean[j]
        state.ring[at, j] = results.residual[j]

    # The test against contacts of each joint, of each link and of the nearest objects: R is the sum of prior weights
    # times likelihood ratios, A the level that it passes at the chosen rate of false alarms.
    whole = window_means(state.ring, (at + 1) % LONGEST, count, means)
    contacts = hypotheses(kin, mechanism, robot.qd, obstacles, now.touch_gain, p)
    settled = state.settled[0] if below(free.speed, _STIRS_RAD_S) else 0
    # At rest the offsets of a posture are learnt in seconds; until then the arm errs as in motion. Time in which
    # nothing may be learnt, with somebody near, does not count.
    regime = 0 if settled * p.period >= _SETTLED_S else 1
    expected, ratio = white_means(covariance, results.model_variance), np.zeros(0)
    level = max(1.0, p.bound - p.slack_nats)
    if p.learn_misfit:
        expected = scattered_means(covariance, results.model_variance, state.scatter[regime])
        ratio = expected.scatter[-1, n + 1]
        level = earned_level(state.level[regime], p.bound, p.slack_nats, math.exp(-p.bound))
    log_r, window, which = judge(means, whole, expected, contacts, p.contact_gain, p.tails)
    log_likelihood_ratio = max(0.0, log_r / level)

    J_ee = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J_ee)
    results.detectable_n[0] = detectable_force(
        J_ee, p.period, expected, level - link_prior(mechanism), p.contact_gain, p.tails
    )
    # nothing is learnt while anything that is seen could be what is measured
    clear = len(distance) == 0 or distance[nearest_of(distance, 1)[0]] >= p.clear_m
    alone = clear and (p.learns == 2 or (p.learns == 1 and now.watched))
    sample = CalmSample(robot.tau_ext, x, results.residual, M, results.model_variance, moving, ratio)
    tested = Tested(
        sample, means, whole, expected, J_ee, alone, log_likelihood_ratio >= p.suspect, log_r, state.level[regime]
    )  # fmt: skip
    update_model(state, now, p, tested)

    for j in range(n):  # only now: what is learnt is learnt of the noise alone
        covariance[j, j] += results.model_variance[j]
    # the first n hypotheses, wrenches beyond a joint, have no direction
    away = contacts.away[max(which - n, 0)] if which >= n else np.zeros(3)
    _force_and_bands(
        J_ee, means[window], free.mean, covariance, away, math.sqrt(2.0 * level), results.force, results.bands
    )  # fmt: skip
    state.model.speed[:], state.at[0] = free.speed, (at + 1) % LONGEST
    state.settled[0] = settled + 1 if alone and not now.reacting else settled
    _conclude(state, results, log_likelihood_ratio, count)


@inlined
def _conclude(state: SequentialState, results: SampleTest, ratio: float, count: int) -> None:
    """Write the ratio and what is learnt, and forget a contact that was a load."""
    if state.steady[0] < 0:  # the load that lasted is free motion now, and no contact
        ratio, results.force[:], count = 0.0, 0.0, 0
        state.steady[0] = state.calm[0] = state.model.filled[0] = state.model.waiting[0] = 0
        results.learning[0] = 1
    else:
        results.learning[0] = 1 if state.calm[0] == CALM else 0
    state.samples[0] = results.samples[0] = count
    results.log_likelihood_ratio[0], results.lasting[0] = ratio, 1 if state.steady[0] > 0 else 0


class _FreeMotion(NamedTuple):
    """Room for what is known of a sample without a contact."""

    speed: FloatArray
    """(n,) commanded joint velocities as late as the torques are [rad/s]."""
    x: FloatArray
    """(n, f) features."""
    M: FloatArray
    """(n, n) mass matrix [kg m^2]."""
    mean: FloatArray
    """(n,) torques [Nm]."""
    covariance: FloatArray
    """(n, n) of their noise [Nm^2]."""
    model_variance: FloatArray
    """(n,) of the error of the mean [Nm^2]."""


@inlined
def _free_motion(
    commanded: FloatArray, state: SequentialState, p: SequentialNumbers, kin: Kinematics, mechanism: Mechanism,
    free: _FreeMotion,
) -> int:  # fmt: skip
    """Write mean, noise and uncertainty of the torques without a contact; return 1 if the arm moves, or 0.

    `commanded` (n,) are the joint velocities [rad/s].
    """
    learnt, before, moving, n = state.model, state.model.speed, 0, len(commanded)
    acceleration = np.empty(n)
    # the observer that gives the torques is a low pass of the first order: the velocities go through the same
    for j in range(n):
        free.speed[j] = p.delay * before[j] + (1.0 - p.delay) * commanded[j]
        acceleration[j] = (free.speed[j] - before[j]) / p.period
        if abs(free.speed[j]) > p.still_rad_s:
            moving = 1
    features_into(kin, mechanism, free.speed, acceleration, free.x)
    mean_and_variance(learnt.weights, learnt.covariance, free.x, free.mean, free.model_variance)
    mass_matrix_into(kin, mechanism, free.M)
    spread_of_sample(free.M, learnt.spread[moving], p.noise_floor_nm, free.covariance)
    for j in range(n):
        free.model_variance[j] += p.bias_floor_nm**2
    if p.widen_at_turns:
        add_reversal_variance(free.M, acceleration, state.turning, free.model_variance)
    return moving


@kernel
def _force_and_bands(
    J: FloatArray, torque: FloatArray, mean: FloatArray, covariance: FloatArray, away: FloatArray, wide: float,
    force: FloatArray, bands: FloatArray,
) -> None:  # fmt: skip
    """Write force (3,) and bands (6, 3) of `SampleTest`, of torques (n,) and of the mean in free motion.

    With the damped inverse W of J^T the force is W tau, and its variance diag(W C W^T). The bands are `wide` deviations
    about the mean: sqrt(2 ln A), where a single Gaussian's likelihood ratio, exp(z^2 / 2), is A.
    """
    n = len(torque)
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
