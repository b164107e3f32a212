"""What a robot's external torques are in free motion: a mean and a spread, learnt while nothing is near.

The mean of each joint's torque is linear in what physics gives (see `features`): an offset, friction, and the gravity
of each link's error of mass. Its coefficients follow by recursive least squares with a prior, so that before anything
is learnt the mean is zero and uncertain.

The spread is S = M A M^T + D: the noise of the measured joint velocities enters an observer's torques through the mass
matrix M(q), so that it is correlated between the joints and turns with the posture; D is what each joint adds. The
variances A and D, diagonal, follow by expectation and maximisation, one small step a block, with an outlier counting
less (the weights of a Student distribution).

What is learnt waits in a queue of blocks for `QUEUE` of them, and the queue is emptied when a contact is suspected: the
beginning of a contact is never learnt.
"""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import compiled, kernel
from pretouch.errors import ParameterError
from pretouch.params import SequentialParams
from pretouch.records import IntCell
from pretouch.robot.kinematics import Kinematics, Mechanism, column
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray

BLOCK = 4
"""Samples that are learnt as one: their sums."""
QUEUE = 8
"""Blocks that wait: 0.3 s at 100 Hz."""
PLAIN = 4
"""Features before those of gravity."""
_SLOW, _FAST = 0.1, 0.3
"""Joint speeds over which friction turns round [rad/s]: between Coulomb's step and the 0.2 rad/s of a real Panda's."""
_GRAVITY = 9.81


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


def features_of(n: int) -> int:
    """Count the features of a joint of an arm with n joints."""
    return PLAIN + n + 1


def prior_of(n: int, p: SequentialParams) -> FloatArray:
    """Variances (f,) of the weights before anything is learnt [Nm^2]."""
    friction = p.friction_prior_nm**2
    return np.array([p.offset_prior_nm**2, friction, friction, friction, *[p.mass_prior**2] * n, p.payload_prior_kg**2])


def residual_init(n: int, p: SequentialParams) -> ResidualModel:
    """Return the model that has learnt nothing: zero mean, wide spread."""
    f, size = features_of(n), block_size(n)
    spread = np.stack([np.full(n, p.velocity_prior_rad_s2**2), np.full(n, p.torque_prior_nm**2)])
    return ResidualModel(
        weights=np.zeros((n, f)), covariance=np.tile(np.diag(prior_of(n, p)), (n, 1, 1)),
        spread=np.stack([spread, spread]), seen=np.zeros(2), speed=np.zeros(n),
        queue=np.zeros((QUEUE, size)), block=np.zeros(size),
        filled=np.zeros(1, np.int64), waiting=np.zeros(1, np.int64),
    )  # fmt: skip


def block_size(n: int) -> int:
    """Count the numbers in a block of an arm with n joints."""
    return n + n * features_of(n) + 3 * n + 2


def features(model: RobotModel, kin: Kinematics, speed: FloatArray, growth: FloatArray) -> FloatArray:
    """Features (n, f) of each joint's mean torque at joint velocities (n,) [rad/s] that grow by `growth` [rad/s^2].

    1; tanh(qd / 0.1), tanh(qd / 0.3) and qd, friction that turns round smoothly; the torque of weight and inertia of
    the links behind each joint, as point masses [Nm], and that of 1 kg at the end-effector.
    """
    x = np.empty((model.n, features_of(model.n)))
    features_into(kin, model.mechanism, speed, growth, x)
    return x


@compiled
def features_into(kin: Kinematics, mechanism: Mechanism, speed: FloatArray, growth: FloatArray, x: FloatArray) -> None:
    """Write what `features` returns."""
    position, rotation, anchor, axis = kin
    moved_by, ee = mechanism.arm
    mass, com = mechanism.links.mass, mechanism.links.com
    n, point = len(speed), np.empty(3)
    V, torque = np.empty((n, 3)), np.empty(n)
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
            for i in range(3):
                point[i] = position[m, i]
                for k in range(3):
                    point[i] += rotation[m, i, k] * com[m, k]
        _carried(anchor, axis, moved_by[link], point, growth, V, torque)
        for j in range(n):
            x[j, last] += (1.0 if m < 0 else mass[m]) * torque[j]


