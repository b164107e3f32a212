import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pretouch.calibration.identify import align
from pretouch.calibration.signals import ImuSignal, rate_of_change, saturated, smooth, times
from pretouch.calibration.values import UnitData
from pretouch.traces import ImuTrace
from tests.examples import examples

STEP = 0.04
TIME = np.arange(0, 40, STEP)


def turning(time, seed=0):
    """Angular velocities (N, 3) of some sines."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.2, 1.0, (2, 3)), rng.uniform(0, 6, (2, 3))
    return np.sin(2 * np.pi * frequency[0] * time[:, None] + phase[0]) + 0.5 * np.sin(
        2 * np.pi * frequency[1] * time[:, None] + phase[1]
    )


ALL = np.ones(len(TIME), bool)


@examples(30, least=10)
@given(st.floats(-0.45, 0.45), st.integers(0, 1000))
def test_the_lag_is_found_whatever_the_rotation_and_the_bias(late, seed):
    R = Rotation.random(random_state=seed).as_matrix()
    sensed = turning(TIME - late, seed) @ R + [0.1, -0.2, 0.05]
    found = align(turning(TIME, seed), ALL, sensed, ALL, STEP, 0.5)
    assert found.late == pytest.approx(late, abs=0.01)
    assert found.likeness > 0.98


def test_another_motion_is_not_alike():
    assert align(turning(TIME, 1), ALL, turning(TIME, 2), ALL, STEP, 0.5).likeness < 0.8


def test_a_mirrored_motion_is_alike_in_norm_only_and_lags_beyond_the_range_are_not_found():
    sensed = turning(TIME - 2.0)
    near = align(turning(TIME), ALL, sensed, ALL, STEP, 0.5)
    far = align(turning(TIME), ALL, sensed, ALL, STEP, np.inf)
    assert abs(near.late) <= 0.5 + STEP
    assert near.likeness < 0.95 < far.likeness
    assert far.late == pytest.approx(2.0, abs=0.01)


def test_short_overlaps_do_not_win_by_chance():
    rng = np.random.default_rng(3)
    found = align(rng.normal(size=(1000, 3)), ALL, rng.normal(size=(1000, 3)), ALL, STEP, np.inf)
    assert found.likeness < 0.4


def test_what_is_not_known_does_not_count():
    known = (TIME < 10) | (TIME > 20)
    sensed = turning(TIME - 0.2)
    sensed[~known] = 1e3
    found = align(turning(TIME), ALL, sensed, known, STEP, 0.5)
    assert found.late == pytest.approx(0.2, abs=0.01)
    assert found.likeness > 0.97


def test_nothing_known_is_like_nothing():
    assert align(turning(TIME), ALL, turning(TIME), ~ALL, STEP, 0.5).likeness == 0.0
    assert align(np.zeros((1000, 3)), ALL, turning(TIME), ALL, STEP, 0.5).likeness == 0.0


@pytest.mark.parametrize(("length", "late"), [(25.0, -8.0), (200.0, 150.0)])
def test_two_recordings_of_different_length_are_aligned(length, late):
    later = np.arange(0, length, STEP)
    found = align(turning(TIME), ALL, turning(later - late), np.ones(len(later), bool), STEP, np.inf)
    assert found.late == pytest.approx(late, abs=0.01)
    assert found.likeness > 0.97


def test_fast_signals_do_not_pass():
    stamp = np.arange(0, 10, 1 / 416)
    at = times(0.5, 9.5)
    for frequency in (20.0, 50.0, 90.0, 170.0):
        passed = smooth(stamp, np.cos(2 * np.pi * frequency * stamp)[:, None], at)[200:-200]
        assert np.abs(passed).max() < 1e-3


def test_the_rate_of_change_is_exact_for_slow_signals():
    at = times(0.0, 4.0)
    wave = np.column_stack([np.sin(6 * at), at**3])
    expected = np.column_stack([6 * np.cos(6 * at), 3 * at**2])
    assert rate_of_change(wave)[2:-2] == pytest.approx(expected[2:-2], abs=1e-6)


def unit(stamp, acceleration, rate, **limits):
    return UnitData("a", ImuTrace(stamp, acceleration, rate), None, **limits)


def test_where_a_value_is_cut_off_nothing_is_used():
    stamp = np.arange(0, 5, 1 / 416)
    acceleration = np.tile([0.0, 0.0, 9.8], (len(stamp), 1))
    rate = np.zeros_like(acceleration)
    rate[1000] = [0.0, -8.726, 0.0]
    made = unit(stamp, acceleration, rate, angular_velocity_max=8.7266, acceleration_max=39.2)
    assert np.flatnonzero(saturated(made)).tolist() == [1000]
    signal = ImuSignal(made)
    at = np.arange(0, 5, 0.04)
    expected = (at > 0.26) & (at < stamp[-1] - 0.26) & (np.abs(at - stamp[1000]) > 0.26)
    assert np.array_equal(signal.usable(at), expected)
    assert not saturated(unit(stamp, acceleration, rate)).any(), "without a full scale there is nothing to be cut off"


def test_an_imu_signal_tells_values_and_rates_at_any_instant():
    stamp = 1000 + np.arange(0, 6, 1 / 416)
    phase = 2 * np.pi * (stamp - 1000)[:, None] * [0.5, 0.7, 0.9]
    signal = ImuSignal(unit(stamp, np.sin(phase), np.cos(phase)))
    at = np.array([1001.234, 1003.3, 1004.9])
    turn = 2 * np.pi * np.array([0.5, 0.7, 0.9])
    phase = turn * (at - 1000)[:, None]
    measured = signal.at(at)
    assert measured.values == pytest.approx(np.hstack([np.cos(phase), np.sin(phase)]), abs=1e-4)
    assert measured.rates == pytest.approx(np.hstack([-turn * np.sin(phase), turn * np.cos(phase)]), abs=1e-3)
