"""The level that ln R must pass to be a contact: the proven bound, less what the arm's own free motion leaves it.

Markov's inequality bounds how often R passes A in free motion that is as learnt (`sequential`). Of an arm whose free
motion the model describes well, the largest ln R of a quarter of a second stay far below that, and of one that rings
and sticks they do not. Maxima of many samples are Gumbel's (Fisher and Tippett 1928): two quantiles of them, followed
online with nothing near, say from which level on one in so many hours lies above. The level is that, between the bound
and `slack_nats` below it: neither a person's touches nor a year of alarms can raise it further.
"""

import math

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.window_scatter import REGIMES
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


@compiled
def earned_level(seen: FloatArray, bound: float, slack: float, rate: float) -> float:
    """Return the level for one alarm in 1 / `rate` samples, from `bound` - `slack` to `bound` (both at least 1)."""
    # both quantiles of Gumbel's distribution give its scale and its location
    scale = max(seen[1] - seen[0], _LEAST) / (_GUMBEL_HIGH - _GUMBEL_MIDDLE)
    location = seen[0] - scale * _GUMBEL_MIDDLE
    # P(maximum > x) is about exp(-(x - location) / scale) far out
    level = location + scale * (_HEAVIER - math.log(rate * BLOCK))
    return max(1.0, min(max(level, bound - slack), bound))


@compiled
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
