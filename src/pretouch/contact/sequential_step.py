"""One sample of the sequential detector in one compiled call: free motion, the test against contacts, what is learnt.

With tau the external torques, x the features and w the weights of free motion, the residual is r = tau - w^T x. It has
the noise covariance C = M A M^T + D and the model's variance u = x^T P x, which does not average out
(`residual_model`). The test holds means of the newest residuals against contacts (`sequential`).
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry, inlined
from pretouch.contact.alarm_level import detectable_force, earned_level
from pretouch.contact.model_update import DetectionNumbers, Memory, Situation, Tested, update_model
from pretouch.contact.residual_model import CalmSample, features_into, mean_and_variance, spread_of_sample
from pretouch.contact.scatter import LONGEST, add_reversal_variance, scattered_means, white_means, window_means
from pretouch.contact.sequential import MOST, Hypotheses, NearPrior, force_map_into, judge, link_prior, write_hypotheses
from pretouch.groups import Kinematics, Mechanism, ObstacleArrays
from pretouch.robot.kinematics import jacobian_into, mass_matrix_into
from pretouch.types import FloatArray

_SETTLED_S = 10.0
"""Time at rest, as far as free motion is learnt in it, after which a posture's offsets count as learnt [s]."""
_STIRS_RAD_S = 0.002
"""Joint speed from which an arm at rest sets out: friction turns round before it counts as moving [rad/s]."""


class Joints(NamedTuple):
    """What is taken of `RobotState`."""

    qd: FloatArray
    qd_commanded: FloatArray
    tau_ext: FloatArray


class Results(NamedTuple):
    """Room for what a sample says, as of `SequentialDetection`, and for the velocities as late as the torques."""

    residual: FloatArray
    speed: FloatArray
    force: FloatArray
    bands: FloatArray
    means: FloatArray
    covariance: FloatArray
    model_variance: FloatArray


@entry
def detect_contact(
    robot: Joints, obstacles: ObstacleArrays, memory: Memory, now: Situation, p: DetectionNumbers, results: Results,
    kin: Kinematics, mechanism: Mechanism,
) -> tuple[float, float, int, int, int, int, int]:  # fmt: skip
    """Write what a sample says and what is learnt.

    Returns the log-likelihood ratio, the force that is found [N], what `update_model` does, and samples at rest.
    """
    arm, recent, n = mechanism.arm, memory.recent, len(robot.qd)
    covariance, means, distance = results.covariance, results.means, obstacles.body_distance
    x, M = np.empty((n, memory.learnt.weights.shape[1])), np.empty((n, n))
    free = _FreeMotion(results.speed, x, M, np.empty(n), covariance, results.model_variance)
    moving = _free_motion(robot.qd_commanded, memory, now, p, kin, mechanism, free)
    for j in range(n):
        results.residual[j] = robot.tau_ext[j] - free.mean[j]
        recent.ring[recent.at, j] = results.residual[j]

    # The test against contacts of each joint, of each link and of the nearest objects: R is the sum of prior weights
    # times likelihood ratios, A the level that it passes at the chosen rate of false alarms.
    whole = window_means(recent.ring, (recent.at + 1) % LONGEST, recent.held, means)
    most = len(mechanism.links.parts) + (min(MOST, len(distance)) if p.use_proximity else 0)
    contacts = Hypotheses(np.empty((most, 3, n)), np.empty(most, np.int64), np.empty(n + most), np.zeros((most, 3)))
    near = NearPrior(p.near_gain, p.near_m, p.near_horizon_s)
    write_hypotheses(kin, mechanism, robot.qd, obstacles, now.touch_gain, near, contacts)
    settled = 0 if np.abs(free.speed).max() > _STIRS_RAD_S else recent.settled
    # At rest the offsets of a posture are learnt in seconds; until then the arm errs as in motion. Time in which
    # nothing may be learnt, with somebody near, does not count.
    regime = 0 if settled * now.period >= _SETTLED_S else 1
    expected, ratio = white_means(covariance, results.model_variance), np.zeros(0)
    if p.learn_misfit:
        expected = scattered_means(covariance, results.model_variance, recent.scatter[regime])
        ratio = expected.scatter[-1, n + 1]
    log_r, window, which = judge(means, whole, expected, contacts, p.contact_gain, p.tails)
    level = max(1.0, now.bound - p.slack_nats)
    if p.learn_misfit:
        level = earned_level(recent.level[regime], now.bound, p.slack_nats, math.exp(-now.bound))
    log_likelihood_ratio = max(0.0, log_r / level)

    J_ee = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J_ee)
    found = detectable_force(J_ee, now.period, expected, level - link_prior(mechanism), p.contact_gain, p.tails)
    # nothing is learnt while anything that is seen could be what is measured
    alone = now.may_learn and distance.min() >= p.clear_m if len(distance) else now.may_learn
    sample = CalmSample(robot.tau_ext, x, results.residual, M, results.model_variance, moving, ratio)
    tested = Tested(
        sample, means, whole, expected, J_ee, alone, log_likelihood_ratio >= p.suspect, log_r, recent.level[regime]
    )  # fmt: skip
    calm, filled, waiting, steady = update_model(memory, now, p, tested)

    for j in range(n):  # only now: what is learnt is learnt of the noise alone
        covariance[j, j] += results.model_variance[j]
    # the first n hypotheses, wrenches beyond a joint, have no direction
    away = contacts.away[max(which - n, 0)] if which >= n else np.zeros(3)
    _force_and_bands(
        J_ee, means[window], free.mean, covariance, away, math.sqrt(2.0 * level), results.force, results.bands
    )  # fmt: skip
    if alone and not now.reacting:
        settled += 1
    return log_likelihood_ratio, found, calm, filled, waiting, steady, settled


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
    commanded: FloatArray, memory: Memory, now: Situation, p: DetectionNumbers, kin: Kinematics, mechanism: Mechanism,
    free: _FreeMotion,
) -> int:  # fmt: skip
    """Write mean, noise and uncertainty of the torques without a contact; return 1 if the arm moves, or 0.

    `commanded` (n,) are the joint velocities [rad/s].
    """
    learnt, before, moving, n = memory.learnt, memory.recent.speed, 0, len(commanded)
    acceleration = np.empty(n)
    # the observer that gives the torques is a low pass of the first order: the velocities go through the same
    for j in range(n):
        free.speed[j] = now.delay * before[j] + (1.0 - now.delay) * commanded[j]
        acceleration[j] = (free.speed[j] - before[j]) / now.period
        if abs(free.speed[j]) > p.still_rad_s:
            moving = 1
    features_into(kin, mechanism, free.speed, acceleration, free.x)
    mean_and_variance(learnt.weights, learnt.covariance, free.x, free.mean, free.model_variance)
    mass_matrix_into(kin, mechanism, free.M)
    spread_of_sample(free.M, learnt.spread[moving], p.noise_floor_nm, free.covariance)
    for j in range(n):
        free.model_variance[j] += p.bias_floor_nm**2
    if p.widen_at_turns:
        add_reversal_variance(free.M, acceleration, memory.recent.turning, free.model_variance)
    return moving


@compiled
def _force_and_bands(
    J: FloatArray, torque: FloatArray, mean: FloatArray, covariance: FloatArray, away: FloatArray, wide: float,
    force: FloatArray, bands: FloatArray,
) -> None:  # fmt: skip
    """Write force (3,) and bands (6, 3) of `SequentialDetection`, of torques (n,) and of the mean in free motion.

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
