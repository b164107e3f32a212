"""Eqs. 3 and 4 by numbers, and that the speed never jumps up, whatever is lost from view or seen again."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.examples import examples

from pretouch.control.path import PathPace, reduce_speed, speed_scale


def pace_of(scale: float, cycles: int) -> PathPace:
    """What is remembered some cycles after the factor was `scale`."""
    return PathPace(np.full(1, scale), np.full(1, cycles), np.zeros(1), np.zeros(1))


def faded(fresh: list[float]) -> list[float]:
    """Factor on the speed for a sequence of fresh factors, with l_max = 4."""
    pace = pace_of(1.0, 0)
    return [reduce_speed(pace, factor, 4) for factor in fresh]


def scales(distances: list[float]) -> list[float]:
    """Factor on the speed for a sequence of nearest distances [m], infinite where none is seen."""
    return faded([speed_scale(d, 0.8) for d in distances])


@pytest.mark.parametrize(
    ("distance", "scale"), [(0.2, 0.25), (0.4, 0.5), (0.8, 1.0), (1.7, 1.0), (np.inf, 1.0), (0.0, 0.0)]
)
def test_eq_3_by_numbers(distance: float, scale: float):
    # 0.2 / 0.8 = 0.25, 0.4 / 0.8 = 0.5; beyond d_max obstacles are discarded
    assert speed_scale(distance, 0.8) == pytest.approx(scale)


@pytest.mark.parametrize(("l_obs", "scale"), [(0, 0.25), (50, 0.4375), (200, 1.0), (300, 1.0)])
def test_eq_4_by_numbers(l_obs: int, scale: float):
    # 0.25 + (1 - 0.25) * 50 / 200 = 0.25 + 0.1875
    assert reduce_speed(pace_of(0.25, l_obs - 1), 1.0, 200) == pytest.approx(scale)


NONE = np.inf


@pytest.mark.parametrize(
    ("distances", "expected"),
    [
        # 0.4 / 0.8 = 0.5, then a quarter of the missing half each cycle
        ([NONE, 0.4, NONE, NONE, NONE, NONE, NONE], [1.0, 0.5, 0.625, 0.75, 0.875, 1.0, 1.0]),
        # a farther reading during the fading: lost at 0.25: 0.4375; 0.72 / 0.8 = 0.9 is more than the fading 0.625,
        # which goes on; then 0.8125; then 0.9 < 1
        ([0.2, NONE, 0.72, 0.72, 0.72], [0.25, 0.4375, 0.625, 0.8125, 0.9]),
        ([0.4, NONE, 0.08, NONE], [0.5, 0.625, 0.1, 0.1 + 0.9 / 4]),  # a nearer one counts at once
        ([0.4, 0.9, 0.9], [0.5, 0.625, 0.75]),  # an object leaving beyond d_max
        # 0.2 m is lost while 0.72 m stays: 0.25, then a quarter of the missing 0.75 each cycle, up to 0.72 / 0.8 = 0.9
        ([0.2, 0.72, 0.72, 0.72, 0.72, 0.72], [0.25, 0.4375, 0.625, 0.8125, 0.9, 0.9]),
        # a retreat faster than the fading:
        # 0.1 + 0.9 / 4 = 0.325 < 0.5; then 0.55 > 0.5, which holds; from there 0.5 + 0.5 / 4 = 0.625 < 0.75
        ([0.08, 0.4, 0.4, 0.4, 0.6], [0.1, 0.325, 0.5, 0.5, 0.625]),
        # a slow one is followed at once: 0.44 / 0.8 = 0.55 is less than the fading 0.625, and 0.48 / 0.8 = 0.6 less
        # than 0.55 + 0.45 / 4
        ([0.4, 0.44, 0.48], [0.5, 0.55, 0.6]),
        # flicker never beats steady sight by more than one cycle of fading
        ([0.4, NONE] * 20, [0.5, 0.625] * 20),
    ],
)
def test_the_factor_fades_by_numbers(distances: list[float], expected: list[float]):
    np.testing.assert_allclose(scales(distances), expected)


def test_a_silent_unit_heard_again_fades_from_nothing():
    np.testing.assert_allclose(faded([0.5, 0.0, 1.0, 1.0, 1.0, 1.0]), [0.5, 0.0, 0.25, 0.5, 0.75, 1.0])


readings = st.lists(st.one_of(st.just(np.inf), st.floats(0.0, 1.2)), min_size=2, max_size=30)


@given(readings)
@examples(300)
def test_the_factor_rises_no_faster_than_the_fading(distances: list[float]):
    out = scales(distances)
    assert all(0.0 <= scale <= 1.0 for scale in out)
    for before, after in pairwise([1.0, *out]):
        assert after <= before + (1 - min(out)) / 4 + 1e-12


@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=30))
@examples(300)
def test_each_factor_is_the_fresh_one_or_on_its_way_up_to_it(fresh: list[float]):
    out = faded(fresh)
    for (before, after), factor in zip(pairwise([1.0, *out]), fresh, strict=True):
        assert after == factor or before <= after < factor


def test_a_factor_that_is_no_number_leaves_a_usable_factor():
    # 0.5 + 0.5 * 3 / 4: as if nothing were seen
    pace = pace_of(0.5, 2)
    assert (reduce_speed(pace, np.nan, 4), pace.scale[0], pace.cycles[0]) == (0.875, 0.5, 3)
