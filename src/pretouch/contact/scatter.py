"""Scatter of free motion's residuals beyond white noise, the level of an alarm, and the detectable force.

**Scatter.** Errors that the features of free motion cannot express, such as friction with memory, a cable or a ringing
joint, are the same for many successive samples: means over longer windows contain more of them than S / N + U. So the
scatter of each window's whitened means is learnt, with a prior at the identity, from all samples without anybody near.
An outlier has less weight, by Student's distribution, but never none, also with a suspected contact: a scatter that
leaves out unexpected samples shrinks until it expects none.

**The level** that ln R must exceed is the proven bound, less the margin of the arm's own free motion. Markov's
inequality bounds how often R exceeds A in free motion as learnt (`sequential`). For an arm with a good model of free
motion, the largest ln R in a quarter of a second stay far below that; for an arm that rings and sticks they do not.
Maxima of many samples have Gumbel's distribution (Fisher and Tippett 1928): two of their quantiles, updated online with
nothing near, give the level that one maximum in a number of hours exceeds. The level is between the bound and
`slack_nats` below it: neither a person's touches nor a year of alarms can raise it further.

**The detectable force** at the end-effector measures the model of free motion in newtons. A force f there adds J^T f to
the mean z of a window, and so f^T G f with G = J S^-1 J^T to z^T S^-1 z. Solved for the likelihood ratio of an alarm,
this gives the force, in the direction where the torques are least sensitive. Evidence by an obstacle, by a touch or by
other windows is not included.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor, forward, largest_eigenvalue
from pretouch.compiled import kernel
from pretouch.types import FloatArray

LENGTHS = (1, 2, 4, 8, 16, 32)
"""Lengths of the windows [samples]."""
LONGEST = LENGTHS[-1]


class WindowMeans(NamedTuple):
    """Means of the newest residuals over windows of each of `LENGTHS`, and their distribution in free motion."""

    mean: FloatArray
    """(6, n) [Nm]."""
    whole: int
    """Number of full windows."""
    S: FloatArray
    """(n, n) spread of a sample [Nm^2]."""
    model_variance: FloatArray
    """(n,) variance of the error of their mean [Nm^2]: it does not average out."""
    scatter: FloatArray
    """(6, n + 2, n) scatter of each window's means, see `scatter_init`."""
    whitened: FloatArray
    """(6, n) written: each window's mean, whitened by all but its scatter."""
    square: FloatArray
    """(6,) written: square of its whitened mean, with the scatter."""
    ratio: FloatArray
    """(6, n) written: the square of each joint's mean, over its variance by all but the scatter."""


REGIMES = 2
"""Regimes with a scatter of their own: at rest in a learnt posture, and otherwise."""
_PRIOR = 20.0
"""Weight of the prior, as a number of means."""
_LEAST = 0.5
"""Least scatter, for residuals that are quieter than in the model."""
_LEAST_STRIDE = 8
"""Samples from one mean to the next, for shorter windows."""


def scatter_init(n: int) -> FloatArray:
    """Return the scatters (REGIMES, 6, n + 2, n) before the first sample.

    Each is (n, n) in the order of `judge`, the last joint first. Below it are the number of means, and (n,) the scatter
    of each joint's mean alone, the first joint first.
    """
    scatter = np.zeros((REGIMES, len(LENGTHS), n + 2, n))
    scatter[:, :, :n] = np.eye(n)
    scatter[:, :, n + 1] = 1.0
    return scatter


@kernel
def means_in_free_motion(
    mean: FloatArray, whole: int, S: FloatArray, model_variance: FloatArray, scatter: FloatArray
) -> WindowMeans:
    """Return means of residuals with their distribution in free motion, and arrays for the comparison."""
    size, n = len(scatter), len(S)
    return WindowMeans(
        mean, whole, S, model_variance, scatter, np.zeros((size, n)), np.zeros(size), np.zeros((size, n))
    )


