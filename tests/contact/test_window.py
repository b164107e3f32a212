"""Eq. 8, and running statistics against NumPy's on the same values."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from pretouch.contact.window import Window, add_force, weighted_value, window_init
from pretouch.params import WindowParams

P = WindowParams()  # Table I: alpha 0.1, lambda 0.75


def filled(values: list[float]) -> Window:
    """A window as large as the values, the same on all three axes."""
    state = window_init(len(values))
    for value in values:
        state = add_force(state, np.full(3, value), P)
    return state


def test_eq_8_by_numbers():
    # mu = 0, sigma = 4, so |x| > 0.75 * 4 = 3 is an outlier; x_{t-1} = 2
    reading, last = np.array([10.0, 1.0, -10.0]), np.full(3, 2.0)
    value = weighted_value(reading, last, np.zeros(3), np.full(3, 4.0), P.numbers)
    # 0.1 * 10 + 0.9 * 2 = 2.8;   1 as it is;   0.1 * -10 + 0.9 * 2 = 0.8
    np.testing.assert_allclose(value, [2.8, 1.0, 0.8], rtol=1e-15)


def test_a_reading_on_the_bound_is_no_outlier():
    # lambda sigma = 0.75 * 4 = 3 exactly: eq. 8 has ">", not ">="; 3.001 counts with its tenth
    reading = np.array([3.0, -3.0, 3.001])
    value = weighted_value(reading, np.zeros(3), np.zeros(3), np.full(3, 4.0), P.numbers)
    np.testing.assert_allclose(value, [3.0, -3.0, 0.3001], rtol=1e-12)


def test_raw_samples_fill_the_window_however_wild():
    state = filled([1.0, 100.0, -50.0, 3.0])
    np.testing.assert_array_equal(state.ring[:, 0], [1.0, 100.0, -50.0, 3.0])
    assert state.full


def test_a_full_window_filters_with_its_last_statistics_and_its_last_value():
    state = filled([0.0, 0.0, 0.0, 0.0])
    state = add_force(state, np.full(3, 5.0), P)
    # sigma = 0, so 5 is an outlier: 0.1 * 5 + 0.9 * 0 = 0.5
    np.testing.assert_allclose(state.newest, 0.5)
    state = add_force(state, np.full(3, 5.0), P)
    # window 0, 0, 0, 0.5: mu = 0.125, sigma = 0.25, |5 - 0.125| > 0.1875; x_{t-1} is the 0.5 that was added, not 5:
    # 0.1 * 5 + 0.9 * 0.5 = 0.95
    np.testing.assert_allclose(state.newest, 0.95)
    np.testing.assert_allclose(np.sort(state.ring[:, 1]), [0.0, 0.0, 0.5, 0.95])


@pytest.mark.parametrize("samples", [2, 7, 100])
@pytest.mark.parametrize("offset", [0.0, 1e4, -1e4])
def test_statistics_equal_numpy_over_thousands_of_samples(samples: int, offset: float):
    rng = np.random.default_rng([7, samples])
    state, ring = window_init(samples), deque(maxlen=samples)
    for i in range(3000):
        # phases of noise, of none, and single wild values
        scale = (3.0, 0.0, 50.0 if i % 17 == 0 else 0.01)[i // 500 % 3]
        state = add_force(state, offset + scale * rng.standard_normal(3), P)
        ring.append(state.newest)
        np.testing.assert_allclose(state.mean(), np.mean(ring, axis=0), atol=1e-10)
        if len(ring) > 1:
            np.testing.assert_allclose(state.std(), np.std(ring, axis=0, ddof=1), atol=1e-6)


def test_a_step_of_the_signal_leaves_no_lasting_error():
    state = window_init(50)
    for i in range(500):
        state = add_force(state, np.full(3, 0.1 if i < 130 else 12345.678), replace(P, alpha=1.0))
        values = state.ring[: state.samples[0]]
        np.testing.assert_allclose(state.mean(), values.mean(axis=0), atol=1e-9)
    # the window holds equal values only: its deviation is exactly zero, so eq. 10 adds nothing
    np.testing.assert_array_equal(state.std(), 0.0)


def test_empty_and_single():
    empty = window_init(5)
    np.testing.assert_array_equal(empty.mean(), 0.0)
    np.testing.assert_array_equal(empty.std(), 0.0)
    assert not empty.full
    one = add_force(empty, np.array([1.0, 2.0, 3.0]), P)
    np.testing.assert_array_equal(one.mean(), [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(one.std(), 0.0)
