"""Measured signals at common instants: interpolated, low-passed without delay, and separated from gaps."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import firwin, oaconvolve

from pretouch.calibration.params import CalibrationParams
from pretouch.types import BoolArray, FloatArray

FINE_S = 0.002
"""Spacing of the instants at which signals are filtered [s]."""
HALF_S = 0.25
"""Half the length of the filter [s]: what is nearer to a gap than this is not used."""


def times(begin: float, end: float) -> FloatArray:
    """Instants from `begin` to `end` [s], at the spacing at which signals are filtered."""
    count = int((end - begin) / FINE_S + 1e-6) + 1  # rounding must not lose the last
    return begin + FINE_S * np.arange(count, dtype=np.float64)


def smooth(stamp: FloatArray, signal: FloatArray, at: FloatArray, params: CalibrationParams) -> FloatArray:
    """Low-pass a signal (M, c), sampled at increasing instants (M,) [s]; returns (F, c) at `at`, from `times`."""
    n = round(HALF_S / FINE_S)
    kernel = firwin(2 * n + 1, params.cutoff_hz, fs=1 / FINE_S, window=("kaiser", 8.0))
    between = CubicSpline(stamp, signal, axis=0)(np.clip(at, stamp[0], stamp[-1]))
    padded = np.pad(between, ((n, n), (0, 0)), mode="edge")
    return np.asarray(oaconvolve(padded, kernel[:, None], mode="valid", axes=0))


def rate_of_change(signal: FloatArray) -> FloatArray:
    """Derivative (F, c) of a signal (F, c) that was low-passed, by differences of fourth order; zero at the ends."""
    derivative = np.zeros_like(signal)
    derivative[2:-2] = (signal[:-4] - 8 * signal[1:-3] + 8 * signal[3:-1] - signal[4:]) / (12 * FINE_S)
    return derivative


def gaps(stamp: FloatArray, longest: float) -> FloatArray:
    """Intervals (G, 2) [s] in which nothing was measured for longer than that; the ends of time among them."""
    inside = np.flatnonzero(np.diff(stamp) > longest)
    ends = [[-np.inf, stamp[0]], *zip(stamp[inside], stamp[inside + 1], strict=True), [stamp[-1], np.inf]]
    return np.array(ends, dtype=np.float64)


def outside(at: FloatArray, intervals: FloatArray, margin: float) -> BoolArray:
    """Which of the instants (N,), in order, are further than a margin [s] from all intervals (G, 2)."""
    free = np.ones(len(at), np.bool_)
    for begin, end in intervals:
        free[np.searchsorted(at, begin - margin) : np.searchsorted(at, end + margin, side="right")] = False
    return free
