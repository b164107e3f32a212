"""Which mean of the newest residuals stands out most from free motion, and the covariance that it has there."""

import numpy as np

from pretouch.cholesky import factor, forward
from pretouch.compiled import compiled
from pretouch.contact.sequential_detector import ResidualWindows
from pretouch.contact.window_scatter import LENGTHS
from pretouch.params import LocalisationParams
from pretouch.types import FloatArray

_LENGTHS = np.array(LENGTHS)


def independent_part(period: float, p: LocalisationParams) -> float:
    """Part of a sample, one a period [s], whose noise is not that of the samples before."""
    return min(1.0, period / p.independent_s)


def most_significant_mean(
    windows: ResidualWindows, period: float, p: LocalisationParams
) -> tuple[FloatArray, FloatArray] | None:
    """Return the mean (n,) that stands out most [Nm], and its covariance (n, n) in free motion [Nm^2].

    None where the covariance is not positive definite, or there are no samples.
    """
    covariance = np.empty_like(windows.covariance)
    window, _ = most_significant(windows, independent_part(period, p), 0.0, covariance)
    return None if window < 0 else (windows.means[window], covariance)


@compiled
def most_significant(windows: ResidualWindows, independent: float, relative: float, S: FloatArray) -> tuple[int, float]:
    """Return the window with the largest z^T S^-1 z of its mean z, and that value; -1 where there is none.

    `independent` is the part of a sample that says something new. `S` (n, n) is written: the covariance of that mean,
    with an error of the part `relative` of each joint's torque.
    """
    # z^T S^-1 z grows with the window while the torques last, and falls once it holds samples from before the contact
    n = len(windows.model_variance)
    L, y, best, window = np.zeros((n, n)), np.empty(n), 0.0, -1
    for k in range(len(_LENGTHS)):
        if _LENGTHS[k] > windows.samples:
            break
        # without the relative error, which would make every large mean stand out alike
        _covariance_of_mean(windows, k, independent, 0.0, S)
        if factor(S, L):
            square = forward(L, windows.means[k], y)
            if square > best:
                best, window = square, k
    if window >= 0:
        _covariance_of_mean(windows, window, independent, relative, S)
    return window, best


@compiled
def _covariance_of_mean(windows: ResidualWindows, k: int, independent: float, relative: float, S: FloatArray) -> None:
    """Write S = (C + U) / N + (1 - 1 / N) U + diag(relative z)^2 (n, n) of the mean z of window k.

    The noise C averages out over N independent samples, the model's variance U does not; windows hold C + U.
    """
    # samples that follow each other closely have the same noise in part: so many of them say something new
    samples = max(1.0, independent * _LENGTHS[k])
    mean, variance = windows.means[k], windows.model_variance
    for i in range(len(mean)):
        for j in range(len(mean)):
            S[i, j] = windows.covariance[i, j] / samples
        S[i, i] += variance[i] * (1.0 - 1.0 / samples) + (relative * mean[i]) ** 2
