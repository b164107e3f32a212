"""Eq. 8 with running statistics against NumPy's, and eq. 12."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from pretouch.contact.admittance import Admittance
from pretouch.contact.reaction import DecayingVelocity, reaction_velocity
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


@pytest.mark.parametrize(("samples", "offset"), [(2, 0.0), (7, 1e4), (100, -1e4)])
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


# eq. 12: the arm moves the way it was pushed, not too fast, and for a while


@pytest.mark.parametrize(
    ("force", "compliance", "velocity"),
    [
        # C = 0.02: 0.02 * 1.5 = 0.03, 0.02 * -10 = -0.2
        ((1.5, -10.0, 0.0), 0.02, (0.03, -0.2, 0.0)),
        # not the axes are clipped, but the norm: 0.03 * (30, 40, 0) = (0.9, 1.2, 0), norm 1.5; scaled by 0.3 / 1.5
        ((30.0, 40.0, 0.0), 0.03, (0.18, 0.24, 0.0)),
        ((0.0, 0.0, 0.0), 0.03, (0.0, 0.0, 0.0)),
    ],
)
def test_eq_12_by_numbers(force: tuple, compliance: float, velocity: tuple):
    np.testing.assert_allclose(reaction_velocity(np.array(force), compliance, 0.3), velocity)


def test_decay_is_linear_and_ends():
    part = DecayingVelocity(compliance_m_s_n=0.02, decay_cycles=4)
    state = part.begin(np.array([0.0, 10.0, 0.0]))
    speeds, active = [], []
    for _ in range(6):
        speeds.append(state.decayed(4)[1])
        active.append(part.active(state))
        state = state.advanced()
    # 0.02 * 10 = 0.2 m/s, then a quarter less each cycle
    np.testing.assert_allclose(speeds, [0.2, 0.15, 0.1, 0.05, 0.0, 0.0])
    assert active == [True, True, True, True, False, False]


def test_without_an_arm_an_answer_lasts_as_long_as_the_reaction_or_that_of_the_paper():
    short = DecayingVelocity(decay_cycles=25)
    assert DecayingVelocity.of(short, 0.001) is short
    assert DecayingVelocity.of(Admittance(), 0.01) == DecayingVelocity()
    assert DecayingVelocity.of(Admittance(), 0.001).decay_cycles == 2000
