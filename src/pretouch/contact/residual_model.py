"""What a robot's external torques are in free motion: a mean and a spread, learnt while nothing is near.

The mean of each joint's torque is linear in what physics gives (`features_into`): an offset, friction, and the gravity
of each link's error of mass. Its coefficients follow by recursive least squares with a prior, so that before anything
is learnt the mean is zero and uncertain.

The spread is S = M A M^T + D: the noise of the measured joint velocities enters an observer's torques through the mass
matrix M(q), so that it is correlated between the joints and turns with the posture; D is what each joint adds. The
variances A and D, diagonal, follow by expectation and maximisation, one small step a block, with an outlier counting
less (the weights of a Student distribution). How both are learnt: `learning`.

What accelerates hard is known only to a part, and what is wrong with it comes too early or too late (`turning`). That
is the same for many samples in a row, so that it is variance of the mean and not noise. Each joint's variance is a
factor on how hard the arm accelerates, learnt with a prior too, also where a contact is suspected: an arm that gave an
alarm because it turned round would do so for ever.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.contact.scatter import LONGEST, level_init, scatter_init
from pretouch.contact.sequential import MOST, Moment, alarm_bound
from pretouch.params import ProximityPriorParams, SequentialParams
from pretouch.records import IntCell, zeros
from pretouch.robot.kinematics import Kinematics, Mechanism, jacobian_into, mass_matrix_into, rotate
from pretouch.types import FloatArray, IntArray

BLOCK = 4
"""Samples that are learnt as one: their sums."""
QUEUE = 8
"""Blocks that wait: 0.3 s at 100 Hz."""
PLAIN = 4
"""Features before those of gravity."""
_SLOW, _FAST = 0.1, 0.3
"""Joint speeds over which friction turns round [rad/s]: between Coulomb's step and the 0.2 rad/s of a real Panda's."""
_GRAVITY = 9.81


class SequentialNumbers(NamedTuple):
    """What the sequential test is made with, of one arm and control period."""

    p: SequentialParams
    near: ProximityPriorParams
    period: float
    """Of control [s]."""
    delay: float
    """Part of the commanded velocities of the sample before that the torques still show."""
    bound: float
    """ln A of the test, see `alarm_bound`."""
    learns: int
    """Whether free motion is learnt: 0 never, 1 while a skin watches, 2 always."""
    objects: int
    """How many objects near add a hypothesis."""
    settle: int
    """Samples after which what lasts is learnt, 0 for never."""
    misfit_s: float
    """Memory of how windows' means vary, 0 where that is not learnt [s]."""
    prior: Annotated[FloatArray, "f"]
    """(f,) variances of the weights before anything is learnt [Nm^2]."""


class ResidualModel(NamedTuple):
    """What was learnt, and the samples that wait to be. n joints, f features."""

    weights: Annotated[FloatArray, "n", "f"]
    """(n, f) of the mean [Nm]."""
    covariance: Annotated[FloatArray, "n", "f", "f"]
    """(n, f, f) of the weights."""
    spread: Annotated[FloatArray, 2, 2, "n"]
    """(2, 2, n) standing and moving, each A [(rad/s^2)^2] and D [Nm^2]."""
    seen: Annotated[FloatArray, 2]
    """(2,) samples each of both was learnt from."""
    speed: Annotated[FloatArray, "n"]
    """(n,) commanded joint velocities as late as the torques [rad/s]."""
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
    """All that the sequential test remembers, and changes."""

    model: ResidualModel
    ring: Annotated[FloatArray, "R", "n"]
    """(32, n) newest residuals [Nm]."""
    at: IntCell
    """Where the next one goes."""
    samples: IntCell
    """How many there are."""
    calm: IntCell
    """Samples since a contact was suspected, something was near, or the arm reacted."""
    lasting: Annotated[FloatArray, "3 + n"]
    """(3 + n,) load or step of a joint's torque that explains a residual that stays, see `find_lasting`."""
    steady: IntCell
    """Samples that it has explained with nothing near, the arm reacting or a contact suspected; -1: it was learnt."""
    turning: Annotated[FloatArray, 3, "n"]
    """(3, n) how much worse free motion is known where the arm accelerates hard, see `turning_init`."""
    scatter: Annotated[FloatArray, 2, "W", "n + 2", "n"]
    """How much more the windows' means vary than white noise would, see `scatter_init`."""
    level: Annotated[FloatArray, 2, 5]
    """What the level of an alarm follows, see `level_init`."""
    settled: IntCell
    """Samples of free motion at rest."""


def features_of(n: int) -> int:
    """Count the features of a joint of an arm with n joints."""
    return PLAIN + n + 1


def prior_of(n: int, p: SequentialParams) -> FloatArray:
    """Variances (f,) of the weights before anything is learnt [Nm^2]."""
    friction = p.friction_prior_nm**2
    return np.array([p.offset_prior_nm**2, friction, friction, friction, *[p.mass_prior**2] * n, p.payload_prior_kg**2])


def residual_init(n: int, p: SequentialParams) -> ResidualModel:
    """Return the model that has learnt nothing: zero mean, wide spread."""
    spread = np.stack([np.full(n, p.velocity_prior_rad_s2**2), np.full(n, p.torque_prior_nm**2)])
    none: ResidualModel = zeros(ResidualModel, n=n, f=features_of(n), Q=QUEUE, b=block_size(n))
    return none._replace(covariance=np.tile(np.diag(prior_of(n, p)), (n, 1, 1)), spread=np.stack([spread, spread]))


