"""What a unit sees of a ball that comes, by numbers worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.coverage.sighting import GRID_M, BallWays, View, common_area, in_view, ways_free, ways_seen
from pretouch.robot.body import Capsules
from pretouch.sensing.sensor import PAPER_SENSOR, Sensors, cones_of

HALF = np.deg2rad(13.5)
LIGHT = 2.0 / 3.0 * 0.5 / 0.17 * 1.3**2


def test_circles_that_share_nothing_all_and_half():
    assert common_area(0.1, 0.2, 0.31) == 0.0
    assert common_area(0.1, 0.2, 0.3) == pytest.approx(0.0, abs=1e-8)
    assert common_area(0.1, 0.3, 0.1) == pytest.approx(np.pi * 0.01)
    # two unit circles, a radius apart: 2 pi / 3 - sqrt(3) / 2
    assert common_area(1.0, 1.0, 1.0) == pytest.approx(2 * np.pi / 3 - np.sqrt(3) / 2)


@given(st.floats(0.01, 1.0), st.floats(0.01, 1.0), st.floats(0.0, 2.5))
def test_the_common_area_is_that_of_points_counted(r, R, apart):
    side = np.linspace(-r, r, 201)
    x, y = np.meshgrid(side, side)
    inside = (x**2 + y**2 <= r * r) & ((x - apart) ** 2 + y**2 <= R * R)
    counted = inside.mean() * 4 * r * r * (201 / 200) ** 2
    assert common_area(r, R, apart) == pytest.approx(counted, abs=0.06 * r * r)


def test_a_fist_on_the_axis_is_seen_as_far_as_its_light_reaches():
    # light r^2 = (d tan)^2 (d - 2 r / 3)^2 has its solution at d (d - 2 r / 3) = r sqrt(light) / tan
    product = 0.05 * np.sqrt(LIGHT) / np.tan(HALF)
    farthest = 0.05 / 3 + np.sqrt((0.05 / 3) ** 2 + product)
    assert farthest == pytest.approx(0.633, abs=0.001)
    assert in_view(farthest - 1e-6, (farthest - 1e-6) ** 2, 0.05, np.tan(HALF), 1.3, LIGHT)
    assert not in_view(farthest + 1e-6, (farthest + 1e-6) ** 2, 0.05, np.tan(HALF), 1.3, LIGHT)


def test_at_the_edge_behind_and_beyond_the_limit():
    bright = 1e9
    aside = 0.4 * np.tan(HALF) + 0.05
    assert in_view(0.4, 0.16 + (aside - 1e-4) ** 2, 0.05, np.tan(HALF), 1.3, bright)
    assert not in_view(0.4, 0.16 + (aside + 1e-4) ** 2, 0.05, np.tan(HALF), 1.3, bright)
    assert not in_view(-0.4, 0.16, 0.05, np.tan(HALF), 1.3, bright)
    reading = 0.4 - 2 / 3 * 0.05
    assert in_view(0.4, 0.16, 0.05, np.tan(HALF), reading + 1e-6, bright)
    assert not in_view(0.4, 0.16, 0.05, np.tan(HALF), reading - 1e-6, bright)
    assert in_view(-0.01, 0.01**2, 0.05, np.tan(HALF), 1.3, bright), "a ball on the unit itself"


def seen(start, way, first=10, last=50, run=2, limit=1.3, free=True):
    out = np.zeros((1, 1), np.bool_)
    ways_seen(
        BallWays(np.array([start]), np.array([way]), 0.05), np.array([free]), first, last,
        Sensors(np.zeros((1, 3)), np.eye(3)[None], np.zeros(1, np.int64)), cones_of([PAPER_SENSOR]),
        View(np.array([limit]), np.full(1, 1e9), np.full(1, run)), out,
    )  # fmt: skip
    return bool(out[0, 0])


def test_a_ball_that_crosses_the_cone_has_to_be_in_it_for_a_whole_reading():
    # along x at a depth of 0.3 m: within 0.3 tan + 0.05 = 0.122 m of the axis for 0.244 m, or 25 places
    start, way = [-0.4, 0.0, 0.3], [1.0, 0.0, 0.0]
    assert 2 * (0.3 * np.tan(HALF) + 0.05) // GRID_M == 24
    assert seen(start, way, 0, 80, run=23)
    assert not seen(start, way, 0, 80, run=26)
    assert not seen(start, way, 53, 80), "in view before that only"
    assert not seen(start, way, 0, 27), "in view after that only"
    assert not seen(start, way, 0, 80, free=False)


def free(start, way, radius=0.05, length=0.8):
    a, b = np.array([[0.0, 0.0, 0.0], [0.0, -1.0, 0.5]]), np.array([[0.0, 0.0, 0.1], [0.0, 1.0, 0.5]])
    capsules, floor = Capsules(np.zeros(2, np.int64), a, b, np.array([0.1, 0.02])), np.array([[0.0, 0.0, 1.0, -0.2]])
    return bool(ways_free(BallWays(np.array([start]), np.array([way]), radius), length, capsules, floor)[0])


def test_a_way_is_free_of_the_rest_of_the_arm_and_of_the_floor():
    assert free([0.15, 0.0, 0.05], [1.0, 0.0, 0.0])
    assert not free([0.0, 0.0, 0.25], [0.0, 0.0, 1.0]), "the bar is in the way"
    assert free([0.0, 0.0, 0.25], [0.0, 0.0, 1.0], length=0.17), "it ends before the bar"
    down = np.array([1.0, 0.0, -0.3]) / np.sqrt(1.09)
    assert not free([0.15, 0.0, 0.05], down), "through the floor"
    # lowest at 0.05 - 0.8 * 0.2473 = -0.148, plus the radius: free at -0.198 of -0.2
    gentle = np.array([np.sqrt(1 - 0.2473**2), 0.0, -0.2473])
    assert free([0.16, 0.0, 0.05], gentle, radius=0.0021)
    assert free([0.16, 0.0, 0.05], gentle, radius=0.0519)
    assert not free([0.16, 0.0, 0.05], gentle, radius=0.0525)
