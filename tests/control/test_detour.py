"""The path goes aside where it is blocked, keeps to one side, and comes back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.control.detour import Detour, detour_init, next_detour
from pretouch.params import AnticipationParams

PARAMS = AnticipationParams(detour=True)
AHEAD = np.array([0.0, 0.3, 0.0])
DT = 0.01
numbers = st.floats(-1, 1)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)


def step(state: Detour, moving, normal=(0.0, 1.0, 0.0), limit=0.03, asked=AHEAD, hand=True, params=PARAMS) -> Detour:
    return next_detour(
        state, asked, np.asarray(moving), np.array([normal], dtype=float), np.array([limit]), np.array([hand]), params,
        DT,
    )  # fmt: skip


def blocked(cycles: int, **given) -> Detour:
    state = detour_init()
    for _ in range(cycles):
        state = step(state, 0.1 * AHEAD, **given)
    return state


def test_blocked_head_on_the_path_goes_up():
    state = blocked(50)
    # 0.1 m/s for 0.5 s
    np.testing.assert_allclose(state.offset, [0.0, 0.0, 0.05], atol=1e-12)
    assert state.blocked == pytest.approx(0.5)


def test_blocked_at_an_angle_it_goes_on_to_the_side_it_was_going_to():
    slanted = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    # what is left of y across (1, 1, 0) is (-1, 1, 0)
    offset = blocked(50, normal=slanted).offset
    np.testing.assert_allclose(offset, 0.05 * np.array([-1.0, 1.0, 0.0]) / np.sqrt(2), atol=1e-9)


def test_it_keeps_to_its_side_when_the_normal_wavers():
    state, rng = blocked(1), np.random.default_rng(1000)
    for _ in range(100):
        normal = np.array([0.0, 1.0, 0.0]) + 0.2 * rng.normal(size=3)
        after = step(state, 0.1 * AHEAD, normal=normal / np.linalg.norm(normal))
        assert (after.offset - state.offset)[2] > 0.0005
        state = after


def test_the_shift_is_bounded_and_stays_while_the_way_is_blocked():
    state = blocked(1000)
    assert np.linalg.norm(state.offset) == pytest.approx(PARAMS.detour_distance_m)
    assert state.blocked == pytest.approx(10.0)


def test_with_the_way_clear_it_returns_to_the_path_after_a_while():
    state = blocked(100)
    begun = state.offset.copy()
    for _ in range(49):
        state = step(state, AHEAD, limit=1.0)
    np.testing.assert_array_equal(state.offset, begun)
    for _ in range(102):
        state = step(state, AHEAD, limit=1.0)
    np.testing.assert_array_equal(state.vectors, np.zeros((2, 3)))
    assert state.blocked == 0.0


def test_it_does_not_return_into_what_is_in_the_way_of_that():
    state = blocked(100)
    for _ in range(200):
        state = step(state, AHEAD, normal=(0.0, 0.0, -1.0), limit=0.05)
    np.testing.assert_allclose(state.offset, [0.0, 0.0, 0.1], atol=1e-9)


def test_a_link_before_the_hand_and_a_row_that_does_not_bind_shift_nothing():
    np.testing.assert_array_equal(blocked(50, hand=False).vectors, np.zeros((2, 3)))
    np.testing.assert_array_equal(blocked(50, limit=0.5).vectors, np.zeros((2, 3)))


def test_switched_off_the_path_stays_but_the_time_it_is_blocked_is_counted():
    state = blocked(50, params=AnticipationParams())
    np.testing.assert_array_equal(state.vectors, np.zeros((2, 3)))
    assert state.blocked == pytest.approx(0.5)


@given(vectors, vectors, vectors, vectors, st.floats(-0.1, 1.0))
def test_whatever_is_near_it_stays_finite_and_bounded(asked, moving, normal, offset, limit):
    size = np.linalg.norm(normal)
    normal = normal / size if size > 1e-6 else np.array([0.0, 0.0, 1.0])
    length = np.linalg.norm(offset)
    start = offset * (PARAMS.detour_distance_m / length) if length > PARAMS.detour_distance_m else offset
    state = Detour(np.array([start, np.zeros(3)]), np.zeros(2))
    for _ in range(3):
        state = step(state, moving, normal=normal, limit=limit, asked=asked)
        assert np.isfinite(state.vectors).all()
        assert np.linalg.norm(state.offset) <= PARAMS.detour_distance_m + 1e-9
        side = np.linalg.norm(state.vectors[1])
        assert side == 0 or side == pytest.approx(1.0)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)])
def test_a_side_is_found_for_every_normal(normal):
    state = blocked(10, normal=normal, asked=0.3 * np.array(normal))
    # the hand moves little along what is asked, so the way counts as blocked
    assert np.linalg.norm(state.offset) == pytest.approx(0.01)
    assert state.offset @ np.array(normal) == pytest.approx(0.0, abs=1e-12)
