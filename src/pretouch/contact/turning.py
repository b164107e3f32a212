"""How much worse free motion is known where the arm turns round: a variance of the mean, learnt where needed.

What accelerates hard is known only to a part, and what is wrong with it comes too early or too late. That is the same
for many samples in a row, so that it is variance of the mean and not noise. Each joint's variance is a factor on how
hard the arm accelerates, learnt with a prior (as `residual_model`), also where a contact is suspected: an arm that gave
an alarm because it turned round would do so for ever.
"""

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.window_scatter import LENGTHS
from pretouch.types import FloatArray

_PRIOR = 0.3
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
    return np.array([np.zeros(n), np.zeros(n), np.full(n, _PRIOR**2)])


@compiled
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


@compiled
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
        variance += _SAMPLES * forget * (_PRIOR**2 - variance)
        if x > _LEAST_NM2:
            expected = S[j, j] / _SAMPLES + model_variance[j]
            square = min(means[_WINDOW, j] ** 2, _OUTLIER * expected)
            # a scalar Kalman step: `expected` has the slope x, and the square of a Gaussian the variance 2 expected^2
            gain = variance * x / (variance * x**2 + 2.0 * expected**2)
            value += gain * (square - expected) * (1.0 if square > expected else _FALL)
            variance -= gain * x * variance
        turning[1, j] = min(max(value, 0.0), _MOST)
        turning[2, j] = variance
