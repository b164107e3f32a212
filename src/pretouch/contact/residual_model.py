"""Model of a robot's external torques in free motion: a mean and a spread, learnt while nothing is near.

The mean of each joint's torque is linear in physical features (`features_into`): an offset, friction, and the gravity
of each link's error of mass. Its coefficients follow by recursive least squares with a prior: at the beginning the mean
is zero and uncertain.

The spread is S = M A M^T + D: the noise of the measured joint velocities enters an observer's torques through the mass
matrix M(q), so that it is correlated between the joints and turns with the posture; D is the noise of each joint. The
variances A and D, diagonal, follow by expectation and maximisation, one small step a block, with an outlier counting
less (the weights of a Student distribution). How both are learnt: `learning`.

The torque of a hard acceleration is known only in part, and its error comes too early or too late (`turning`). The
error is the same for many successive samples: it adds to the variance of the mean, not to the noise. Each joint's
variance is a factor on how hard the arm accelerates, learnt with a prior too, also where a contact is suspected: an arm
with a false alarm at a reversal would repeat it for ever.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.contact.scatter import LENGTHS, LONGEST, level_init, scatter_init
from pretouch.contact.sequential import Moment, alarm_bound
from pretouch.params import ProximityPriorParams, SequentialParams
from pretouch.records import IntCell, zeros
from pretouch.robot.kinematics import G_M_S2, Kinematics, Mechanism, jacobian_into, mass_matrix_into, rotate
from pretouch.types import FloatArray, IntArray

BLOCK = 4
"""Samples that are learnt together, as their sums."""
QUEUE = 8
"""Blocks in the queue: 0.3 s at 100 Hz."""
PLAIN = 5
"""Features before those of gravity."""
RESTING = 4
"""Feature of the friction at rest, see `learning`."""
_SLOW, _FAST = 0.1, 0.3
"""Joint speeds over which friction reverses [rad/s]: between Coulomb's step and the 0.2 rad/s of a real Panda's."""


class SequentialNumbers(NamedTuple):
    """Constants of the sequential test for one arm and control period."""

    p: SequentialParams
    near: ProximityPriorParams
    period: float
    """Control period [s]."""
    delay: float
    """Weight of the commanded velocities of the sample before in the torques."""
    bound: float
    """ln A of the test, see `alarm_bound`."""
    learns: int
    """Learning of free motion: 0 never, 1 while a skin watches, 2 always."""
    settle: int
    """Samples after which a lasting residual is learnt, 0 for never."""
    prior: Annotated[FloatArray, "f"]
    """(f,) prior variances of the weights [Nm^2]."""


class ResidualModel(NamedTuple):
    """The model of free motion, and the samples that wait to be learnt. n joints, f features."""

    weights: Annotated[FloatArray, "n", "f"]
    """(n, f) weights of the mean [Nm]."""
    covariance: Annotated[FloatArray, "n", "f", "f"]
    """(n, f, f) covariance of the weights."""
    spread: Annotated[FloatArray, 2, 2, "n"]
    """(2, 2, n) standing and moving, each A [(rad/s^2)^2] and D [Nm^2]."""
    seen: Annotated[FloatArray, 2]
    """(2,) number of samples of each; the file of a model has this name."""
    turning: Annotated[FloatArray, 3, "n"]
    """(3, n) further variance of the mean at hard accelerations, see `turning_init`."""
    scatter: Annotated[FloatArray, 2, "W", "m", "n"]
    """Scatter of the windows' means relative to that of white noise, see `scatter_init`."""
    level: Annotated[FloatArray, 2, 5]
    """Statistics for the level of an alarm, see `level_init`."""
    speed: Annotated[FloatArray, "n"]
    """(n,) commanded joint velocities, delayed as the torques [rad/s]."""
    queue: Annotated[FloatArray, "Q", "b"]
    """(QUEUE, b) blocks that wait: sums of torques, features, both variances and their weight, and the joints' spread,
    the last one whether the arm moved."""
    block: Annotated[FloatArray, "b"]
    """(b,) the block being filled."""
    filled: IntCell
    """Samples in it."""
    waiting: IntCell
    """Blocks in the queue, the oldest first."""


class SequentialState(NamedTuple):
    """Memory of the sequential test."""

    model: ResidualModel
    ring: Annotated[FloatArray, "R", "n"]
    """(32, n) newest residuals [Nm]."""
    at: IntCell
    """Index of the next residual."""
    samples: IntCell
    """Number of residuals."""
    calm: IntCell
    """Samples since a contact was suspected, something was near, or the arm reacted."""
    lasting: Annotated[FloatArray, "3 + n"]
    """(3 + n,) load or step of a joint's torque that explains a lasting residual, see `find_lasting`."""
    steady: IntCell
    """Samples that it has explained without obstacles, in a reaction or with a suspected contact; -1: it is learnt."""
    settled: IntCell
    """Samples of free motion at rest."""


