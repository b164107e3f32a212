import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.page import palette
from pretouch.page.expectation import LEVELS, SPREAD_M, expectation, in_levels, on_surface, shares
from pretouch.params import ThresholdParams
from pretouch.types import Obstacles

UP = np.array([[0.0, 0.0, 1.0]])


def obstacles(units: list[int], distances: list[float]) -> Obstacles:
    count = len(units)
    zeros = np.zeros((count, 3))
    return Obstacles(
        np.array(units, np.int64), zeros, np.zeros(count), zeros, np.zeros(count, np.int64), zeros,
        np.array(distances), np.zeros(count),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("units", "distances", "expected"),
    [
        ([0, 1, 2, 3, 4], [0.05, 0.45, 0.85, 2.0, -0.01], [1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0]),
        ([1, 1], [0.65, 0.25], [0.0, 0.75, 0.0, 0.0, 0.0, 0.0, 0.0]),  # the nearest of two points counts
        ([1, 7, 12], [0.45, 0.05, 0.05], [0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]),  # two seen by outside sources
        ([], [], [0.0] * 7),
    ],
)
def test_contact_is_expected_fully_at_d_min_not_at_all_at_d_max_and_by_half_between(
    units: list[int], distances: list[float], expected: list[float]
) -> None:
    found = expectation(obstacles(units, distances), 7, ThresholdParams(d_min_m=0.05, d_max_m=0.85))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_unit_colours_the_surface_under_it_fully_and_nothing_from_the_spread_on() -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [SPREAD_M, 0.0, 0.0], [0.0, 3 * SPREAD_M, 0.0]])
    found = shares(vertices, np.repeat(UP, 3, axis=0), np.zeros((1, 3)), UP)
    np.testing.assert_allclose(found[:, 0], [1.0, 0.0, 0.0], atol=1e-12)


def test_a_unit_does_not_colour_the_far_side_of_a_thin_link() -> None:
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    found = shares(np.zeros((3, 3)), normals, np.zeros((1, 3)), UP)
    np.testing.assert_allclose(found[:, 0], [1.0, 0.5, 0.0], atol=1e-12)


@given(st.floats(0.0, 0.2), st.floats(1e-4, 2e-3))
def test_patches_are_smooth(at: float, apart: float) -> None:
    vertices = np.array([[at, 0.0, 0.0], [at + apart, 0.0, 0.0]])
    a, b = shares(vertices, np.repeat(UP, 2, axis=0), np.zeros((1, 3)), UP)[:, 0]
    steepest = 16 / (3 * np.sqrt(3)) / 2 / SPREAD_M  # of (1 - x^2)^2, at x = 1 / sqrt 3
    assert abs(a - b) <= steepest * apart + 1e-12


@given(st.lists(st.floats(0, 1), min_size=3, max_size=3), st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_what_units_expect_adds_up_within_one(share: list[float], expected: list[float]) -> None:
    (found,) = on_surface(np.array([share]), np.array(expected))
    most = max(s * e for s, e in zip(share, expected, strict=True))
    assert most - 1e-12 <= found <= 1.0


def test_levels_are_even_steps() -> None:
    assert in_levels(np.array([0.0, 0.5, 1.0])) == (0, LEVELS // 2, LEVELS)
    assert len({in_levels(np.array([e])) for e in np.linspace(0, 1, 1000)}) == LEVELS + 1


def test_colours_go_from_the_arms_own_to_red() -> None:
    plain, half, full = palette.expected(np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(plain, palette.ARM)
    assert full[0] > 190
    assert full[1:].max() < 50
    assert full[1] < half[1] < plain[1]
