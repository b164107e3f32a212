"""How free motion's residuals vary: more than white noise would have them, and most where the arm turns round.

**Windows.** What the features of free motion cannot express, friction with memory, a cable, a joint that rings, is the
same for many samples in a row: means over longer windows have more of it than S / N + U says. So the scatter of each
window's whitened means is learnt, with a prior at the identity, from all samples that nobody near can have caused. One
that stands out counts less, by Student's weight, and never nothing: a sample that is suspected of a contact is not left
out, for a scatter that leaves out what it does not expect shrinks until it expects nothing.

**Turning.** What accelerates hard is known only to a part, and what is wrong with it comes too early or too late. That
is the same for many samples in a row, so that it is variance of the mean and not noise. Each joint's variance is a
factor on how hard the arm accelerates, learnt with a prior (as `residual_model`), also where a contact is suspected: an
arm that gave an alarm because it turned round would do so for ever.
"""

from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor
from pretouch.compiled import kernel
from pretouch.types import FloatArray

LENGTHS = (1, 2, 4, 8, 16, 32)
"""Lengths of the windows [samples]."""
LONGEST = LENGTHS[-1]
_LENGTHS = np.array(LENGTHS)


class FreeMeans(NamedTuple):
    """What the windows' means are in free motion, and how those of a sample compare with it."""

    S: FloatArray
    """(n, n) spread of a sample [Nm^2]."""
    model_variance: FloatArray
    """(n,) variance of the error of their mean [Nm^2]: it does not average out."""
    scatter: FloatArray
    """(6, n + 2, n) how much more each window's means vary, see `scatter_init`; (0, ...): not at all, and nothing below
    is written."""
    whitened: FloatArray
    """(6, n) written: each window's mean, whitened by all but its scatter."""
    square: FloatArray
    """(6,) written: how far it stands out."""
    ratio: FloatArray
    """(6, n) written: the square of each joint's mean, over its variance by all but the scatter."""


REGIMES = 2
"""At rest in a posture that is learnt, and else: each with a scatter of its own."""
_PRIOR = 20.0
"""Means that the prior counts for."""
_LEAST = 0.5
"""Least scatter, of what is quieter than the model says."""
_LEAST_STRIDE = 8
"""Samples from one mean that is learnt to the next, of windows that are shorter."""


def scatter_init(n: int) -> FloatArray:
    """Return the scatters (REGIMES, 6, n + 2, n) of an arm that has learnt nothing.

    Each is (n, n) in the order of `judge`, the last joint first. Below it are the number of means learnt, and (n,) how
    much more each joint's mean varies by itself, the first joint first.
    """
    scatter = np.zeros((REGIMES, len(LENGTHS), n + 2, n))
    scatter[:, :, :n] = np.eye(n)
    scatter[:, :, n + 1] = 1.0
    return scatter


@kernel
def white_means(S: FloatArray, model_variance: FloatArray) -> FreeMeans:
    """Return means without a scatter: of noise (n, n) that is white, about a mean with variances (n,) [Nm^2]."""
    n = len(S)
    return FreeMeans(S, model_variance, np.zeros((0, n + 2, n)), np.zeros((0, n)), np.zeros(0), np.zeros((0, n)))


@kernel
def scattered_means(S: FloatArray, model_variance: FloatArray, scatter: FloatArray) -> FreeMeans:
    """Return means with a scatter (6, n + 2, n), and room for how those of a sample compare."""
    n, size = len(S), len(scatter)
    return FreeMeans(S, model_variance, scatter, np.zeros((size, n)), np.zeros(size), np.zeros((size, n)))


@kernel
def covariance_of_mean(free: FreeMeans, k: int, S0: FloatArray) -> None:
    """Write the lower triangle of the covariance (n, n) of window k's mean, the last joint first, but for its scatter.

    What the joints behind a link say is so the beginning of a whitened mean.
    """
    n = len(S0)
    for i in range(n):
        for j in range(i + 1):
            S0[i, j] = free.S[n - 1 - i, n - 1 - j] / _LENGTHS[k]
        # unlike the noise, not divided by the length of the window
        S0[i, i] += free.model_variance[n - 1 - i]


@kernel
def learn_scatter(at: int, whole: int, free: FreeMeans, tails: float, forget: float) -> None:
    """Learn from the means of the first `whole` windows; `at` counts samples.

    `forget` is the part by which one sample's time fades.
    """
    scatter, whitened, square, ratio = free.scatter, free.whitened, free.square, free.ratio
    n = whitened.shape[1]
    for k in range(whole):
        stride = max(_LENGTHS[k], _LEAST_STRIDE)
        # no sample is in two means of a long window: those that overlap would say the same twice
        if at % stride:
            continue
        trust = (tails + n) / (tails + square[k])
        # a mean with the prior at first, then one that fades
        gain = max(1.0 / (_PRIOR + scatter[k, n, 0]), stride * forget)
        scatter[k, n, 0] += 1.0
        for i in range(n):
            scatter[k, n + 1, i] += gain * (trust * ratio[k, i] - scatter[k, n + 1, i])
            for j in range(n):
                scatter[k, i, j] += gain * (trust * whitened[k, i] * whitened[k, j] - scatter[k, i, j])