def features_of(n: int) -> int:
    """Count the features of a joint of an arm with n joints."""
    return PLAIN + n + 1


def prior_of(n: int, p: SequentialParams) -> FloatArray:
    """Return the prior variances (f,) of the weights [Nm^2]."""
    friction = p.friction_prior_nm**2
    plain = p.offset_prior_nm**2, friction, friction, friction, 2.0 / 3.0 * friction
    return np.array([*plain, *[p.mass_prior**2] * n, p.payload_prior_kg**2])


def residual_init(n: int, p: SequentialParams) -> ResidualModel:
    """Return the model before the first sample: zero mean, wide spread."""
    spread = np.stack([np.full(n, p.velocity_prior_rad_s2**2), np.full(n, p.torque_prior_nm**2)])
    none: ResidualModel = zeros(ResidualModel, n=n, m=n + 2, f=features_of(n), Q=QUEUE, b=block_size(n), W=len(LENGTHS))
    covariance, misfit = np.tile(np.diag(prior_of(n, p)), (n, 1, 1)), (turning_init(n), scatter_init(n), level_init())
    model = none._replace(covariance=covariance, spread=np.stack([spread, spread]))
    return model._replace(turning=misfit[0], scatter=misfit[1], level=misfit[2])


def sequential_init(n: int, p: SequentialParams, learnt: ResidualModel | None = None) -> SequentialState:
    """Return the state of n joints before the first sample; `learnt` is the model of an earlier session."""
    none = np.zeros(1, np.int64)
    model, ring, lasting = residual_init(n, p) if learnt is None else learnt, np.zeros((LONGEST, n)), np.zeros(3 + n)
    return SequentialState(model, ring, none, none, none, lasting, none, none)


def sequential_numbers(n: int, period: float, p: SequentialParams) -> SequentialNumbers:
    """Return the constants for compiled code, for n joints and a control period [s]."""
    near = (p.proximity or ProximityPriorParams()).numbers._replace(**{} if p.proximity else {"gain": 0.0})
    delay, bound = math.exp(-p.observer_gain_1_s * period), alarm_bound(p, period)
    learns = ("never", "watched", "always").index(p.learn)
    settle = round(p.relearn_after_s / period) if p.learn != "never" else 0
    return SequentialNumbers(p.numbers, near, period, delay, bound, learns, settle, prior_of(n, p))


def block_size(n: int) -> int:
    """Count the numbers in a block of an arm with n joints."""
    return n + n * features_of(n) + 3 * n + 2


@compiled
def features_into(kin: Kinematics, mechanism: Mechanism, speed: FloatArray, growth: FloatArray, x: FloatArray) -> None:
    """Write features (n, f) of each joint's mean torque, at joint velocities [rad/s] that grow by `growth` [rad/s^2].

    1; tanh(qd / 0.1), tanh(qd / 0.3), qd and 1 - tanh(qd / 0.1)^2, friction in motion and at rest; the torque of weight
    and inertia of the links behind each joint, as point masses [Nm], and that of 1 kg at the end-effector.
    """
    position, rotation, anchor, axis = kin
    moved_by, ee = mechanism.arm
    mass, com = mechanism.links.mass, mechanism.links.com
    n, point, up = len(speed), np.empty(3), mechanism.upright[2]
    J = np.empty((6, n))
    x[:] = 0.0
    for j in range(n):
        x[j, 0], x[j, 1], x[j, 2] = 1.0, np.tanh(speed[j] / _SLOW), np.tanh(speed[j] / _FAST)
        x[j, 3], x[j, RESTING] = speed[j], 1.0 - x[j, 1] ** 2
    for m in range(-1, len(mass)):  # -1: 1 kg at the end-effector, the payload
        last, link = PLAIN + n, m
        if m < 0:
            link = ee
            point[:] = position[ee]
        else:
            last = -1
            for j in range(n):
                if moved_by[m, j]:
                    last = PLAIN + j  # links without a joint between them share a feature, one relative error of mass
            if last < 0 or mass[m] <= 0.0:
                continue
            rotate(rotation[m], com[m], point)
            point += position[m]
        jacobian_into(anchor, axis, moved_by[link], point, J)
        # gravity acts as an upward acceleration of the mass; the terms of the velocities are left out
        ax, ay, az = G_M_S2 * up[0], G_M_S2 * up[1], G_M_S2 * up[2]
        for j in range(n):
            ax, ay, az = ax + J[0, j] * growth[j], ay + J[1, j] * growth[j], az + J[2, j] * growth[j]
        for j in range(n):  # by the load on the joints: -J^T (g + J qdd)
            torque = -(J[0, j] * ax + J[1, j] * ay + J[2, j] * az)
            x[j, last] += (1.0 if m < 0 else mass[m]) * torque


