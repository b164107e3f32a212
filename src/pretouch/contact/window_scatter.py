"""How much more the means of the newest residuals vary in free motion than noise that is white would have them do.

What the features of free motion cannot express, friction with memory, a cable, a joint that rings, is the same for many
samples in a row: means over longer windows have more of it than S / N + U says. So the scatter of each window's
whitened means is learnt, with a prior at the identity, from all samples that nobody near can have caused. One that
stands out counts less, by Student's weight, and never nothing: a sample that is suspected of a contact is not left out,
for a scatter that leaves out what it does not expect shrinks until it expects nothing.
"""

from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor
from pretouch.compiled import compiled
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
_LENGTHS = np.array(LENGTHS)
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


def learns_scatter(at: int) -> bool:
    """Whether `learn_scatter` may change a scatter at this count of samples."""
    # the scatter is the largest part of the detector's state: it is copied only to be written
    return at % _LEAST_STRIDE == 0


@compiled
def white_means(S: FloatArray, model_variance: FloatArray) -> FreeMeans:
    """Return means without a scatter: of noise (n, n) that is white, about a mean with variances (n,) [Nm^2]."""
    n = len(S)
    return FreeMeans(S, model_variance, np.zeros((0, n + 2, n)), np.zeros((0, n)), np.zeros(0), np.zeros((0, n)))


@compiled
def scattered_means(S: FloatArray, model_variance: FloatArray, scatter: FloatArray) -> FreeMeans:
    """Return means with a scatter (6, n + 2, n), and room for how those of a sample compare."""
    n, size = len(S), len(scatter)
    return FreeMeans(S, model_variance, scatter, np.zeros((size, n)), np.zeros(size), np.zeros((size, n)))


@compiled
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


@compiled
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


@compiled
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


@compiled
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
