import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pretouch.calibration.alignment import align

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


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.45, 0.45), st.integers(0, 1000))
def test_the_lag_is_found_whatever_the_rotation_and_the_bias(late, seed):
    R = Rotation.random(random_state=seed).as_matrix()
    sensed = turning(TIME - late, seed) @ R + [0.1, -0.2, 0.05]
    found = align(turning(TIME, seed), ALL, sensed, ALL, STEP, 0.5)
    assert found.late == pytest.approx(late, abs=0.01)
    assert found.likeness > 0.98


def test_another_motion_is_not_alike():
    found = align(turning(TIME, 1), ALL, turning(TIME, 2), ALL, STEP, 0.5)
    assert found.likeness < 0.8


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