@kernel
def mean_and_variance(
    weights: FloatArray, covariance: FloatArray, x: FloatArray, mean: FloatArray, model_variance: FloatArray
) -> None:
    """Write the mean (n,) [Nm] of the torques with features x (n, f), and the variance of its error (n,) [Nm^2]."""
    n, f = x.shape
    for j in range(n):
        mean[j], model_variance[j] = 0.0, 0.0
        for a in range(f):
            if x[j, a] != 0.0:  # it is 0 for the links before the joint
                mean[j] += weights[j, a] * x[j, a]
                part = 0.0
                for b in range(f):
                    part += covariance[j, a, b] * x[j, b]
                model_variance[j] += x[j, a] * part


class FreeSample(NamedTuple):
    """One sample, and arrays for its free motion."""

    torque: FloatArray
    """(n,) [Nm]."""
    residual: FloatArray
    """(n,) written: torques less their mean [Nm]."""
    speed: FloatArray
    """(n,) written: commanded joint velocities, delayed as the torques [rad/s]."""
    x: FloatArray
    """(n, f) written: features."""
    M: FloatArray
    """(n, n) written: mass matrix [kg m^2]."""
    mean: FloatArray
    """(n,) written: of the torques [Nm]."""
    covariance: FloatArray
    """(n, n) written: of their noise [Nm^2]."""
    model_variance: FloatArray
    """(n,) written: variance of the error of the mean [Nm^2]."""
    moving: IntArray
    """(1,) written: 1 if the arm moves, or 0."""


@kernel
def describe_free_motion(
    now: Moment, state: SequentialState, numbers: SequentialNumbers, mechanism: Mechanism, sample: FreeSample
) -> None:
    """Write the free motion of a sample and the residual; note the hard accelerations in the state."""
    p, model, commanded, n = numbers.p, state.model, now.qd_commanded, len(now.qd)
    acceleration, covariance, variance = np.empty(n), sample.covariance, sample.model_variance
    # the observer of the torques is a low pass of the first order: the velocities pass the same filter
    for j in range(n):
        sample.speed[j] = numbers.delay * model.speed[j] + (1.0 - numbers.delay) * commanded[j]
        acceleration[j] = (sample.speed[j] - model.speed[j]) / numbers.period
        if abs(sample.speed[j]) > p.still_rad_s:
            sample.moving[0] = 1
    features_into(now.kin, mechanism, sample.speed, acceleration, sample.x)
    mean_and_variance(model.weights, model.covariance, sample.x, sample.mean, variance)
    mass_matrix_into(now.kin, mechanism, sample.M)
    spread_of_sample(sample.M, model.spread[sample.moving[0]], p.noise_floor_nm, covariance)
    for j in range(n):
        variance[j] += p.bias_floor_nm**2
        sample.residual[j] = sample.torque[j] - sample.mean[j]
    add_reversal_variance(sample.M, acceleration, model.turning, variance)


@kernel
def spread_of_sample(M: FloatArray, spread: FloatArray, floor: float, S: FloatArray) -> None:
    """Write S = M A M^T + D (n, n) [Nm^2], D not below the square of a floor [Nm]."""
    n = len(M)
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += M[i, k] * spread[0, k] * M[j, k]
            S[i, j] = total
            S[j, i] = total
        S[i, i] += spread[1, i] + floor**2


DEVIATION = 0.3
"""Prior deviation of the factor; its mean is 0."""
_MOST_NM2 = 25.0
"""Largest variance [Nm^2]: joints that ring after 15 rad/s^2, the limit of the Panda's first, had errors up to 13 Nm,
and with 1 Nm^2 gave an alarm a minute."""
_HARD_RAD_S2 = 2.0
"""Acceleration of a joint up to which its torque is well known [rad/s^2]."""
_KEEP = float(np.exp(-1.0 / 16.0))
"""Part of a hard acceleration that remains after one sample: it stays in the windows for some more."""


def turning_init(n: int) -> FloatArray:
    """Return the memory of hard accelerations (3, n) before the first sample.

    It has the size of the last accelerations, as the square of a torque [Nm^2], the factor on that, and the variance
    of the factor.
    """
    return np.array([np.zeros(n), np.zeros(n), np.full(n, DEVIATION**2)])


@kernel
def add_reversal_variance(M: FloatArray, growth: FloatArray, turning: FloatArray, model_variance: FloatArray) -> None:
    """Note the growth of the joint velocities (n,) [rad/s^2], and add to the variance (n,) [Nm^2] of the mean."""
    n = len(growth)
    for j in range(n):
        hard = 0.0
        for k in range(n):
            # the torque on joint j by the acceleration of joint k; of several the squares add up
            hard += (M[j, k] * max(0.0, abs(growth[k]) - _HARD_RAD_S2)) ** 2
        turning[0, j] = max(hard, _KEEP * turning[0, j])
        model_variance[j] += min(turning[1, j] * turning[0, j], _MOST_NM2)