@kernel
def covariance_of_mean(means: WindowMeans, k: int, S0: FloatArray) -> None:
    """Write the lower triangle of the covariance (n, n) of window k's mean, the last joint first, without its scatter.

    So the joints behind a link are the beginning of a whitened mean.
    """
    n = len(S0)
    for i in range(n):
        for j in range(i + 1):
            S0[i, j] = means.S[n - 1 - i, n - 1 - j] / LENGTHS[k]
        # unlike the noise, not divided by the length of the window
        S0[i, i] += means.model_variance[n - 1 - i]


@kernel
def learn_scatter(at: int, means: WindowMeans, tails: float, forget: float) -> None:
    """Learn from the means of full windows; `at` counts samples, `forget` is the part that fades with each."""
    scatter, whitened, square, ratio = means.scatter, means.whitened, means.square, means.ratio
    n = whitened.shape[1]
    for k in range(means.whole):
        stride = max(LENGTHS[k], _LEAST_STRIDE)
        # no sample is in two means of a long window: overlapping means would count twice
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
    """Turn L (n, n), the factor for white noise, into that with the scatter (n + 2, n), in place.

    L K has the covariance L (K K^T) L^T. `K` (n, n) is written: the factor of the scatter, with no part below `_LEAST`,
    because quiet residuals may only be too few yet.
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
    """Write the means (6, n) of the newest 1, 2, ... 32 samples of a ring, and return the number of full windows.

    `at` is the index of the next sample, `count` the number of samples.
    """
    size, n = ring.shape
    total = np.zeros(n)
    samples = whole = 0
    for k in range(len(LENGTHS)):
        if LENGTHS[k] > count:
            break
        # a longer window continues the sum of the shorter one
        while samples < LENGTHS[k]:
            samples += 1
            for j in range(n):
                total[j] += ring[(at - samples) % size, j]
        for j in range(n):
            means[k, j] = total[j] / samples
        whole += 1
    return whole


MAXIMUM_OF = 25
"""Samples for one maximum."""
_MIDDLE, _HIGH = 0.8, 0.98
"""Parts of the maxima below both quantiles. Lower ones say nothing about the tail: arms that stick and ring differ from
others in one maximum of fifty. Touches that no unit sees raise the level too, to the bound at most."""
_FIRST = (0.5, 2.5)
"""Initial quantiles: the level begins 5 nats below the bound. With all of `slack_nats` a shaking real arm gave twice as
many alarms in its first minute, and at the bound the test could miss one sample of 60 N."""
_PRIOR_MAXIMA, _MEMORY = 40.0, 600.0
"""Weight of the initial values, and largest length of the quantiles' average [maxima]."""
_STEP, _STEP_HIGH = 4.0, 20.0
"""Step of each quantile by one maximum, relative to their distance and the average's weight."""
_LEAST_APART = 0.5
"""Least distance of the quantiles: with less they would not move."""
_HEAVIER = 1.0
"""Scales added to the level: the maxima are a mixture of speeds and postures, with a heavier tail than its middle."""
_GUMBEL_MIDDLE, _GUMBEL_HIGH = -math.log(-math.log(_MIDDLE)), -math.log(-math.log(_HIGH))
"""Both quantiles of the standard Gumbel distribution."""


def level_init() -> FloatArray:
    """Return the (REGIMES, 5) memory before the first sample.

    For each regime: both quantiles, the largest ln R of the present block, its samples, and the number of blocks.
    """
    return np.tile([*_FIRST, 0.0, 0.0, 0.0], (REGIMES, 1))


@kernel
def earned_level(maxima: FloatArray, bound: float, slack: float) -> float:
    """Return the level for one alarm in exp(`bound`) samples, from `bound` - `slack` to `bound` (both at least 1)."""
    # both quantiles of Gumbel's distribution give its scale and its location
    scale = max(maxima[1] - maxima[0], _LEAST_APART) / (_GUMBEL_HIGH - _GUMBEL_MIDDLE)
    location = maxima[0] - scale * _GUMBEL_MIDDLE
    # P(maximum > x) is about exp(-(x - location) / scale) far out
    level = location + scale * (_HEAVIER + bound - math.log(MAXIMUM_OF))
    return max(1.0, min(max(level, bound - slack), bound))