def sequential_init(n: int, p: SequentialParams, learnt: ResidualModel | None = None) -> SequentialState:
    """Return the state of n joints before the first sample; `learnt` is what an earlier session knew of the arm."""
    none = np.zeros(1, np.int64)
    return SequentialState(
        residual_init(n, p) if learnt is None else learnt, np.zeros((LONGEST, n)), none, none, none, np.zeros(3 + n),
        none, turning_init(n), scatter_init(n), level_init(), none,
    )  # fmt: skip


def sequential_numbers(n: int, period: float, p: SequentialParams) -> SequentialNumbers:
    """Return what compiled code takes of the parameters, of n joints and a control period [s]."""
    near = p.proximity or ProximityPriorParams()  # without objects no number of it counts
    return SequentialNumbers(
        p.numbers, near.numbers, period, math.exp(-p.observer_gain_1_s * period),
        alarm_bound(p, period), ("never", "watched", "always").index(p.learn), MOST if p.proximity else 0,
        round(p.relearn_after_s / period) if p.learn != "never" else 0, p.misfit.memory_s if p.misfit else 0.0,
        prior_of(n, p),
    )  # fmt: skip


def block_size(n: int) -> int:
    """Count the numbers in a block of an arm with n joints."""
    return n + n * features_of(n) + 3 * n + 2


@compiled
def features_into(kin: Kinematics, mechanism: Mechanism, speed: FloatArray, growth: FloatArray, x: FloatArray) -> None:
    """Write features (n, f) of each joint's mean torque, at joint velocities [rad/s] that grow by `growth` [rad/s^2].

    1; tanh(qd / 0.1), tanh(qd / 0.3) and qd, friction that turns round smoothly; the torque of weight and inertia of
    the links behind each joint, as point masses [Nm], and that of 1 kg at the end-effector.
    """
    position, rotation, anchor, axis = kin
    moved_by, ee = mechanism.arm
    mass, com = mechanism.links.mass, mechanism.links.com
    n, point = len(speed), np.empty(3)
    J = np.empty((6, n))
    x[:] = 0.0
    for j in range(n):
        x[j, 0], x[j, 1], x[j, 2] = 1.0, np.tanh(speed[j] / _SLOW), np.tanh(speed[j] / _FAST)
        x[j, 3] = speed[j]
    for m in range(-1, len(mass)):  # -1: 1 kg at the end-effector, the payload
        last, link = PLAIN + n, m
        if m < 0:
            link = ee
            point[:] = position[ee]
        else:
            last = -1
            for j in range(n):
                if moved_by[m, j]:
                    last = PLAIN + j  # links that no joint parts share a feature, one relative error of mass
            if last < 0 or mass[m] <= 0.0:
                continue
            rotate(rotation[m], com[m], point)
            point += position[m]
        jacobian_into(anchor, axis, moved_by[link], point, J)
        # held against gravity, a mass is as if accelerated upwards; what the velocities add to it is left out
        ax, ay, az = 0.0, 0.0, _GRAVITY
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
    """One sample, and room for what free motion is in it."""

    torque: FloatArray
    """(n,) [Nm]."""
    residual: FloatArray
    """(n,) written: torques less their mean [Nm]."""
    speed: FloatArray
    """(n,) written: commanded joint velocities as late as the torques are [rad/s]."""
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
    """Write what free motion is in a sample, and the residual; of the state, note how hard the arm accelerates."""
    p, model, commanded, n = numbers.p, state.model, now.qd_commanded, len(now.qd)
    acceleration, covariance, variance = np.empty(n), sample.covariance, sample.model_variance
    # the observer that gives the torques is a low pass of the first order: the velocities go through the same
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
    if p.widen_at_turns:
        add_reversal_variance(sample.M, acceleration, state.turning, variance)


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
"""Deviation of the factor before anything is learnt; its mean is 0."""
_MOST_NM2 = 25.0
"""Largest variance: joints that ring after 15 rad/s^2, the limit of the Panda's first, were wrong by up to 13 Nm,
and with 1 Nm^2 gave an alarm a minute [Nm^2]."""
_HARD_RAD_S2 = 2.0
"""Acceleration of a joint up to which it is known well enough [rad/s^2]."""
_KEEP = float(np.exp(-1.0 / 16.0))
"""What is left of hard acceleration after one sample: it is in the windows for some more."""


def turning_init(n: int) -> FloatArray:
    """Return what is remembered (3, n) of an arm that has learnt nothing.

    How hard it has just accelerated, as the square of a torque [Nm^2], the factor on that, and the factor's variance.
    """
    return np.array([np.zeros(n), np.zeros(n), np.full(n, DEVIATION**2)])


@kernel
def add_reversal_variance(M: FloatArray, growth: FloatArray, turning: FloatArray, model_variance: FloatArray) -> None:
    """Take in how joint velocities grow (n,) [rad/s^2], and add to the variance (n,) [Nm^2] of the mean."""
    n = len(growth)
    for j in range(n):
        hard = 0.0
        for k in range(n):
            # the torque on joint j by the acceleration of joint k; of several the squares add up
            hard += (M[j, k] * max(0.0, abs(growth[k]) - _HARD_RAD_S2)) ** 2
        turning[0, j] = max(hard, _KEEP * turning[0, j])
        model_variance[j] += min(turning[1, j] * turning[0, j], _MOST_NM2)
