import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.calibration.motion.plan import Plan, Swing

TONES = np.array([[0.3, 0.5], [0.9, 1.1]])


def swing(begin: float = 3.0, duration: float = 6.0) -> Swing:
    return Swing(begin, duration, 1.5, np.array([[0.3, 0.2], [0.1, 0.05]]), TONES, np.array([[0.1, 2.0], [4.0, 5.0]]))


def plan() -> Plan:
    """Stand, go, stand, swing there, stand, and go back."""
    away = [0.5, -0.7]
    return Plan(
        np.array([0.0, 1.0, 2.5, 3.0, 9.0, 10.0, 12.0]),
        np.array([[0.0, 1.0], [0.0, 1.0], away, away, away, away, [0.0, 1.0]]),
        (swing(),),
    )


@given(st.floats(0.001, 11.999))
def test_velocities_are_the_derivative_of_positions(time):
    h = 1e-5
    numeric = (plan().at(time + h)[0] - plan().at(time - h)[0]) / (2 * h)
    np.testing.assert_allclose(plan().at(time)[1], numeric, atol=1e-6)


def test_accelerations_are_the_derivative_of_velocities_and_do_not_jump():
    samples = plan().sampled(10_000.0)
    numeric = np.gradient(samples.qd, samples.time, axis=0)
    np.testing.assert_allclose(samples.qdd[1:-1], numeric[1:-1], atol=0.01)
    assert np.abs(np.diff(samples.qdd, axis=0)).max() < 0.01


@pytest.mark.parametrize("time", [-5.0, 0.0, 12.0, 100.0])
def test_it_is_at_rest_at_its_ends_and_beyond(time):
    q, qd = plan().at(time)
    np.testing.assert_allclose(q, plan().start, atol=1e-12)
    np.testing.assert_allclose(qd, 0.0, atol=1e-12)


def test_a_way_between_knots_is_straight_and_turns_nowhere():
    q = plan().sampled(100.0).q[100:251]
    np.testing.assert_allclose(np.interp(q[:, 0], [0.0, 0.5], [1.0, -0.7]), q[:, 1], atol=1e-12)
    assert np.all(np.diff(q[:, 0]) >= 0.0)


def test_it_stands_between_equal_knots_without_a_swing():
    assert plan().still == ((0.0, 1.0), (2.5, 3.0), (9.0, 10.0))
    for begin, end in plan().still:
        np.testing.assert_array_equal(plan().at((begin + end) / 2)[1], 0.0)


def test_a_swing_is_the_sum_of_its_sines_between_its_fades():
    one = swing(begin=0.0)
    time = np.array([2.0, 3.3, 4.4])
    angle = 2 * np.pi * TONES[None] * time[:, None, None] + one.phase
    np.testing.assert_allclose(one.states(time)[0], (one.amplitude * np.sin(angle)).sum(axis=1))


def test_sampling_includes_both_ends_at_no_less_than_the_rate():
    samples = plan().sampled(7.3)
    assert (samples.time[0], samples.time[-1]) == (0.0, 12.0)
    assert np.diff(samples.time).max() <= 1 / 7.3
    np.testing.assert_allclose(samples.q[33], plan().at(samples.time[33])[0])
