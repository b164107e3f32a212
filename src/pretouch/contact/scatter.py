"""How means of free motion's residuals vary beyond white noise, the level of an alarm, and the force that is found.

**Scatter.** What the features of free motion cannot express, friction with memory, a cable, a joint that rings, is the
same for many samples in a row: means over longer windows have more of it than S / N + U says. So the scatter of each
window's whitened means is learnt, with a prior at the identity, from all samples that nobody near can have caused. One
that stands out counts less, by Student's weight, and never nothing: a sample that is suspected of a contact is not left
out, for a scatter that leaves out what it does not expect shrinks until it expects nothing.

**The level** that ln R must pass is the proven bound, less what the arm's own free motion leaves it. Markov's
inequality bounds how often R passes A in free motion that is as learnt (`sequential`). Of an arm whose free motion the
model describes well, the largest ln R of a quarter of a second stay far below that, and of one that rings and sticks
they do not. Maxima of many samples are Gumbel's (Fisher and Tippett 1928): two quantiles of them, followed online with
nothing near, say from which level on one in so many hours lies above. The level is that, between the bound and
`slack_nats` below it: neither a person's touches nor a year of alarms can raise it further.

**The force** at the end-effector that is found says in newtons how well free motion is known. A force f there adds
J^T f to the mean z of a window, and so f^T G f with G = J S^-1 J^T to z^T S^-1 z. Solved for the likelihood ratio of an
alarm, this gives the force: of all its directions the one in which the torques tell least of it. Evidence by something
near, by a touch or by other windows comes on top.
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
    """Means of the newest residuals over windows of each of `LENGTHS`, and what they are in free motion."""

    mean: FloatArray
    """(6, n) [Nm]."""
    whole: int
    """How many of the windows are full."""
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
def means_in_free_motion(
    mean: FloatArray, whole: int, S: FloatArray, model_variance: FloatArray, scatter: FloatArray
) -> WindowMeans:
    """Return means of residuals with what they are in free motion, and room for how both compare."""
    size, n = len(scatter), len(S)
    return WindowMeans(
        mean, whole, S, model_variance, scatter, np.zeros((size, n)), np.zeros(size), np.zeros((size, n))
    )


@kernel
def covariance_of_mean(means: WindowMeans, k: int, S0: FloatArray) -> None:
    """Write the lower triangle of the covariance (n, n) of window k's mean, the last joint first, but for its scatter.

    What the joints behind a link say is so the beginning of a whitened mean.
    """
    n = len(S0)
    for i in range(n):
        for j in range(i + 1):
            S0[i, j] = means.S[n - 1 - i, n - 1 - j] / LENGTHS[k]
        # unlike the noise, not divided by the length of the window
        S0[i, i] += means.model_variance[n - 1 - i]


@kernel
def learn_scatter(at: int, means: WindowMeans, tails: float, forget: float) -> None:
    """Learn from the means of full windows; `at` counts samples, each fades by the part `forget` in its time."""
    scatter, whitened, square, ratio = means.scatter, means.whitened, means.square, means.ratio
    n = whitened.shape[1]
    for k in range(means.whole):
        stride = max(LENGTHS[k], _LEAST_STRIDE)
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
    samples = whole = 0
    for k in range(len(LENGTHS)):
        if LENGTHS[k] > count:
            break
        # a longer window goes on with the sum of the shorter one
        while samples < LENGTHS[k]:
            samples += 1
            for j in range(n):
                total[j] += ring[(at - samples) % size, j]
        for j in range(n):
            means[k, j] = total[j] / samples
        whole += 1
    return whole


MAXIMUM_OF = 25
"""Samples of which one maximum is taken."""
_MIDDLE, _HIGH = 0.8, 0.98
"""Parts of the maxima that lie below both quantiles. Lower ones say nothing of the tail: arms that stick and ring
differ from others in one maximum of fifty. Touches that no unit sees raise the level too, to the bound at most."""
_FIRST = (0.5, 2.5)
"""Both quantiles before anything is known: the level begins 5 nats below the bound. With all of `slack_nats` a real arm
that shook gave twice as many alarms in its first minute, and at the bound one sample of 60 N could be missed."""
_PRIOR_MAXIMA, _MEMORY = 40.0, 600.0
"""Maxima that the first values count for, and over which the quantiles are averaged at most."""
_STEP, _STEP_HIGH = 4.0, 20.0
"""How far one maximum moves each quantile, relative to their distance and the average's weight."""
_LEAST_APART = 0.5
"""Least distance of the quantiles: with less they would stand still."""
_HEAVIER = 1.0
"""Scales that are added: the maxima are a mixture of speeds and postures, whose tail is heavier than its middle."""
_GUMBEL_MIDDLE, _GUMBEL_HIGH = -math.log(-math.log(_MIDDLE)), -math.log(-math.log(_HIGH))
"""Both quantiles of the standard Gumbel distribution."""


