"""The closing speed of points in the base frame, and points nearer than the sensor measures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.perception.motion_compensation import closing_speeds, follow_points, reckon
from pretouch.perception.obstacles import track_init
from pretouch.sensing.sensor import PAPER_SENSOR, Sensors, cones_of
from pretouch.types import no_obstacles

MEMORY, PERIOD = 0.09, 0.02
TOWARDS_ME = np.array([0.0, 0.0, 1.0])


def followed(distance, stamps=None, memory=MEMORY) -> list[float]:
    """Closing speeds of one unit that looks up from the origin, after each of its readings."""
    stamps = PERIOD * np.arange(len(distance)) if stamps is None else stamps
    tracks, near, found = track_init(1), no_obstacles(1)._replace(direction=TOWARDS_ME[None]), []
    for t, d in zip(stamps, distance, strict=True):
        point, stamp = d * TOWARDS_ME[None], np.array([t])
        follow_points(tracks, point, stamp, np.ones(1, np.bool_), memory)
        closing_speeds(tracks.motion, near)
        tracks = tracks._replace(point=point, seen=stamp)
        found.append(float(near.closing_speed[0]))
    return found


def test_nothing_is_known_after_one_reading():
    assert followed([0.5]) == [0.0]


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.6, -0.3])
def test_a_steady_approach_is_followed_without_bias(speed):
    assert followed(1.0 - speed * PERIOD * np.arange(60))[-1] == pytest.approx(speed, abs=0.01 * abs(speed))


def test_a_hand_that_sets_out_is_followed_in_a_third_of_a_second():
    d = np.concatenate([np.full(50, 0.8), 0.8 - 0.5 * PERIOD * np.arange(1, 30)])
    found = np.array(followed(d))
    assert found[49] == 0.0
    assert np.argmax(found[50:] > 0.25) * PERIOD <= 0.14
    assert np.argmax(found[50:] > 0.45) * PERIOD <= 0.35


def test_range_noise_leaves_little_of_a_thing_at_rest():
    rng = np.random.default_rng(1000)
    for sigma, allowed in ((0.005, 0.015), (0.02, 0.06)):
        found = np.array(followed(0.5 + sigma * rng.normal(size=4000)))[50:]
        assert abs(found.mean()) < 0.005
        assert found.std() < allowed


def test_a_reading_of_another_surface_begins_anew():
    found = followed([0.9, 0.89, 0.88, 0.4, 0.4, 0.4])
    assert found[2] > 0
    assert found[3:] == [0.0, 0.0, 0.0]


def test_after_a_silence_it_begins_anew():
    found = followed([0.9, 0.88, 0.86, 0.7], stamps=[0.0, 0.02, 0.04, 0.4])
    assert found[2] > 0
    assert found[3] == 0.0


def test_readings_that_are_not_taken_change_nothing():
    tracks = track_init(2)._replace(seen=np.zeros(2))
    follow_points(tracks, np.ones((2, 3)), np.ones(2), np.array([True, False]), MEMORY)
    np.testing.assert_array_equal(tracks.motion[:, 0], [[1, 1, 1], [0, 0, 0]])
    assert np.isnan(tracks.motion[:, 1]).all()


@given(st.lists(st.floats(0.0, 1.3), min_size=1, max_size=20), st.lists(st.floats(1e-4, 0.5), min_size=20, max_size=20))
def test_whatever_is_read_the_speed_is_one_a_hand_can_have(distance, gaps):
    found = followed(distance, stamps=np.cumsum(gaps)[: len(distance)])
    assert np.isfinite(found).all()
    assert np.abs(found).max() <= 2.0


def reckoned(distance: float, last: float | None, sensor: float = 0.0, velocity: float = 0.0, age: float = 0.02):
    """Height of the point of a unit at a height, looking up, that last saw something at another."""
    points = np.array([[0.0, 0.0, sensor + distance]])
    tracks = track_init(1)
    tracks.motion[0], tracks.motion[1] = 0.0, velocity * TOWARDS_ME
    before = np.full((1, 3), np.nan) if last is None else last * TOWARDS_ME[None]
    stamp = np.array([-np.inf if last is None else 1.0 - age])
    reckon(
        points, np.array([distance]), np.ones(1), tracks._replace(point=before, seen=stamp),
        Sensors(sensor * TOWARDS_ME[None], np.eye(3)[None], np.zeros(1, np.int64)), cones_of([PAPER_SENSOR]), 0.18,
    )  # fmt: skip
    return float(points[0, 2] - sensor)


@pytest.mark.parametrize(
    ("given", "height"),
    [
        ({"distance": 0.3, "last": 0.1}, 0.3),  # what the sensor can measure stands
        # nearer than that a point stays where it was last seen: the arm has come to 25 mm of where it was
        ({"distance": 0.04, "last": 0.055, "sensor": 0.03}, 0.025),
        ({"distance": 0.04, "last": 0.2}, 0.04),
        ({"distance": 0.04, "last": 0.01, "sensor": 0.02}, 0.0),
        # one that comes by itself is moved on, and a slow one is not
        ({"distance": 0.04, "last": 0.04, "velocity": -0.5}, 0.03),
        ({"distance": 0.04, "last": 0.04, "velocity": -0.05}, 0.04),
        # what was never seen farther off is taken to touch
        ({"distance": 0.04, "last": None}, 0.0),
        ({"distance": 0.04, "last": 0.04, "age": 1.0}, 0.0),
    ],
)
def test_where_a_point_is_that_is_nearer_than_the_sensor_measures(given: dict, height: float):
    assert reckoned(**given) == pytest.approx(height)