@kernel
def _carried(
    anchor: FloatArray, axis: FloatArray, moved: BoolArray, point: FloatArray, growth: FloatArray, V: FloatArray,
    torque: FloatArray,
) -> None:  # fmt: skip
    """Write the torques (n,) of weight and inertia of 1 kg at a point; `V` (n, 3) is overwritten."""
    ax, ay, az = 0.0, 0.0, _GRAVITY  # held against gravity, a mass is as if accelerated upwards
    for j in range(len(growth)):
        V[j] = 0.0
        if moved[j]:
            V[j, 0], V[j, 1], V[j, 2] = column(anchor, axis, j, point[0], point[1], point[2])
            # J qdd only: what the velocities add to the acceleration is left out
            ax, ay, az = ax + V[j, 0] * growth[j], ay + V[j, 1] * growth[j], az + V[j, 2] * growth[j]
    for j in range(len(growth)):
        torque[j] = -(V[j, 0] * ax + V[j, 1] * ay + V[j, 2] * az)  # by the load on the joints: -J^T (g + a)


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


@kernel
def least_squares_step(
    w: FloatArray, P: FloatArray, x: FloatArray, y: float, noise: float, prior: FloatArray, forget: float
) -> None:
    """Take one sample y = w . x + noise into the weights w (f,) and their covariance P (f, f), in place.

    Recursive least squares; then P moves by the part `forget` towards the prior's diagonal, so that it stays between
    nothing and the prior whatever is or is not excited (stabilised forgetting, Kulhavy and Zarrop 1993).
    """
    f, gain = len(w), np.zeros(len(w))
    total, error = noise, y
    for a in range(f):
        for b in range(f):
            gain[a] += P[a, b] * x[b]
        total += x[a] * gain[a]
        error -= w[a] * x[a]
    for a in range(f):
        w[a] += gain[a] / total * error  # gain = P x, total = x^T P x + noise
        for b in range(f):
            P[a, b] -= gain[a] * gain[b] / total
            P[a, b] *= 1.0 - forget
        P[a, a] += forget * prior[a]


class CalmSample(NamedTuple):
    """A sample of free motion."""

    torque: FloatArray
    """(n,) [Nm]."""
    x: FloatArray
    """(n, f) features."""
    residual: FloatArray
    """(n,) torques less their mean [Nm]."""
    M: FloatArray
    """(n, n) mass matrix [kg m^2]."""
    model_variance: FloatArray
    """(n,) variance of the error of the mean [Nm^2]."""
    moving: int
    """1 if the arm moves, or 0."""
    ratio: FloatArray
    """(n,) how many samples in a row say as much of the mean as one would of white noise; (0,): noise is white."""


@kernel
def add_sample(
    block: FloatArray, first: bool, sample: CalmSample, spread: FloatArray, tails: float, floor: float
) -> None:
    """Add a sample to a block, to an empty one if it is the first: torques, features, both variances of the spread.

    With e = M v + d, of spread S = M A M^T + D, the sample's expectation of v_i^2 is (A M^T S^-1 e)_i^2 + A_i -
    A_i^2 (M^T S^-1 M)_ii, and that of d_i^2 alike with 1 in the place of M. The variance of the mean's error is in the
    sample but not in D. `spread` (2, n) is A and D of samples of its kind.
    """
    torque, x, residual, M, model_variance, moving, ratio = sample
    n, f = x.shape
    S, L, y, z = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty(n)
    if first:
        block[:] = 0.0
    spread_of_sample(M, spread, floor, S)
    for i in range(n):
        S[i, i] += model_variance[i]
    if not factor(S, L):
        return
    trust = (tails + n) / (tails + forward(L, residual, y))  # Student's weight, less than 1 for an outlier
    backward(L, y, z)
    unit, start = np.zeros(n), n + n * f
    for i in range(n):
        block[i] += torque[i]
        for a in range(f):
            block[n + i * f + a] += x[i, a]
        A, D, along = spread[0, i], spread[1, i] + floor**2 + model_variance[i], 0.0
        for j in range(n):
            along += M[j, i] * z[j]
        block[start + i] += trust * (A * along) ** 2 + A - A * A * forward(L, M[i], y)
        unit[i] = 1.0
        jitter = trust * (D * z[i]) ** 2 + D - D * D * forward(L, unit, y)
        unit[i] = 0.0
        block[start + n + i] += max(jitter - model_variance[i] - floor**2, 0.0)
        # an outlier counts less, and what stays the same for many samples is one piece of news
        block[start + 2 * n + i] += S[i, i] / trust * max(1.0, ratio[i]) if len(ratio) else S[i, i]
    block[-2] += 1.0
    block[-1] = moving  # a block is of the kind of its last sample


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