def level_init() -> FloatArray:
    """Return the (REGIMES, 5) memory of an arm of which nothing is known.

    Of each regime both quantiles, the largest ln R of the block so far, samples in it, and blocks seen.
    """
    return np.tile([*_FIRST, -np.inf, 0.0, 0.0], (REGIMES, 1))


@kernel
def earned_level(seen: FloatArray, bound: float, slack: float) -> float:
    """Return the level for one alarm in exp(`bound`) samples, from `bound` - `slack` to `bound` (both at least 1)."""
    # both quantiles of Gumbel's distribution give its scale and its location
    scale = max(seen[1] - seen[0], _LEAST_APART) / (_GUMBEL_HIGH - _GUMBEL_MIDDLE)
    location = seen[0] - scale * _GUMBEL_MIDDLE
    # P(maximum > x) is about exp(-(x - location) / scale) far out
    level = location + scale * (_HEAVIER + bound - math.log(MAXIMUM_OF))
    return max(1.0, min(max(level, bound - slack), bound))


@kernel
def learn_level(log_r: float, seen: FloatArray) -> None:
    """Take in one sample of free motion of a regime (5,)."""
    seen[2], seen[3] = max(seen[2], log_r), seen[3] + 1.0
    if seen[3] < MAXIMUM_OF:
        return
    step = max(seen[1] - seen[0], _LEAST_APART) / min(_PRIOR_MAXIMA + seen[4], _MEMORY)
    # stochastic approximation: at rest where the part above each is as it should be (Robbins and Monro 1951)
    seen[0] += _STEP * step * ((seen[2] > seen[0]) - (1.0 - _MIDDLE))
    seen[1] += _STEP_HIGH * step * ((seen[2] > seen[1]) - (1.0 - _HIGH))
    seen[1] = max(seen[1], seen[0] + _LEAST_APART)
    seen[2], seen[3], seen[4] = -np.inf, 0.0, seen[4] + 1.0


HELD_S = 0.1
"""For how long the force is there [s]."""
_SURE = 1.645
"""Deviations of the noise above what would do in half of all cases: so that it does in 95 % of them."""


@kernel
def detectable_force(
    J: FloatArray, period: float, means: WindowMeans, needed: float, gain: float, tails: float
) -> float:
    """Return the force at the end-effector that the test finds in 95 of 100 cases if it is held for `HELD_S` [N].

    Args:
        J: (6, n) Jacobian of the end-effector.
        period: of control [s].
        means: of residuals, and what they are in free motion; the longest window within `HELD_S` counts.
        needed: ln of the likelihood ratio of one hypothesis in one window that is an alarm.
        gain: g, how much larger a contact's spread is than that of free motion.
        tails: degrees of freedom of the Student distribution.

    Returns:
        Infinite where no force is found.
    """
    k, n = 0, J.shape[1]
    while k + 1 < len(LENGTHS) and LENGTHS[k + 1] * period <= HELD_S:
        k += 1
    S, L, A, V = np.empty((n, n)), np.zeros((n, n)), np.empty((3, n)), np.zeros((3, 3))
    # a mean over less time has more noise, and one over more is not whole while the force lasts
    covariance_of_mean(means, k, S)
    if not factor(S, L):
        return np.inf
    if len(means.scatter):
        spread_out(means.scatter[k], L, np.empty((n, n)))
    for a in range(3):
        forward(L, J[a, ::-1].copy(), A[a])  # the last joint first
    for a in range(3):
        for b in range(3):
            for j in range(n):
                V[a, b] -= A[a, j] * A[b, j]
    least, squares = -largest_eigenvalue(V), _squares(needed, n, gain, tails)
    return (math.sqrt(squares) + _SURE) / math.sqrt(least) if least > 0.0 else np.inf


@kernel
def _squares(needed: float, n: int, gain: float, tails: float) -> float:
    """Return the f^T G f from which on the mean's likelihood ratio passes exp(`needed`).

    With c = g / (1 + g), z^T S^-1 z = T + n of which the force explains T + 3, the ratio of `log_ratio` has the root
    E = exp(2 (needed + 3/2 ln(1 + g)) / (nu + n)) = (nu + n + T) / (nu + n - 3 c + (1 - c) T), which is linear in T.
    """
    E, c = math.exp(2.0 * (needed + 1.5 * math.log1p(gain)) / (tails + n)), gain / (1.0 + gain)
    # with few degrees of freedom no residual is so large that it could not be an outlier
    slope = 1.0 - E * (1.0 - c)
    return max(0.0, (E * (tails + n - 3.0 * c) - tails - n) / slope) if slope > 0.0 else np.inf
