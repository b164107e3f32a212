"""What one IMU measured, low-passed, at any instants of its own clock."""

import numpy as np

from pretouch.calibration.data import UnitData
from pretouch.calibration.fit import Measured
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.signals import FINE_S, HALF_S, gaps, outside, rate_of_change, smooth, times
from pretouch.traces import on_grid
from pretouch.types import BoolArray, FloatArray

_FULL = 0.999
"""Share of full scale from which on a value is taken as cut off."""


class ImuSignal:
    """Signals of one unit, whose stamps increase."""

    def __init__(self, unit: UnitData, params: CalibrationParams) -> None:
        imu = unit.imu
        values = np.hstack([imu.angular_velocity, imu.acceleration])
        self._fine = times(imu.stamp[0], imu.stamp[-1])
        self._values = smooth(imu.stamp, values, self._fine, params)
        self._rates = rate_of_change(self._values)
        cut = imu.stamp[saturated(unit)]
        self._unusable = np.vstack([gaps(imu.stamp, params.longest_gap_s), np.column_stack([cut, cut])])

    def at(self, stamp: FloatArray) -> Measured:
        """Return what it measured at instants (N,) of its clock [s]."""
        return Measured(*(on_grid(stamp, self._fine[0], FINE_S, known) for known in (self._values, self._rates)))

    def usable(self, stamp: FloatArray) -> BoolArray:
        """Tell at which of the instants (N,), in order, it measured all around, and within its range."""
        return outside(stamp, self._unusable, HALF_S + 0.01)


def saturated(unit: UnitData) -> BoolArray:
    """Tell which samples (M,) hold a value that is cut off."""
    imu = unit.imu
    over = np.abs(imu.angular_velocity) >= _FULL * unit.angular_velocity_max
    return np.any(over | (np.abs(imu.acceleration) >= _FULL * unit.acceleration_max), axis=1)
