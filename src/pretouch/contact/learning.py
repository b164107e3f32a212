"""Learning of free motion: blocks of calm samples, recursive least squares, and the errors at hard accelerations.

Samples are learnt in blocks, as their sums. A block waits in a queue until `QUEUE` more are full, and a reaction or an
object that may touch empties the queue: the beginning of a contact that a unit sees is never learnt.

Friction at rest is a weight that is learnt anew at each stop. In motion friction follows the velocity; a joint that
stands holds any torque within the bounds of its friction F, and slides within a small way (presliding, Dahl 1968). So
at rest friction is a constant with the variance F^2 / 3 of an even distribution, which becomes another one over the way
of a motion (a process of Ornstein and Uhlenbeck). The commanded way counts, for motors push before a joint moves.
"""

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import kernel
from pretouch.contact.residual_model import (
    BLOCK,
    DEVIATION,
    QUEUE,
    RESTING,
    FreeSample,
    ResidualModel,
    SequentialNumbers,
    spread_of_sample,
)
from pretouch.contact.scatter import LENGTHS, WindowMeans
from pretouch.params import SequentialParams
from pretouch.types import FloatArray


@kernel
def least_squares_step(
    w: FloatArray, P: FloatArray, x: FloatArray, y: float, noise: float, prior: FloatArray, forget: float
) -> None:
    """Update the weights w (f,) and their covariance P (f, f) by one sample y = w . x + noise, in place.

    Recursive least squares; then P moves by the part `forget` towards the prior's diagonal, so that it stays between
    zero and the prior with any excitation (stabilised forgetting, Kulhavy and Zarrop 1993).
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


@kernel
def add_to_block(model: ResidualModel, sample: FreeSample, ratio: FloatArray, p: SequentialParams) -> None:
    """Add a sample to the block: torques, features, and both variances of the spread.

    With e = M v + d, of spread S = M A M^T + D, the sample's expectation of v_i^2 is (A M^T S^-1 e)_i^2 + A_i -
    A_i^2 (M^T S^-1 M)_ii, and that of d_i^2 alike with 1 in the place of M. The variance of the mean's error is in the
    sample but not in D. So many samples in a row as `ratio` (n,) say as much on the mean as one with white noise.
    """
    block, spread, variance = model.block, model.spread[sample.moving[0]], sample.model_variance
    (n, f), floor = sample.x.shape, p.noise_floor_nm
    S, L, y, z = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty(n)
    if model.filled[0] == 0:
        block[:] = 0.0
    spread_of_sample(sample.M, spread, floor, S)
    for i in range(n):
        S[i, i] += variance[i]
    if not factor(S, L):
        return
    trust = (p.tails + n) / (p.tails + forward(L, sample.residual, y))  # Student's weight, less than 1 for an outlier
    backward(L, y, z)
    unit, start = np.zeros(n), n + n * f
    for i in range(n):
        block[i] += sample.torque[i]
        for a in range(f):
            block[n + i * f + a] += sample.x[i, a]
        A, D, along = spread[0, i], spread[1, i] + floor**2 + variance[i], 0.0
        for j in range(n):
            along += sample.M[j, i] * z[j]
        block[start + i] += trust * (A * along) ** 2 + A - A * A * forward(L, sample.M[i], y)
        unit[i] = 1.0
        jitter = trust * (D * z[i]) ** 2 + D - D * D * forward(L, unit, y)
        unit[i] = 0.0
        block[start + n + i] += max(jitter - variance[i] - floor**2, 0.0)
        # an outlier counts less, and an error that lasts for many samples counts as one sample
        block[start + 2 * n + i] += S[i, i] / trust * max(1.0, ratio[i])
    block[-2] += 1.0
    block[-1] = sample.moving[0]  # a block has the kind of its last sample


STIRS_RAD_S = 0.002
"""Commanded joint speed from which an arm at rest starts: friction reverses before it counts as moving [rad/s]."""


@kernel
def slide(model: ResidualModel, commanded: FloatArray, period: float, way: float) -> None:
    """Forget the friction at rest over a `period` [s] at commanded joint velocities (n,) [rad/s], by `way` [rad].

    Samples that wait were measured with the constant before: they count for the new one as far as both are the same.
    """
    n, f = model.weights.shape
    for j in range(n):
        speed = max(abs(commanded[j]), abs(model.speed[j]))
        if speed <= STIRS_RAD_S:
            continue
        w, P, at = model.weights[j], model.covariance[j], n + j * f + RESTING
        # the mean square of F: both terms of friction at full speed, with their uncertainty
        square = (w[1] + w[2]) ** 2 + P[1, 1] + 2.0 * P[1, 2] + P[2, 2]
        keep = np.exp(-speed * period / way)
        new = (1.0 - keep * keep) * square / 3.0
        w[RESTING] *= keep
        for a in range(f):
            P[a, RESTING] *= keep
            P[RESTING, a] *= keep
        P[RESTING, RESTING] += new
        for k in range(model.waiting[0] + 1):
            block = model.queue[k] if k < model.waiting[0] else model.block
            block[n + n * f + 2 * n + j] += new * block[at] ** 2
            block[at] *= keep


@kernel
def queue_block(model: ResidualModel, numbers: SequentialNumbers) -> None:
    """Count a sample of the block; queue a full block, and learn the oldest one of a full queue."""
    # A slow contact is suspected late. By then its first samples are in the queue, which is then emptied.
    queue = model.queue
    model.filled[0] += 1
    if model.filled[0] < BLOCK:
        return
    model.filled[0] = 0
    if model.waiting[0] < QUEUE:
        queue[model.waiting[0]] = model.block
        model.waiting[0] += 1
        return
    learn_block(queue[0], model, numbers)
    queue[:-1] = queue[1:].copy()
    queue[-1] = model.block


_FIRST_S = 2.0
"""Time that the prior of the noise counts for [s]."""
_CEILING = 4.0
"""Largest standard deviation of the noise, as a factor on its prior."""


@kernel
def learn_block(block: FloatArray, model: ResidualModel, numbers: SequentialNumbers) -> None:
    """Learn a block of samples: weights by their mean torques and features, and one step of both variances."""
    p, period, weights, learnt = numbers.p, numbers.period, model.weights, model.seen
    n, f = weights.shape
    x, samples, start, k = np.empty(f), block[-2], n + n * f, int(block[-1])
    if samples <= 0.0:
        return
    # the part of the mean's knowledge that fades in the time of a block
    forget = BLOCK * period / p.memory_s
    for j in range(n):
        for a in range(f):
            x[a] = block[n + j * f + a] / samples
        noise = block[start + 2 * n + j] / samples**2  # of a mean: the sum of variances / N^2
        least_squares_step(weights[j], model.covariance[j], x, block[j] / samples, noise, numbers.prior, forget)
    learnt[k] += samples
    # a mean with the prior, then an exponential one
    gain = max(samples / (_FIRST_S / period + learnt[k]), BLOCK * period / p.spread_memory_s)
    for part in range(2):
        ceiling = (_CEILING * (p.torque_prior_nm if part else p.velocity_prior_rad_s2)) ** 2
        for j in range(n):
            new = block[start + part * n + j] / samples
            spread = model.spread[k, part, j]
            model.spread[k, part, j] = min(spread + gain * (new - spread), ceiling)


_MOST = 1.0
"""Largest factor: the torque of the acceleration is unknown."""
_WINDOW = 2
_SAMPLES = LENGTHS[_WINDOW]
"""Length of the window whose means determine the factor [samples]."""
_FALL = 0.2
"""Weight of a smaller square than expected: a torque that comes too early or too late is large only for some samples,
and an expectile above the mean covers these (asymmetric least squares, Newey and Powell 1987)."""
_OUTLIER = 9.0
"""Largest square of a mean, as a factor on the expected one."""
_LEAST_NM2 = 0.05
"""Hard acceleration from which the factor is learnt [Nm^2]."""


@kernel
def learn_turning(at: int, means: WindowMeans, forget: float, turning: FloatArray) -> None:
    """Learn the factors of `turning_init` from the excess of the means over their expected size.

    `at` counts the samples: no sample is in two of the means. `forget` is the part that fades in the time of a sample.
    """
    if at % _SAMPLES:
        return
    for j in range(turning.shape[1]):
        x, value, variance = turning[0, j], turning[1, j], turning[2, j]
        # fading towards the prior by the time since the last mean
        variance += _SAMPLES * forget * (DEVIATION**2 - variance)
        if x > _LEAST_NM2:
            expected = means.S[j, j] / _SAMPLES + means.model_variance[j]
            square = min(means.mean[_WINDOW, j] ** 2, _OUTLIER * expected)
            # a scalar Kalman step: `expected` has the slope x, and the square of a Gaussian the variance 2 expected^2
            gain = variance * x / (variance * x**2 + 2.0 * expected**2)
            value += gain * (square - expected) * (1.0 if square > expected else _FALL)
            variance -= gain * x * variance
        turning[1, j] = min(max(value, 0.0), _MOST)
        turning[2, j] = variance
