"""Shares that can be worked out by hand, and what may never happen to one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.coverage.measure import covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.ways import seen_by, ways_to
from pretouch.sensing.sensor import VL53L1X
from pretouch.sim.scene import SceneSpec, fixtures
from tests.coverage.made import HEIGHT, ROOM, arm, below_it, skin, unit_at
from tests.examples import examples

BRIGHT = CoverageParams(range_m=10.0, reflectance_limit=1e-3)


def ways(model, params, each=20_000):
    """Ways to the one point below the unit."""
    points = np.zeros(each, np.int64)
    return ways_to(model, ROOM, params, np.zeros((1, 2)), points, np.random.default_rng(5), below_it(model))


def share(model, params, units, each=20_000):
    found, worn = ways(model, params, each), skin(model, *units)
    return covered(found, seen_by(found, worn)).arm.ways


def test_directions_are_cosine_weighted(tmp_path):
    found = ways(arm(tmp_path), BRIGHT)
    cosine = found.way[0] @ np.array([1.0, 0.0, 0.0])
    assert cosine.min() >= 0
    # of a density 2 cos sin: cos^2 is uniform
    assert np.histogram(cosine**2, 10, (0, 1))[0] / 20_000 == pytest.approx(0.1, abs=0.01)
    assert found.free.all(), "nothing is in the way"


@pytest.mark.parametrize(("angle", "what"), [(27.0, 0.1453), (50.0, 0.3217)])
def test_the_share_of_one_point_below_one_unit(tmp_path, angle, what):
    """A ball of radius r is in view up to s m away iff s sin(t - half) <= (r - h) sin(half) + r cos(half)."""
    r, s, half = BRIGHT.object_radius_m, 0.01 * (BRIGHT.first + BRIGHT.run), np.deg2rad(angle / 2)
    largest = half + np.arcsin(((r - HEIGHT) * np.sin(half) + r * np.cos(half)) / s)
    expected = np.sin(largest) ** 2
    assert expected == pytest.approx(what, abs=1e-3)
    found = share(arm(tmp_path), BRIGHT, [unit_at(sensor=VL53L1X(field_of_view_deg=angle))])
    assert found == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / 20_000))


def test_range_latency_and_speed_end_it(tmp_path):
    """On the axis a reading at s is s + r - h - 2 r / 3: within 0.5 m up to s = 0.491."""
    model, within = arm(tmp_path), replace(BRIGHT, range_m=0.5)
    assert share(model, replace(within, latency_s=0.17), [unit_at()], 2000) > 0.03, "first reading in time at 0.47 m"
    assert share(model, replace(within, latency_s=0.2), [unit_at()], 2000) == 0.0, "at 0.49 m, and 0.02 m before"
    assert share(model, replace(within, rate_hz=5.0), [unit_at()], 2000) == 0.0, "not for a whole reading"
    assert share(model, replace(within, object_speed_m_s=0.8), [unit_at()], 2000) == 0.0
    assert share(model, replace(within, deceleration_m_s2=0.4), [unit_at()], 2000) == 0.0


def test_a_sensor_of_another_type_sees_as_far_and_as_often_as_it_measures(tmp_path):
    """As above, with range and rate of the sensor in place of the parameters'."""
    model, near = arm(tmp_path), VL53L1X(farthest_m=0.5)
    usual = replace(BRIGHT, range_m=1.3)
    assert usual.seen_by(near)[0] == pytest.approx(0.5)
    assert share(model, replace(usual, latency_s=0.17), [unit_at(sensor=near)], 2000) > 0.03
    assert share(model, replace(usual, latency_s=0.2), [unit_at(sensor=near)], 2000) == 0.0
    assert share(model, usual, [unit_at(sensor=VL53L1X(rate_hz=25.0))], 2000) > 0.1
    assert share(model, usual, [unit_at(sensor=VL53L1X(rate_hz=1.0))], 2000) == 0.0, "0.8 m pass between two readings"


def test_what_the_arm_hides_is_not_seen(tmp_path):
    """A bar 0.2 m before the unit: it reads the bar, and what comes behind it is taken for the bar."""
    (tmp_path / "clear").mkdir()
    clear, hidden = arm(tmp_path / "clear"), arm(tmp_path, "0.25 -0.01 -0.2 0.25 0.01 -0.2")
    assert share(clear, BRIGHT, [unit_at()], 4000) > 0.1
    assert ways(hidden, BRIGHT).free.mean() > 0.5, "most ways pass the bar"
    assert share(hidden, BRIGHT, [unit_at()], 4000) == 0.0


@pytest.fixture(scope="module")
def few(panda_model):
    q = panda_model.description.q_ready + 0.2 * np.random.default_rng(3).uniform(-1, 1, (2, 7))
    return q, np.repeat(np.arange(0, len(panda_model.surface.link), 4), 2)


@pytest.fixture(scope="module")
def usual(panda_model, paper_skin, few):
    """Ways, and which unit of the paper's skin sees which of them."""
    return found_by(panda_model, paper_skin, few, CoverageParams())


def found_by(model, worn, few, params):
    made = ways_to(model, fixtures(SceneSpec()), params, *few, np.random.default_rng(4))
    return made, seen_by(made, worn)


@examples(25, least=10)
@given(
    st.floats(0.01, 0.6), st.floats(0.05, 0.4), st.floats(0.001, 0.08), st.floats(10.0, 60.0), st.floats(0.5, 2.0),
    st.sampled_from(["object_speed_m_s", "arm_speed_m_s", "latency_s", "rate_hz", "range_m", "deceleration_m_s2"]),
    st.floats(0.5, 1.0),
)  # fmt: skip
def test_what_is_seen_at_worse_is_seen_at_better(
    panda_model, paper_skin, few, speed, own, latency, rate, reach, name, factor
):
    worse = CoverageParams(
        object_speed_m_s=speed, arm_speed_m_s=own, latency_s=latency, rate_hz=rate, range_m=reach, way_m=2.0
    )
    up = name in ("rate_hz", "range_m", "deceleration_m_s2")
    better = replace(worse, **{name: getattr(worse, name) * (1 / factor if up else factor)})
    made, seen = found_by(panda_model, paper_skin, few, worse)
    again, more = found_by(panda_model, paper_skin, few, better)
    np.testing.assert_array_equal(made.free, again.free)
    assert not np.any(seen & ~more)


@given(st.sets(st.integers(0, 6), max_size=7), st.integers(0, 6))
def test_one_more_unit_never_lowers_a_share(usual, some, one):
    made, seen = usual
    less, more = (covered(made, seen[sorted(units)]) for units in (some, some | {one}))
    assert less.arm.ways <= more.arm.ways
    for a, b in zip(less.links, more.links, strict=True):
        assert a.ways <= b.ways


def test_what_is_not_free_counts_nowhere(usual):
    made, seen = usual
    assert 0.1 < made.free.mean() < 0.9
    assert not np.any(seen & ~made.free)
    found = covered(made, seen)
    assert found.free.sum() == made.free.sum()
    assert np.nansum(found.point_share * found.free) == pytest.approx(seen.any(axis=0).sum())


def test_where_nothing_can_come_there_is_no_share(usual):
    made, seen = usual
    nothing = covered(replace(made, weight=np.zeros_like(made.weight)), np.zeros_like(seen))
    assert nothing.links == ()
    assert np.isnan(nothing.arm.ways)
