"""Eqs. 3 and 4 by numbers, and that the speed never jumps up, whatever is lost from view or seen again."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pretouch.control.reduction import ReductionState, faded_scale, reduce_speed, speed_scale

D_MAX = 0.8


def faded(fresh: list[float], l_max: int = 4) -> list[float]:
    """Factor on the speed for a sequence of fresh factors."""
    state, out = ReductionState(), []
    for factor in fresh:
        scale, state = reduce_speed(state, factor, l_max)
        out.append(scale)
    return out


def scales(distances: list[float], l_max: int = 4) -> list[float]:
    """Factor on the speed for a sequence of nearest distances [m], infinite where none is seen."""
    return faded([speed_scale(d, D_MAX) for d in distances], l_max)


@pytest.mark.parametrize(
    ("distance", "scale"), [(0.2, 0.25), (0.4, 0.5), (0.8, 1.0), (1.7, 1.0), (np.inf, 1.0), (0.0, 0.0)]
)
def test_eq_3_by_numbers(distance: float, scale: float):
    # 0.2 / 0.8 = 0.25, 0.4 / 0.8 = 0.5; beyond d_max obstacles are discarded
    assert speed_scale(distance, 0.8) == pytest.approx(scale)


@pytest.mark.parametrize(("l_obs", "scale"), [(0, 0.25), (50, 0.4375), (200, 1.0), (300, 1.0)])
def test_eq_4_by_numbers(l_obs: int, scale: float):
    # 0.25 + (1 - 0.25) * 50 / 200 = 0.25 + 0.1875
    assert faded_scale(0.25, l_obs, 200) == pytest.approx(scale)


def test_the_speed_comes_back_in_l_max_cycles():
    # 0.4 / 0.8 = 0.5, then a quarter of the missing half each cycle
    expected = [1.0, 0.5, 0.625, 0.75, 0.875, 1.0, 1.0]
    np.testing.assert_allclose(scales([np.inf, 0.4, np.inf, np.inf, np.inf, np.inf, np.inf]), expected)


def test_table_i_restores_full_speed_after_two_seconds():
    out = scales([0.2] + [np.inf] * 200, 200)
    assert out[199] < 1.0
    assert out[200] == 1.0


def test_a_farther_reading_during_the_fading_does_not_speed_up():
    # lost at 0.25: 0.4375; 0.72 / 0.8 = 0.9 is more than the fading 0.625, which goes on; then 0.8125; then 0.9 < 1
    np.testing.assert_allclose(scales([0.2, np.inf, 0.72, 0.72, 0.72]), [0.25, 0.4375, 0.625, 0.8125, 0.9])


def test_a_nearer_reading_during_the_fading_counts_at_once():
    np.testing.assert_allclose(scales([0.4, np.inf, 0.08, np.inf]), [0.5, 0.625, 0.1, 0.1 + 0.9 / 4])


def test_an_object_leaving_beyond_d_max_fades_too():
    np.testing.assert_allclose(scales([0.4, 0.9, 0.9]), [0.5, 0.625, 0.75])


def test_a_farther_object_left_in_view_does_not_speed_up():
    # 0.2 m is lost while 0.72 m stays: 0.25, then a quarter of the missing 0.75 each cycle, up to 0.72 / 0.8 = 0.9
    np.testing.assert_allclose(scales([0.2, 0.72, 0.72, 0.72, 0.72, 0.72]), [0.25, 0.4375, 0.625, 0.8125, 0.9, 0.9])


def test_a_retreat_faster_than_the_fading_is_followed_by_the_fading():
    # 0.1 + 0.9 / 4 = 0.325 < 0.5; then 0.55 > 0.5, which holds; from there 0.5 + 0.5 / 4 = 0.625 < 0.75
    np.testing.assert_allclose(scales([0.08, 0.4, 0.4, 0.4, 0.6]), [0.1, 0.325, 0.5, 0.5, 0.625])


def test_a_slow_retreat_is_followed_at_once():
    # 0.44 / 0.8 = 0.55 is less than the fading 0.625, and 0.48 / 0.8 = 0.6 less than 0.55 + 0.45 / 4
    np.testing.assert_allclose(scales([0.4, 0.44, 0.48]), [0.5, 0.55, 0.6])


def test_a_silent_unit_heard_again_fades_from_nothing():
    np.testing.assert_allclose(faded([0.5, 0.0, 1.0, 1.0, 1.0, 1.0]), [0.5, 0.0, 0.25, 0.5, 0.75, 1.0])


def test_flicker_never_beats_steady_sight():
    # every second reading lost: the factor stays below one fading cycle above the true one
    out = scales([0.4, np.inf] * 20)
    assert max(out) <= 0.5 + 0.5 / 4 + 1e-12


readings = st.lists(st.one_of(st.just(np.inf), st.floats(0.0, 1.2)), min_size=2, max_size=30)


@given(readings)
@settings(deadline=None, derandomize=True, max_examples=300)
def test_the_factor_rises_no_faster_than_the_fading(distances: list[float]):
    out = scales(distances)
    assert all(0.0 <= scale <= 1.0 for scale in out)
    for before, after in pairwise([1.0, *out]):
        assert after <= before + (1 - min(out)) / 4 + 1e-12


@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=30))
@settings(deadline=None, derandomize=True, max_examples=300)
def test_each_factor_is_the_fresh_one_or_on_its_way_up_to_it(fresh: list[float]):
    out = faded(fresh)
    for (before, after), factor in zip(pairwise([1.0, *out]), fresh, strict=True):
        assert after == factor or before <= after < factor


@given(readings)
@settings(deadline=None, derandomize=True, max_examples=300)
def test_the_factor_is_never_above_what_the_nearest_seen_obstacle_allows(distances: list[float]):
    for scale, distance in zip(scales(distances), distances, strict=True):
        assert scale <= speed_scale(distance, D_MAX) + 1e-12


@given(st.floats(0.0, 0.79))
@settings(deadline=None, derandomize=True, max_examples=50)
def test_fading_is_monotone(distance: float):
    out = scales([distance] + [np.inf] * 10)
    assert all(a <= b for a, b in pairwise(out))
    assert out[-1] == 1.0


def test_a_factor_that_is_no_number_leaves_a_usable_factor():
    scale, state = reduce_speed(ReductionState(0.5, 2), np.nan, 4)
    # 0.5 + 0.5 * 3 / 4: as if nothing were seen
    assert scale == 0.875
    assert np.isfinite(state.scale)