@kernel
def learn_level(log_r: float, maxima: FloatArray) -> None:
    """Add one sample of free motion to the memory of its regime (5,)."""
    maxima[2], maxima[3] = max(maxima[2], log_r) if maxima[3] else log_r, maxima[3] + 1.0
    if maxima[3] < MAXIMUM_OF:
        return
    step = max(maxima[1] - maxima[0], _LEAST_APART) / min(_PRIOR_MAXIMA + maxima[4], _MEMORY)
    # stochastic approximation: stationary where the part above each is right (Robbins and Monro 1951)
    maxima[0] += _STEP * step * ((maxima[2] > maxima[0]) - (1.0 - _MIDDLE))
    maxima[1] += _STEP_HIGH * step * ((maxima[2] > maxima[1]) - (1.0 - _HIGH))
    maxima[1] = max(maxima[1], maxima[0] + _LEAST_APART)
    maxima[3], maxima[4] = 0.0, maxima[4] + 1.0


HELD_S = 0.1
"""Duration of the force [s]."""
_SURE = 1.725
"""Deviations above the force for half of all cases: 95 % of Student's, with the default `tails` of 20, are below."""


@kernel
def detectable_force(
    J: FloatArray, period: float, means: WindowMeans, needed: float, gain: float, tails: float, rate: float
) -> float:
    """Return the force at the end-effector found in 95 of 100 cases if it lasts for `HELD_S` [N], infinite for none.

    Args:
        J: (6, n) Jacobian of the end-effector.
        period: of control [s].
        means: of residuals, with their distribution in free motion; the longest window within `HELD_S` counts.
        needed: ln of the likelihood ratio of one hypothesis in one window for an alarm.
        gain: g, ratio of a contact's spread to that of free motion.
        tails: degrees of freedom of the Student distribution.
        rate: gain of the observer [1/s], whose torques show the force late.
    """
    k, n = 0, J.shape[1]
    while k + 1 < len(LENGTHS) and LENGTHS[k + 1] * period <= HELD_S:
        k += 1
    S, L, A, V = np.empty((n, n)), np.zeros((n, n)), np.empty((3, n)), np.zeros((3, 3))
    # a shorter mean has more noise, and a longer window is not full while the force lasts
    covariance_of_mean(means, k, S)
    if not factor(S, L):
        return np.inf
    spread_out(means.scatter[k], L, np.empty((n, n)))
    for a in range(3):
        forward(L, J[a, ::-1].copy(), A[a])  # the last joint first
    for a in range(3):
        for b in range(3):
            for j in range(n):
                V[a, b] -= A[a, j] * A[b, j]
    least, squares, width = -largest_eigenvalue(V), _squares(needed, n, gain, tails), LENGTHS[k] * period
    # 1 - exp(-t rate) of the force is shown; its mean over the last window within `HELD_S`
    part = 1.0 - (math.exp(rate * (width - HELD_S)) - math.exp(-rate * HELD_S)) / (rate * width)
    return (math.sqrt(squares) + _SURE) / (part * math.sqrt(least)) if least > 0.0 else np.inf


@kernel
def _squares(needed: float, n: int, gain: float, tails: float) -> float:
    """Return the f^T G f from which the mean's likelihood ratio exceeds exp(`needed`).

    With c = g / (1 + g), z^T S^-1 z = T + n of which the force explains T + 3, the ratio of `log_ratio` has the root
    E = exp(2 (needed + 3/2 ln(1 + g)) / (nu + n)) = (nu + n + T) / (nu + n - 3 c + (1 - c) T), which is linear in T.
    """
    E, c = math.exp(2.0 * (needed + 1.5 * math.log1p(gain)) / (tails + n)), gain / (1.0 + gain)
    # with few degrees of freedom no residual is so large that it could not be an outlier
    slope = 1.0 - E * (1.0 - c)
    return max(0.0, (E * (tails + n - 3.0 * c) - tails - n) / slope) if slope > 0.0 else np.inf
