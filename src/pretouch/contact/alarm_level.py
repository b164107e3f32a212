"""The level that ln R must pass to be a contact, and the force at the end-effector that is found at it.

**The level** is the proven bound, less what the arm's own free motion leaves it. Markov's inequality bounds how often R
passes A in free motion that is as learnt (`sequential`). Of an arm whose free motion the model describes well, the
largest ln R of a quarter of a second stay far below that, and of one that rings and sticks they do not. Maxima of many
samples are Gumbel's (Fisher and Tippett 1928): two quantiles of them, followed online with nothing near, say from which
level on one in so many hours lies above. The level is that, between the bound and `slack_nats` below it: neither a
person's touches nor a year of alarms can raise it further.

**The force** says in newtons how well free motion is known. A force f at the end-effector adds J^T f to the mean z of a
window, and so f^T G f with G = J S^-1 J^T to z^T S^-1 z. Solved for the likelihood ratio of an alarm, this gives the
force: of all its directions the one in which the torques tell least of it. Evidence by something near, by a touch or by
other windows comes on top.
"""

import math

import numpy as np

from pretouch.cholesky import factor, forward, largest_eigenvalue
from pretouch.compiled import kernel
from pretouch.contact.scatter import LENGTHS, REGIMES, FreeMeans, covariance_of_mean, spread_out
from pretouch.types import FloatArray

BLOCK = 25
"""Samples of which one maximum is taken."""
_MIDDLE, _HIGH = 0.8, 0.98
"""Parts of the maxima that lie below both quantiles. Lower ones say nothing of the tail: arms that stick and ring
differ from others in one maximum of fifty. Touches that no unit sees raise the level too, to the bound at most."""
_FIRST = (0.5, 2.5)
"""Both quantiles before anything is known: the level begins 5 nats below the bound. With all of `slack_nats` a real arm
that shook gave twice as many alarms in its first minute, and at the bound one sample of 60 N could be missed."""
_PRIOR, _MEMORY = 40.0, 600.0
"""Maxima that the first values count for, and over which the quantiles are averaged at most."""
_STEP, _STEP_HIGH = 4.0, 20.0
"""How far one maximum moves each quantile, relative to their distance and the average's weight."""
_LEAST = 0.5
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
def earned_level(seen: FloatArray, bound: float, slack: float, rate: float) -> float:
    """Return the level for one alarm in 1 / `rate` samples, from `bound` - `slack` to `bound` (both at least 1)."""
    # both quantiles of Gumbel's distribution give its scale and its location
    scale = max(seen[1] - seen[0], _LEAST) / (_GUMBEL_HIGH - _GUMBEL_MIDDLE)
    location = seen[0] - scale * _GUMBEL_MIDDLE
    # P(maximum > x) is about exp(-(x - location) / scale) far out
    level = location + scale * (_HEAVIER - math.log(rate * BLOCK))
    return max(1.0, min(max(level, bound - slack), bound))


@kernel
def learn_level(log_r: float, seen: FloatArray) -> None:
    """Take in one sample of free motion of a regime (5,)."""
    seen[2], seen[3] = max(seen[2], log_r), seen[3] + 1.0
    if seen[3] < BLOCK:
        return
    step = max(seen[1] - seen[0], _LEAST) / min(_PRIOR + seen[4], _MEMORY)
    # stochastic approximation: at rest where the part above each is as it should be (Robbins and Monro 1951)
    seen[0] += _STEP * step * ((seen[2] > seen[0]) - (1.0 - _MIDDLE))
    seen[1] += _STEP_HIGH * step * ((seen[2] > seen[1]) - (1.0 - _HIGH))
    seen[1] = max(seen[1], seen[0] + _LEAST)
    seen[2], seen[3], seen[4] = -np.inf, 0.0, seen[4] + 1.0


HELD_S = 0.1
"""For how long the force is there [s]."""
_SURE = 1.645
"""Deviations of the noise above what would do in half of all cases: so that it does in 95 % of them."""
_LENGTHS = np.array(LENGTHS)


@kernel
def detectable_force(J: FloatArray, period: float, free: FreeMeans, needed: float, gain: float, tails: float) -> float:
    """Return the force at the end-effector that the test finds in 95 of 100 cases if it is held for `HELD_S` [N].

    Args:
        J: (6, n) Jacobian of the end-effector.
        period: of control [s].
        free: the windows' means in free motion; the longest window within `HELD_S` counts.
        needed: ln of the likelihood ratio of one hypothesis in one window that is an alarm.
        gain: g, how much larger a contact's spread is than that of free motion.
        tails: degrees of freedom of the Student distribution.

    Returns:
        Infinite where no force is found.
    """
    k, n = 0, J.shape[1]
    while k + 1 < len(_LENGTHS) and _LENGTHS[k + 1] * period <= HELD_S:
        k += 1
    S, L, A, V = np.empty((n, n)), np.zeros((n, n)), np.empty((3, n)), np.zeros((3, 3))
    # a mean over less time has more noise, and one over more is not whole while the force lasts
    covariance_of_mean(free, k, S)
    if not factor(S, L):
        return np.inf
    if len(free.scatter):
        spread_out(free.scatter[k], L, np.empty((n, n)))
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