class Learnt(NamedTuple):
    """What was learnt, as of `ResidualModel`, and the prior's variances (f,); changed."""

    weights: FloatArray
    covariance: FloatArray
    spread: FloatArray
    seen: FloatArray
    prior: FloatArray


class Pace(NamedTuple):
    """How fast is learnt."""

    forget: float
    """Part by which a block's time fades what was learnt of the mean."""
    least_gain: float
    """Weight of a block in the spread once many have been seen."""
    first: float
    """What the prior of the spread counts [samples]."""
    most_velocity: float
    """Largest variance A [(rad/s^2)^2]."""
    most_torque: float
    """Largest variance D [Nm^2]."""


@kernel
def learn_block(block: FloatArray, learnt: Learnt, pace: Pace) -> None:
    """Learn a block of samples: weights by their mean torques and features, and one step of both variances."""
    weights, covariance, spread, seen, prior = learnt
    n, f = weights.shape
    x, samples, start, k = np.empty(f), block[-2], n + n * f, int(block[-1])
    if samples <= 0.0:
        return
    for j in range(n):
        for a in range(f):
            x[a] = block[n + j * f + a] / samples
        noise = block[start + 2 * n + j] / samples**2  # of a mean: the sum of variances / N^2
        least_squares_step(weights[j], covariance[j], x, block[j] / samples, noise, prior, pace.forget)
    seen[k] += samples
    gain = max(samples / (pace.first + seen[k]), pace.least_gain)  # a mean with the prior, then an exponential one
    for part in range(2):
        ceiling = pace.most_torque if part else pace.most_velocity
        for j in range(n):
            new = block[start + part * n + j] / samples
            spread[k, part, j] = min(spread[k, part, j] + gain * (new - spread[k, part, j]), ceiling)


KEPT = ("weights", "covariance", "spread", "seen")
"""What is kept from one session to the next."""


def kept(model: ResidualModel) -> dict[str, FloatArray]:
    """Return what is to be kept of a model, by name."""
    return {name: getattr(model, name) for name in KEPT}


def resumed(numbers: dict[str, FloatArray], p: SequentialParams) -> ResidualModel:
    """Return a model with what was kept of an earlier one; one that could not be is a ParameterError.

    The covariances must be symmetric and positive definite, the variances and counts not below zero.
    """
    n = len(numbers["weights"])
    fresh = residual_init(n, p)
    for name in KEPT:
        if numbers[name].shape != getattr(fresh, name).shape or not np.isfinite(numbers[name]).all():
            raise ParameterError(f"What was learnt has {name} of the shape {numbers[name].shape}: learn it anew.")
    turned = numbers["covariance"].swapaxes(1, 2)
    if not np.array_equal(numbers["covariance"], turned) or np.linalg.eigvalsh(turned).min() <= 0.0:
        raise ParameterError("What was learnt has a covariance that is none: learn it anew.")
    if numbers["spread"].min() < 0.0 or numbers["seen"].min() < 0.0:
        raise ParameterError("What was learnt has a variance or a count below zero: learn it anew.")
    weights, covariance, spread, seen = (numbers[name].copy() for name in KEPT)
    return fresh._replace(weights=weights, covariance=covariance, spread=spread, seen=seen)
