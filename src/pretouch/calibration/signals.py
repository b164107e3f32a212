"""Measured signals at common instants: interpolated, low-passed without delay, and separated from gaps; IMUs' too."""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts load when they are first used: half a second that a help does not wait

from pretouch.calibration.values import CUTOFF_HZ, LONGEST_GAP_S, UnitData
from pretouch.traces import on_grid
from pretouch.types import BoolArray, FloatArray

FINE_S = 0.002
"""Spacing of the instants at which signals are filtered [s]."""
_FULL = 0.999
"""Share of full scale from which on a value is taken as cut off."""
HALF_S = 0.25
"""Half the length of the filter [s]: what is nearer to a gap than this is not used."""


def times(begin: float, end: float) -> FloatArray:
    """Instants from `begin` to `end` [s], at the spacing at which signals are filtered."""
    count = int((end - begin) / FINE_S + 1e-6) + 1  # rounding must not lose the last
    return begin + FINE_S * np.arange(count, dtype=np.float64)


def smooth(stamp: FloatArray, signal: FloatArray, at: FloatArray) -> FloatArray:
    """Low-pass a signal (M, c), sampled at increasing instants (M,) [s]; returns (F, c) at `at`, from `times`."""
    n = round(HALF_S / FINE_S)
    kernel = scipy.signal.firwin(2 * n + 1, CUTOFF_HZ, fs=1 / FINE_S, window=("kaiser", 8.0))
    between = scipy.interpolate.CubicSpline(stamp, signal, axis=0)(np.clip(at, stamp[0], stamp[-1]))
    padded = np.pad(between, ((n, n), (0, 0)), mode="edge")
    return np.asarray(scipy.signal.oaconvolve(padded, kernel[:, None], mode="valid", axes=0))


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
    """Mask of the instants (N,), in order, that are farther than a margin [s] from all intervals (G, 2)."""
    free = np.ones(len(at), np.bool_)
    for begin, end in intervals:
        free[np.searchsorted(at, begin - margin) : np.searchsorted(at, end + margin, side="right")] = False
    return free


@dataclass(frozen=True, eq=False)
class Measured:
    """Measurements of one IMU at N instants, and their derivatives."""

    values: FloatArray
    """(N, 6) angular velocity [rad/s], proper acceleration [m/s^2]."""
    rates: FloatArray
    """(N, 6) their derivatives by time."""


class ImuSignal:
    """Signals of one unit, whose stamps increase."""

    def __init__(self, unit: UnitData) -> None:
        imu = unit.imu
        values = np.hstack([imu.angular_velocity, imu.acceleration])
        self._fine = times(imu.stamp[0], imu.stamp[-1])
        self._values = smooth(imu.stamp, values, self._fine)
        self._rates = rate_of_change(self._values)
        cut = imu.stamp[saturated(unit)]
        self._unusable = np.vstack([gaps(imu.stamp, LONGEST_GAP_S), np.column_stack([cut, cut])])

    def at(self, stamp: FloatArray) -> Measured:
        """Return its measurements at instants (N,) of its clock [s]."""
        return Measured(*(on_grid(stamp, self._fine[0], FINE_S, signal) for signal in (self._values, self._rates)))

    def usable(self, stamp: FloatArray) -> BoolArray:
        """Mask of the instants (N,), in order, with measurements all around and within its range."""
        return outside(stamp, self._unusable, HALF_S + 0.01)


def saturated(unit: UnitData) -> BoolArray:
    """Tell which samples (M,) hold a value that is cut off."""
    imu = unit.imu
    over = np.abs(imu.angular_velocity) >= _FULL * unit.angular_velocity_max
    return np.any(over | (np.abs(imu.acceleration) >= _FULL * unit.acceleration_max), axis=1)
