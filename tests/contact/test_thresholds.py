"""Eqs. 9-11 by numbers, which side of the arm eases which contact, and the way from a force sample to a contact."""

import numpy as np
import pytest

from pretouch.contact.detector import Detection
from pretouch.contact.moving_thresholds import (
    MovingThresholds,
    noise_force,
    obstacle_force,
    side_distances,
    threshold_parts,
)
from pretouch.contact.window import Window, add_force, window_init
from pretouch.params import ThresholdParams, WindowParams
from pretouch.types import Obstacles, Thresholds, no_obstacles

TABLE_I = ThresholdParams()  # F_b = 10, F_std = 3, sigma_max = 3, F_d = 4, d_max = 0.8, d_min = 0.05


def thresholds(
    mean: np.ndarray, sigma: np.ndarray, positive: np.ndarray, negative: np.ndarray, params: ThresholdParams
) -> Thresholds:
    parts = np.empty((6, 3))
    threshold_parts(mean, sigma, positive, negative, params.numbers, parts)
    return Thresholds(*parts)


def crossed(force: tuple[float, float, float], near: Obstacles | None = None) -> list[bool] | None:
    """Axes of a contact with this force, of a mean of 0, to an end-effector at (0.4, 0, 0.5); None for no contact."""
    detector, window = MovingThresholds(compare="raw"), window_init(2)
    found = detector.judge(window, np.array(force), True, np.array([0.4, 0.0, 0.5]), near or no_obstacles())
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


def test_a_force_on_the_threshold_has_not_crossed_it():
    assert crossed((10.0, -10.0, 0.0)) is None
    assert crossed((10.001, -10.001, 0.0)) == [True, True, False]


# from a force sample to a contact: arming, filtered against raw, the help of proximity, and a missing estimate


EE = np.array([0.5, 0.0, 0.3])
PUSH = np.array([0.0, -50.0, 0.0])


def points(*at: tuple[float, float, float]) -> Obstacles:
    """Sensed points; what belongs to the body plays no part in detection."""
    p = np.array(at).reshape(-1, 3)
    return no_obstacles()._replace(point=p, ee_distance=np.linalg.norm(p - EE, axis=1))


def detect(
    state: Window, force: np.ndarray | None, obstacles: Obstacles, params: MovingThresholds
) -> tuple[Detection, Window]:
    window = add_force(state, force, WindowParams())
    return params.judge(window, force, state.full, EE, obstacles), window


def quiet(samples: int = 100) -> Window:
    """A full window of zeros."""
    state = window_init(samples)
    for _ in range(samples):
        state = add_force(state, np.zeros(3), WindowParams())
    return state


def push(params: MovingThresholds, obstacles: Obstacles, samples: int, force: np.ndarray = PUSH) -> list[Detection]:
    """Let a constant force act after a quiet time."""
    state, found = quiet(), []
    for _ in range(samples):
        detection, state = detect(state, force, obstacles, params)
        found.append(detection)
    return found


def test_nothing_is_detected_before_the_window_is_full():
    params = MovingThresholds(compare="raw")
    state = window_init(3)
    for force in (0.0, 0.0, 1e3):
        detection, state = detect(state, np.full(3, force), points(), params)
        assert not detection.armed
        assert detection.contact is None
    detection, _ = detect(state, np.full(3, 1e4), points(), params)
    assert detection.armed
    assert detection.contact is not None


def test_the_filtered_value_crosses_later_by_numbers():
    found = push(MovingThresholds(), points(), 3)
    # eq. 8 on -50 N: -5, then -5 * 0.9 - 5 = -9.5, then -9.5 * 0.9 - 5 = -13.55
    # 3rd sample: mu = -(5 + 9.5 + 13.55) / 100 = -0.2805
    # sum of squares 25 + 90.25 + 183.6025 = 298.8525; sigma^2 = (298.8525 - 100 * 0.2805^2) / 99 = 2.93924
    # sigma = 1.71442 = F_sigma (F_std = sigma_max), T_l = -0.2805 - 10 - 1.71442 = -11.99492
    assert [d.contact is not None for d in found] == [False, False, True]
    assert found[2].thresholds.lower[1] == pytest.approx(-11.99492, abs=1e-5)
    # F_ext = -13.55 + 0.2805 = -13.2695, on y only
    np.testing.assert_allclose(found[2].contact.force, [0.0, -13.2695, 0.0], atol=1e-12)
    assert found[2].contact.axes.tolist() == [False, True, False]


def test_the_raw_sample_crosses_at_once():
    found = push(MovingThresholds(compare="raw"), points(), 1)
    # the window got -5: mu = -0.05, so F_ext = -50 + 0.05
    np.testing.assert_allclose(found[0].contact.force, [0.0, -49.95, 0.0], atol=1e-12)


def test_without_an_estimate_the_window_waits():
    state = quiet(3)
    detection, after = detect(state, None, points(), MovingThresholds())
    assert after is state
    assert detection.contact is None
    assert detection.armed
