"""From readings to obstacles: which, where, for how long, and what silence does."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.examples import examples
from tests.perception.watcher import HAND_LEFT, PARAMS, TCP, Watcher, readings_of

from pretouch.perception.obstacles import silent_units
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import RangeReadings, RangeStatus


@pytest.fixture
def watcher(panda_model, paper_skin):
    return Watcher(panda_model, paper_skin)


# One obstacle


def test_a_reading_becomes_an_obstacle_beside_the_hand(watcher):
    found = watcher.see(1.0, hand_left=0.3)
    np.testing.assert_array_equal(found.unit, [watcher.skin.ids.index("hand_left")])
    np.testing.assert_allclose(found.point, [np.add(HAND_LEFT, (0.0, 0.3, 0.0))], atol=1e-4)
    np.testing.assert_allclose(found.ee_distance, [np.hypot(0.408, 0.0584)], atol=1e-4)
    assert watcher.model.links[found.link[0]] == "panda_hand"
    np.testing.assert_allclose(found.direction, [[0, 1, 0]], atol=0.1)
    assert found.body_distance == pytest.approx(0.305, abs=2e-3)  # the unit sits 5 mm above the surface


def test_units_are_told_apart(watcher):
    found = watcher.see(1.0, hand_left=0.3, hand_right=0.5, forearm_right=0.2)
    assert [watcher.skin.ids[k] for k in found.unit] == ["hand_left", "hand_right", "forearm_right"]
    np.testing.assert_allclose(found.point[:, 1], [0.108 + 0.3, -0.107 - 0.5, -0.05 - 0.2], atol=1e-4)


# How long


def test_an_obstacle_is_given_up_after_its_persistence(watcher):
    watcher.see(1.0, hand_left=0.3)
    old = readings_of(watcher.skin, 1.0, hand_left=0.3)
    assert len(watcher.take(old, 1.059).unit) == 1
    assert len(watcher.take(old, 1.061).unit) == 0
    assert len(watcher.take(old, 1.02).unit) == 1  # by the time it was seen, not by how often it was asked


def test_a_reading_that_comes_too_late_shows_nothing_and_is_a_report(watcher):
    late = readings_of(watcher.skin, 1.0, hand_left=0.3)
    assert len(watcher.take(late, 1.07).unit) == 0
    assert watcher.state.report_stamp[watcher.skin.ids.index("hand_left")] == 1.0


# What is known to be there


@pytest.mark.parametrize(("distance", "shown"), [(0.70, 0), (0.657, 0), (0.60, 0), (0.59, 1), (0.3, 1)])
def test_the_floor_is_no_obstacle_but_what_stands_on_it_is(panda_model, distance, shown):
    T = np.eye(4)
    T[2, 3] = 0.1034 + 0.03  # 20 mm below the fingertips of the ready posture, on the beam's way to the floor
    watcher = Watcher(panda_model, Skin([SensorUnit("down", "panda_hand", T)], panda_model))
    found = watcher.see(1.0, down=distance)  # 0.2 m pedestal, 0.457 m below it the fingertips: 0.657 m
    assert len(found.unit) == shown
    if shown:
        np.testing.assert_allclose(found.point, [TCP - [0, 0, 0.03 + distance]], atol=1e-4)


@pytest.mark.parametrize(("distance", "shown"), [(0.40, 0), (0.35, 0), (0.30, 0), (0.28, 1)])
def test_the_forearm_is_no_obstacle_but_what_is_before_it_is(watcher, distance, shown):
    # the unit on the hand's back sees the arm at 0.354 m, on the edge of its cone
    assert len(watcher.see(1.0, hand_back=distance).unit) == shown


def test_only_the_unit_that_sees_the_arm_is_silenced(watcher):
    watcher.see(1.0, hand_left=0.35)
    found = watcher.take(readings_of(watcher.skin, 1.02, hand_back=0.35, wrist_front=0.35), 1.02)
    assert [watcher.skin.ids[k] for k in found.unit] == ["hand_left", "wrist_front"]


@pytest.mark.parametrize(("distance", "shown"), [(0.42, 0), (0.37, 0), (0.34, 1)])
def test_the_base_is_seen_but_never_the_part_to_move_away(watcher, distance, shown):
    # hand low before the base, its back 0.416 m from it; the first link lies 35 mm behind the base's front
    watcher.q = np.deg2rad([0, 35, 0, -130, 0, 165, 45])
    found = watcher.see(1.0, hand_back=distance)
    assert len(found.unit) == shown
    assert "panda_link0" not in [watcher.model.links[link] for link in found.link]


# Whatever arrives

stamps = st.floats(0.9, 1.3) | st.sampled_from([np.nan, np.inf, -np.inf])
distances = st.floats(0.0, 4.0) | st.sampled_from([np.nan, np.inf, -1.0, 65.535, 1e155, 1e300])
statuses = st.just(0) | st.sampled_from([int(s) for s in RangeStatus]) | st.integers(-1, 300)
messages = st.lists(st.tuples(stamps, distances, statuses), min_size=7, max_size=7)


@examples(100, least=50)
@given(steps=st.lists(messages, min_size=1, max_size=4))
def test_whatever_arrives_obstacles_are_whole(panda_model, paper_skin, steps):
    watcher = Watcher(panda_model, paper_skin)
    for tick, step in enumerate(steps):
        now = 1.0 + 0.05 * tick
        stamp, distance, status = (np.array(part) for part in zip(*step, strict=True))
        found = watcher.take(RangeReadings(stamp.astype(float), distance.astype(float), status.astype(np.int64)), now)
        np.testing.assert_array_equal(found.age, now - watcher.state.point_stamp[found.unit])
        np.testing.assert_array_equal(found.slot, found.unit)
        assert np.all((found.age >= 0.0) & (found.age <= PARAMS.persistence_s))
        for part in (found.point, found.body_point, found.direction, found.body_distance, found.ee_distance):
            assert np.all(np.isfinite(part))
        np.testing.assert_allclose(np.linalg.norm(found.direction, axis=1), 1.0, atol=1e-9)
        assert set(found.link) <= set(panda_model.body.link)
        reach = np.maximum(1.0, found.body_distance)[:, None]
        between = found.point - found.body_point - found.body_distance[:, None] * found.direction
        assert np.all(np.abs(between) <= 1e-9 * reach)


# Silent units


def _silent(watcher, now: float, status: RangeStatus = RangeStatus.OK) -> tuple[float, str]:
    reported = np.full(len(watcher.skin), int(status))
    names = silent_units(watcher.skin, watcher.state.report_stamp, reported, now, PARAMS.silent_after_s)
    return watcher.now.get("scene.silence_scale"), names


def _go_on(watcher, start, duration=0.4, status=RangeStatus.OK, ahead=0.0) -> tuple[float, str]:
    """All units report at 50 Hz after `start`, wrist_front in its own way, its clock ahead by a time [s]."""
    unit = watcher.skin.ids.index("wrist_front")
    now = start
    for tick in range(round(duration / 0.02)):
        now = start + 0.02 * (tick + 1)
        readings = readings_of(watcher.skin, now, **dict.fromkeys(watcher.skin.ids, 0.5))
        readings.stamp[unit] += ahead
        readings.status[unit] = status
        watcher.take(readings, now)
    return _silent(watcher, now)


@pytest.mark.parametrize(
    ("age", "factor", "names"),
    [(0.0, 1.0, ""), (0.05, 1.0, ""), (0.2, 0.5, ""), (0.25, 0.25, ""), (0.31, 0.0, "wrist_front")]
    + [(age, 0.0, "wrist_front") for age in (np.inf, -0.01, np.nan)],
)
def test_a_unit_that_falls_silent_slows_the_arm_and_is_named(watcher, age, factor, names):
    heard = readings_of(watcher.skin, 10.0, **dict.fromkeys(watcher.skin.ids, 0.5))
    heard.stamp[watcher.skin.ids.index("wrist_front")] = 10.0 - age
    watcher.take(heard, 10.0)
    left, silent = _silent(watcher, 10.0)
    assert left == pytest.approx(factor)
    assert silent == names


@pytest.mark.parametrize("ahead", [0.001, 1.0, np.inf, np.nan])
def test_a_unit_whose_clock_is_ahead_is_named(watcher, ahead):
    _go_on(watcher, 9.0)
    assert _go_on(watcher, 9.4, ahead=ahead) == (0.0, "wrist_front")


def test_a_failure_now_and_then_is_no_silence(watcher):
    for cycle in range(10):
        _go_on(watcher, 9.0 + 0.1 * cycle, 0.02)
        assert _go_on(watcher, 9.02 + 0.1 * cycle, 0.08, RangeStatus.SYNC) == (1.0, "")


@examples(100, least=50)
@given(ages=st.lists(st.floats(-0.1, 0.5), min_size=7, max_size=7))
def test_the_arm_stands_exactly_when_a_unit_is_named(panda_model, paper_skin, ages):
    watcher = Watcher(panda_model, paper_skin)
    watcher.take(RangeReadings(10.0 - np.array(ages), np.ones(7), np.zeros(7, np.int64)), 10.0)
    left, silent = _silent(watcher, 10.0)
    assert 0.0 <= left <= 1.0
    assert (left == 0.0) == bool(silent)
    assert left == 1.0 or max(ages) > 0.0999 or min(ages) < 0.0
