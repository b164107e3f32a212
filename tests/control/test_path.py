"""The paths of the paper by numbers, and how the phase moves along them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.examples import examples
from tests.following_arm import DT

from pretouch.control.path import Circle, OnPath, Path, WayPoints, advance, follow, segment
from pretouch.errors import PathError
from pretouch.params import TaskParams

CIRCLE = Circle()  # paper, IV-A: radius 0.25 m round (0.5, 0, 0.25)
LINE = segment((0.4, 0.5, 0.5), (0.4, -0.5, 0.5))  # paper, IV-A
SQUARE = WayPoints(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), closed=True)
PARAMS = TaskParams()


def followed(path: Path, phase: float, speed: float, position: np.ndarray) -> OnPath:
    """The path at a phase, with the task velocity."""
    on_path = OnPath(np.full(1, phase), path.point(phase), path.tangent(phase), np.empty(3), np.empty(1), np.ones(1))
    follow(on_path, speed, position, PARAMS.numbers)
    return on_path


def moved(path: Path, phase: float, speed: float, position: np.ndarray, velocity: np.ndarray) -> float:
    """The phase after a cycle with a commanded velocity."""
    return advance(phase, followed(path, phase, speed, position), velocity, DT)


def test_circle_starts_at_its_left_and_rises():
    np.testing.assert_allclose(CIRCLE.point(0.0), [0.5, 0.25, 0.25])
    # counter-clockwise seen from +x: from +y towards +z
    np.testing.assert_allclose(CIRCLE.tangent(0.0), [0, 0, 1])
    quarter = 2 * np.pi * 0.25 / 4
    np.testing.assert_allclose(CIRCLE.point(quarter), [0.5, 0, 0.5], atol=1e-12)
    np.testing.assert_allclose(CIRCLE.tangent(quarter), [0, -1, 0], atol=1e-12)
    assert CIRCLE.closed
    np.testing.assert_allclose(CIRCLE.length, 4 * quarter)


def test_line_by_numbers():
    assert LINE.length == 1.0
    np.testing.assert_allclose(LINE.point(0.25), [0.4, 0.25, 0.5])
    np.testing.assert_allclose(LINE.tangent(0.25), [0, -1, 0])
    # an open path ends: it goes nowhere from there
    np.testing.assert_allclose(LINE.point(2.0), [0.4, -0.5, 0.5])
    np.testing.assert_array_equal(LINE.tangent(1.0), 0.0)
    np.testing.assert_allclose(LINE.point(-1.0), [0.4, 0.5, 0.5])


def test_closed_way_points_by_numbers():
    assert SQUARE.length == 4.0
    np.testing.assert_allclose(SQUARE.point(2.5), [0.5, 1, 0])
    np.testing.assert_allclose(SQUARE.point(3.75), [0, 0.25, 0])
    np.testing.assert_allclose(SQUARE.tangent(3.75), [0, -1, 0])
    np.testing.assert_allclose(SQUARE.point(4.25), SQUARE.point(0.25))


@pytest.mark.parametrize("path", [CIRCLE, LINE, SQUARE])
@given(phase=st.floats(0.0, 10.0))
def test_tangent_is_the_derivative_of_the_point_by_arc_length(path: Path, phase: float):
    step = 1e-6
    at_corner = not isinstance(path, Circle) and (phase + step) % 1.0 < 2 * step
    beyond = not path.closed and phase >= path.length
    if not at_corner and not beyond:
        slope = (path.point(phase + step) - path.point(phase)) / step
        np.testing.assert_allclose(path.tangent(phase), slope, atol=1e-5)


@pytest.mark.parametrize(
    "points", [[[0.0, 0, 0]], [[0.0, 0], [1, 1]], [[0.0, 0, 0], [np.nan, 0, 0]], [[0.0, 0, 0], [1, 0, 0], [1, 0, 0]]]
)
def test_unusable_way_points_are_refused(points: list[list[float]]):
    with pytest.raises(PathError, match="way-point"):
        WayPoints(np.array(points))


@pytest.mark.parametrize("bad", [{"radius": 0.0}, {"radius": -1.0}, {"radius": np.nan}, {"center": (0, np.inf, 0)}])
def test_unusable_circles_are_refused(bad: dict):
    with pytest.raises(PathError, match="circle"):
        Circle(**bad)


SLOWED = 0.02 / np.hypot(0.01, 0.1)


@pytest.mark.parametrize(
    ("speed", "position", "velocity"),
    [
        (0.2, (0.4, 0.25, 0.5), (0, -0.2, 0)),  # on the path
        # 0.05 m beside it: forward 0.2 * (1 - 0.05 / 0.1) = 0.1, back 2 * 0.05 = 0.1
        (0.2, (0.4, 0.25, 0.45), (0, -0.1, 0.1)),
        # with 0.02 m/s allowed by now: forward 0.02 * (1 - 0.05 / 0.1) = 0.01, back 0.1; clipped from 0.1005 to 0.02
        (0.02, (0.4, 0.25, 0.45), (0, -0.01 * SLOWED, 0.1 * SLOWED)),
        (0.0, (0.4, 0.25, 0.45), (0, 0, 0)),
        (0.3, (0.9, 0.25, 0.5), (-0.3, 0, 0)),  # far off it only returns, at the task's speed
    ],
)
def test_along_and_back_to_the_path_by_numbers(speed: float, position: tuple, velocity: tuple):
    np.testing.assert_allclose(followed(LINE, 0.25, speed, np.array(position)).velocity, velocity, atol=1e-12)


@given(arrays(np.float64, 3, elements=st.floats(-2, 2)), st.floats(0, 10), st.floats(0, 0.3))
@examples(200)
def test_the_task_is_never_faster_than_allowed_by_now(position: np.ndarray, phase: float, speed: float):
    on_path = followed(CIRCLE, phase, speed, position)
    assert 0 <= on_path.forward[0] <= speed
    # squares of speeds far below 1e-150 m/s are no normal numbers
    assert np.linalg.norm(on_path.velocity) <= speed * (1 + 1e-12) + 1e-150


@pytest.mark.parametrize(
    ("path", "phase", "velocity", "after"),
    [
        # asked for 0.3 m/s along -y, the arm does 0.2 m/s for 0.01 s; the 0.5 m/s across do not count
        (LINE, 0.25, (0.5, -0.2, 0), 0.252),
        (LINE, 0.25, (0, 0, 0), 0.25),  # blocked
        (LINE, 0.25, (0, 0.2, 0), 0.25),  # and never back
        (CIRCLE, CIRCLE.length, (0, 0, 0.3), CIRCLE.length + 0.003),  # it has no end
    ],
)
def test_the_phase_moves_by_what_was_achieved_along_the_path(path: Path, phase: float, velocity: tuple, after: float):
    found = moved(path, phase, 0.3, path.point(phase), np.array(velocity, float))
    assert found == pytest.approx(after, rel=1e-7, abs=0.0)


def test_the_way_back_to_the_path_is_no_way_along_it_by_numbers():
    # 0.05 m behind: asked for 0.2 * 0.5 + 2 * 0.05 = 0.2 m/s, and does it; 0.1 of it is progress, 0.1 catches up
    behind = LINE.point(0.2)
    np.testing.assert_allclose(followed(LINE, 0.25, 0.2, behind).velocity, [0, -0.2, 0], atol=1e-12)
    np.testing.assert_allclose(moved(LINE, 0.25, 0.2, behind, np.array([0, -0.2, 0])), 0.251)
    # slowed to a half it does 0.1 m/s, 0.1 less than asked: all of that is catching up
    np.testing.assert_allclose(moved(LINE, 0.25, 0.2, behind, np.array([0, -0.1, 0])), 0.25)


@pytest.mark.parametrize("path", [CIRCLE, segment((0.0, 0.0, 0.0), (0.0, 9.0, 0.0))])
@given(away=arrays(np.float64, 3, elements=st.floats(-0.3, 0.3)), slowed=st.floats(0.2, 1.0))
@examples(30, least=10)
def test_wherever_it_was_pushed_the_arm_comes_back_and_goes_on(path: Path, away: np.ndarray, slowed: float):
    phase, speed, position = 0.0, 0.0, path.point(0.0) + away
    for _ in range(2500):  # 0.5 m at a fifth of 0.3 m/s is 8 s, and then as long again
        velocity = slowed * followed(path, phase, speed, position).velocity
        phase = moved(path, phase, speed, position, velocity)
        speed = min(PARAMS.speed_m_s, speed + PARAMS.acceleration_m_s2 * DT)
        position = position + DT * velocity
    assert np.linalg.norm(path.point(phase) - position) < 0.005
    assert np.linalg.norm(velocity) > 0.95 * slowed * PARAMS.speed_m_s
    assert phase > 0.2