@kernel
def spread_out(scatter: FloatArray, L: FloatArray, K: FloatArray) -> None:
    """Turn L (n, n), the factor of what white noise would be, into that with the scatter (n + 2, n), in place.

    L K has the covariance L (K K^T) L^T. `K` (n, n) is written: the factor of the scatter, no part below `_LEAST`, for
    what seems quieter than expected may only not have been seen yet.
    """
    n = len(L)
    C = scatter[:n].copy()
    for i in range(n):
        C[i, i] = max(C[i, i], _LEAST)
    # A larger diagonal leaves the matrix positive definite. Rounding alone could fail; then nothing is added.
    K[:] = 0.0
    if not factor(C, K):
        for i in range(n):
            K[i, i] = 1.0
    # the product of two lower triangles in place: from the left, for L[i, m] is read for m from j on only
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for m in range(j, i + 1):
                total += L[i, m] * K[m, j]
            L[i, j] = total


@kernel
def window_means(ring: FloatArray, at: int, count: int, means: FloatArray) -> int:
    """Write the means (6, n) of the newest 1, 2, ... 32 samples of a ring, and return how many of them are whole.

    `at` is where the next sample goes, `count` how many there are.
    """
    size, n = ring.shape
    total = np.zeros(n)
    taken = whole = 0
    for k in range(len(_LENGTHS)):
        if _LENGTHS[k] > count:
            break
        # a longer window goes on with the sum of the shorter one
        while taken < _LENGTHS[k]:
            taken += 1
            for j in range(n):
                total[j] += ring[(at - taken) % size, j]
        for j in range(n):
            means[k, j] = total[j] / taken
        whole += 1
    return whole


_DEVIATION = 0.3
"""Deviation of the factor before anything is learnt; its mean is 0."""
_MOST = 1.0
"""Largest factor: nothing is known of what accelerates."""
_MOST_NM2 = 25.0
"""Largest variance: joints that ring after 15 rad/s^2, the limit of the Panda's first, were wrong by up to 13 Nm,
and with 1 Nm^2 gave an alarm a minute [Nm^2]."""
_WINDOW = 2
_SAMPLES = LENGTHS[_WINDOW]
"""The window whose means say how large the factor is [samples]."""
_HARD_RAD_S2 = 2.0
"""Acceleration of a joint up to which it is known well enough [rad/s^2]."""
_KEEP = float(np.exp(-1.0 / 16.0))
"""What is left of hard acceleration after one sample: it is in the windows for some more."""
_FALL = 0.2
"""How much less what is smaller than expected counts: what comes too early or too late is large only for some samples,
and an expectile above the mean covers these (asymmetric least squares, Newey and Powell 1987)."""
_OUTLIER = 9.0
"""Times the expected square that a mean counts at most."""
_LEAST_NM2 = 0.05
"""Hard acceleration from which something is learnt of it [Nm^2]."""


def turning_init(n: int) -> FloatArray:
    """Return what is remembered (3, n) of an arm that has learnt nothing.

    How hard it has just accelerated, as the square of a torque [Nm^2], the factor on that, and the factor's variance.
    """
    return np.array([np.zeros(n), np.zeros(n), np.full(n, _DEVIATION**2)])


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


@kernel
def learn_turning(
    at: int, means: FloatArray, S: FloatArray, model_variance: FloatArray, forget: float, turning: FloatArray
) -> None:
    """Learn the factors from the excess of the means (6, n) of the windows over noise (n, n) and model variance (n,).

    `at` counts the samples: no sample is in two of the means. `forget` is the part by which one sample's time fades.
    """
    if at % _SAMPLES:
        return
    for j in range(len(model_variance)):
        x, value, variance = turning[0, j], turning[1, j], turning[2, j]
        # fading towards the prior by the time since the last mean
        variance += _SAMPLES * forget * (_DEVIATION**2 - variance)
        if x > _LEAST_NM2:
            expected = S[j, j] / _SAMPLES + model_variance[j]
            square = min(means[_WINDOW, j] ** 2, _OUTLIER * expected)
            # a scalar Kalman step: `expected` has the slope x, and the square of a Gaussian the variance 2 expected^2
            gain = variance * x / (variance * x**2 + 2.0 * expected**2)
            value += gain * (square - expected) * (1.0 if square > expected else _FALL)
            variance -= gain * x * variance
        turning[1, j] = min(max(value, 0.0), _MOST)
        turning[2, j] = variance
