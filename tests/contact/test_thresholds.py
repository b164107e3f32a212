"""Eqs. 9-11 by numbers, and which side of the arm eases which contact."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pretouch.contact.moving_thresholds import (
    MovingThresholds,
    noise_force,
    obstacle_force,
    side_distances,
    threshold_parts,
)
from pretouch.contact.window import window_init
from pretouch.params import ThresholdParams
from pretouch.types import Obstacles, Thresholds, no_obstacles

TABLE_I = ThresholdParams()  # F_b = 10, F_std = 3, sigma_max = 3, F_d = 4, d_max = 0.8, d_min = 0.05
FAR = np.full(3, np.inf)


def thresholds(
    mean: np.ndarray, sigma: np.ndarray, positive: np.ndarray, negative: np.ndarray, params: ThresholdParams
) -> Thresholds:
    parts = np.empty((6, 3))
    threshold_parts(mean, sigma, positive, negative, params.numbers, parts)
    return Thresholds(*parts)


def crossed(force: tuple[float, float, float], near: Obstacles | None = None) -> list[bool] | None:
    """Axes of a contact with this force, of a mean of 0, to an end-effector at (0.4, 0, 0.5); None for no contact."""
    detector, window = MovingThresholds(compare="raw"), window_init(2)
    found = detector.judged(window, np.array(force), True, np.array([0.4, 0.0, 0.5]), near or no_obstacles())
    return found.contact and found.contact.axes.tolist()


def test_eq_10_by_numbers():
    # 1 / 2 * 3 = 1.5;   4 / 2 * 3 = 6 is more than F_std = 3;   0
    np.testing.assert_allclose(noise_force(np.array([1.0, 4.0, 0.0]), 3.0, 2.0), [1.5, 3.0, 0.0])


@pytest.mark.parametrize(
    ("distance", "force"),
    [
        (0.425, 2.0),  # (0.8 - 0.425) / (0.8 - 0.05) * 4 = 0.375 / 0.75 * 4
        (0.65, 0.8),  # 0.15 / 0.75 * 4
        (0.8, 0.0),
        (0.05, 4.0),
        (0.01, 4.0),  # nearer than d_min: never more than F_d
        (0.0, 4.0),
        (3.0, 0.0),  # beyond d_max: never less than nothing
        (np.inf, 0.0),
    ],
)
def test_eq_11_by_numbers(distance: float, force: float):
    np.testing.assert_allclose(obstacle_force(np.array([distance]), 4.0, 0.8, 0.05), [force], atol=1e-12)


def test_eq_9_by_numbers():
    mean, sigma = np.array([1.0, 1.0, -2.0]), np.array([0.0, 1.5, 9.0])
    positive, negative = np.array([np.inf, 0.425, np.inf]), np.array([0.05, np.inf, np.inf])
    limits = thresholds(mean, sigma, positive, negative, TABLE_I)
    # F_sigma = 0, 1.5, 3;   F_obs+ = 0, 2, 0;   F_obs- = 4, 0, 0
    np.testing.assert_allclose(limits.upper, [1 + 10 + 0 - 4, 1 + 10 + 1.5 - 0, -2 + 10 + 3 - 0])
    np.testing.assert_allclose(limits.lower, [1 - 10 - 0 + 0, 1 - 10 - 1.5 + 2, -2 - 10 - 3 + 0])
    np.testing.assert_allclose(limits.obstacle_positive, [0, 2, 0], atol=1e-12)
    np.testing.assert_allclose(limits.obstacle_negative, [4, 0, 0], atol=1e-12)


def test_an_object_at_greater_y_eases_contact_in_minus_y():
    ee, hand = np.array([0.4, 0.0, 0.5]), np.array([[0.4, 0.425, 0.5]])
    positive, negative = side_distances(ee, hand, np.array([0.425]))
    limits = thresholds(np.zeros(3), np.zeros(3), positive, negative, TABLE_I)
    # F_obs+ = 2 on y alone: T_l rises from -10 to -8, T_u stays at 10
    np.testing.assert_allclose(limits.lower, [-10, -8, -10])
    np.testing.assert_allclose(limits.upper, [10, 10, 10])
    near = no_obstacles(1)._replace(point=hand, ee_distance=np.array([0.425]))
    assert crossed((0.0, -9.0, 0.0), near) == [False, True, False]
    assert crossed((0.0, 9.0, 0.0), near) is None


def test_sides_are_half_spaces_and_the_nearest_object_counts():
    ee = np.array([0.5, 0.0, 0.3])
    points = np.array([[0.6, 0.2, 0.3], [0.4, 0.1, 0.3], [0.5, -0.7, 0.3]])
    distance = np.array([0.22, 0.14, 0.7])
    positive, negative = side_distances(ee, points, distance)
    # +x: first; +y: first and second; z equal, so neither side.  -x: second; -y: third
    np.testing.assert_array_equal(positive, [0.22, 0.14, np.inf])
    np.testing.assert_array_equal(negative, [0.14, 0.7, np.inf])


def test_no_object_on_any_side():
    positive, negative = side_distances(np.zeros(3), np.zeros((0, 3)), np.zeros(0))
    np.testing.assert_array_equal(positive, FAR)
    np.testing.assert_array_equal(negative, FAR)


def test_a_force_on_the_threshold_has_not_crossed_it():
    assert crossed((10.0, -10.0, 0.0)) is None
    assert crossed((10.001, -10.001, 0.0)) == [True, True, False]


axis_values = arrays(np.float64, 3, elements=st.floats(-100, 100))
distances = arrays(np.float64, 3, elements=st.one_of(st.floats(0.0, 1e6), st.just(np.inf)))


@given(axis_values, arrays(np.float64, 3, elements=st.floats(0, 50)), distances, distances)
@settings(deadline=None, derandomize=True, max_examples=200)
def test_thresholds_always_enclose_the_mean(mean, sigma, positive, negative):
    limits = thresholds(mean, sigma, positive, negative, TABLE_I)
    # at least F_b - F_d = 6 N and at most F_b + F_std = 13 N from the mean
    for gap in (limits.upper - mean, mean - limits.lower):
        assert np.all(gap >= 6 - 1e-9)
        assert np.all(gap <= 13 + 1e-9)


@given(distances, distances)
@settings(deadline=None, derandomize=True, max_examples=200)
def test_nearer_is_never_less_sensitive(a, b):
    near, far = np.minimum(a, b), np.maximum(a, b)
    close = thresholds(np.zeros(3), np.zeros(3), near, near, TABLE_I)
    distant = thresholds(np.zeros(3), np.zeros(3), far, far, TABLE_I)
    assert np.all(close.upper <= distant.upper)
    assert np.all(close.lower >= distant.lower)
