"""From a force sample to a contact: arming, filtered against raw, the help of proximity, and a missing estimate."""

import numpy as np
import pytest

from pretouch.contact.detector import Detection
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.window import Window, add_force, window_init
from pretouch.params import WindowParams
from pretouch.types import Obstacles, no_obstacles

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
    return params.judged(window, force, state.full, EE, obstacles), window


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


@pytest.mark.parametrize(("y", "detected"), [(None, False), (0.05, True), (-0.05, False)])
def test_an_object_on_the_side_a_push_comes_from_eases_its_detection(y: float | None, detected: bool):
    # -8 N against T_l of about -10 - 0.08 (F_sigma of one sample); an object at +y within d_min raises it by 4 N
    near = points() if y is None else points((0.5, y, 0.3))
    found = push(MovingThresholds(compare="raw"), near, 1, np.array([0.0, -8.0, 0.0]))
    assert (found[0].contact is not None) == detected


def test_without_an_estimate_the_window_waits():
    state = quiet(3)
    detection, after = detect(state, None, points(), MovingThresholds())
    assert after is state
    assert detection.contact is None
    assert detection.armed
