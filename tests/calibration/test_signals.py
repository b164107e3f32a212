import numpy as np
import pytest

from pretouch.calibration.data import UnitData
from pretouch.calibration.imu_signal import ImuSignal, saturated
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.signals import FINE_S, gaps, outside, smooth, times
from pretouch.traces import ImuTrace, on_grid

PARAMS = CalibrationParams()


def test_fast_signals_do_not_pass():
    stamp = np.arange(0, 10, 1 / 416)
    at = times(0.5, 9.5)
    for frequency in (20.0, 50.0, 90.0, 170.0):
        passed = smooth(stamp, np.cos(2 * np.pi * frequency * stamp)[:, None], at, PARAMS)[200:-200]
        assert np.abs(passed).max() < 1e-3


def test_between_instants_it_is_linear_and_at_the_ends_it_stays():
    fine = times(10.0, 10.004)
    values = np.array([[1.0, 0.0], [3.0, 0.0], [2.0, 5.0]])
    at = np.array([9.0, 10.0, 10.001, 10.003, 11.0])
    found = on_grid(at, fine[0], FINE_S, values)
    assert found[:, 0] == pytest.approx([1.0, 1.0, 2.0, 2.5, 2.0], abs=1e-4)


def test_gaps_are_where_samples_are_far_apart_and_outside_the_measured_time():
    found = gaps(np.array([1.0, 1.01, 1.2, 1.21]), 0.05)
    assert found.tolist() == [[-np.inf, 1.0], [1.01, 1.2], [1.21, np.inf]]


def test_outside_keeps_its_margin():
    at = np.arange(0, 10, 1.0)
    free = outside(at, np.array([[-np.inf, 0.5], [4.2, 4.4], [9.0, np.inf]]), 1.0)
    assert np.flatnonzero(free).tolist() == [2, 3, 6, 7]


def unit(stamp, acceleration, rate, **limits):
    return UnitData("a", ImuTrace(stamp, acceleration, rate), None, **limits)


def test_where_a_value_is_cut_off_nothing_is_used():
    stamp = np.arange(0, 5, 1 / 416)
    acceleration = np.tile([0.0, 0.0, 9.8], (len(stamp), 1))
    rate = np.zeros_like(acceleration)
    rate[1000] = [0.0, -8.726, 0.0]
    made = unit(stamp, acceleration, rate, angular_velocity_max=8.7266, acceleration_max=39.2)
    assert np.flatnonzero(saturated(made)).tolist() == [1000]
    signal = ImuSignal(made, PARAMS)
    at = np.arange(0, 5, 0.04)
    expected = (at > 0.26) & (at < stamp[-1] - 0.26) & (np.abs(at - stamp[1000]) > 0.26)
    assert np.array_equal(signal.usable(at), expected)
    assert not saturated(unit(stamp, acceleration, rate)).any(), "without a full scale there is nothing to be cut off"
