from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from pretouch.perception.closest import no_obstacles
from pretouch.perception.obstacles import (
    NewReadings,
    TrackState,
    is_evidence,
    locate,
    measured_distance,
    newer,
    points_of_units,
    sensor_poses,
    take_in,
    track_init,
)
from pretouch.robot.description import panda
from pretouch.sensing.sensor import PAPER_SENSOR, cones_of
from pretouch.types import RangeReadings, RangeStatus

INF, NAN = np.inf, np.nan
SHOWN = [RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED]
NEAR = [RangeStatus.MIN_RANGE, RangeStatus.MIN_CLIPPED]
NO_TARGET = [RangeStatus.SIGNAL, RangeStatus.SIGMA, RangeStatus.OUT_OF_BOUNDS, RangeStatus.WRAPPED]
anything = st.floats(allow_nan=True, allow_infinity=True)


def _readings(stamp, distance=0.5, status=RangeStatus.OK) -> RangeReadings:
    stamp = np.atleast_1d(np.asarray(stamp, dtype=np.float64))
    return RangeReadings(stamp, np.full(len(stamp), distance), np.full(len(stamp), status, dtype=np.int64))


def track(
    state: TrackState, stamps: list[float], points: np.ndarray, shows: np.ndarray, tells: np.ndarray, now: float
) -> TrackState:
    """The state with readings of these stamps taken in; a point is given up after 0.06 s."""
    point, times, stamp = state.point.copy(), state.times.copy(), np.array(stamps)
    take_in(point, times, NewReadings(stamp, points, newer(state.used, stamp, now), shows, tells), now, 0.06)
    return replace(state, point=point, times=times)


def _take(state, stamp, now, x=1.0, shows=True, tells=True):
    """One reading of one unit that shows something at (x, 0, 0)."""
    return track(state, [stamp], np.array([[x, 0.0, 0.0]]), np.array([shows]), np.array([tells]), now)


# Eq. 1


def test_an_obstacle_lies_along_the_beam():
    position = np.array([[0.1, 0.2, 0.3], [1.0, 0.0, 0.0]])
    tilted = [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]  # beam along (0.6, 0, 0.8)
    level = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]  # beam along x
    found = locate(position, np.array([tilted, level]), np.array([0.5, 0.25]))
    np.testing.assert_allclose(found, [[0.4, 0.2, 0.7], [1.25, 0.0, 0.0]], atol=1e-15)


@given(
    position=arrays(np.float64, 3, elements=st.floats(-2, 2)),
    turn=arrays(np.float64, 3, elements=st.floats(-4, 4)),
    distance=st.floats(0, 4),
)
def test_an_obstacle_is_at_its_reading_seen_from_the_sensor(position, turn, distance):
    R = Rotation.from_rotvec(turn).as_matrix()
    (found,) = locate(position[None], R[None], np.array([distance]))
    np.testing.assert_allclose(R.T @ (found - position), [0, 0, distance], atol=1e-12)


def test_sensor_poses_chain_link_and_mounting(panda_model, paper_skin):
    kin = panda_model.kinematics(np.linspace(-1.5, 1.5, 7))
    position, rotation = sensor_poses(paper_skin, kin)
    for k, (link, T_link_sensor) in enumerate(zip(paper_skin.link, paper_skin.T_link_sensor, strict=True)):
        T_O_link = np.eye(4)
        T_O_link[:3, :3], T_O_link[:3, 3] = kin.rotation[link], kin.position[link]
        T_O_sensor = T_O_link @ T_link_sensor
        np.testing.assert_allclose(position[k], T_O_sensor[:3, 3], atol=1e-15)
        np.testing.assert_allclose(rotation[k], T_O_sensor[:3, :3], atol=1e-15)


def test_the_left_unit_of_the_hand_looks_left(panda_model, paper_skin):
    kin = panda_model.kinematics(panda().q_ready)
    position, rotation = sensor_poses(paper_skin, kin)
    left = paper_skin.ids.index("hand_left")
    np.testing.assert_allclose(position[left] - kin.position[panda_model.ee], [0.0, 0.108, 0.1034 - 0.045], atol=1e-5)
    np.testing.assert_allclose(rotation[left, :, 2], [0, 1, 0], atol=1e-5)


# What a reading stands for

ONE = cones_of([PAPER_SENSOR])


@pytest.mark.parametrize("status", [s for s in RangeStatus if s not in SHOWN])
def test_only_good_and_too_near_readings_show_a_target(status):
    for distance in (0.5, 0.0, NAN, INF, -1.0):
        (shown,) = measured_distance(_readings(0.0, distance, status), ONE)
        np.testing.assert_equal(shown, 0.04 if status in NEAR else NAN)


@pytest.mark.parametrize("status", SHOWN)
@pytest.mark.parametrize(
    ("distance", "shown"),
    [(0.5, 0.5), (4.0, 4.0), (0.04, 0.04), (0.01, 0.04), (0.0, 0.04)]
    + [(impossible, NAN) for impossible in (-0.01, 4.1, 65.535, 1e300, INF, NAN)],
)
def test_a_good_reading_is_taken_within_what_the_sensor_can_measure(distance, shown, status):
    np.testing.assert_equal(measured_distance(_readings(0.0, distance, status), ONE), [shown])


@given(distance=anything, status=st.integers(-1, 300))
def test_whatever_arrives_is_a_distance_or_nothing(distance, status):
    (shown,) = measured_distance(_readings(0.0, distance, status), ONE)
    assert np.isnan(shown) or 0.04 <= shown <= 4.0


# Which readings tell anything


def _tells(status, distance) -> bool:
    readings = _readings(0.0, distance, status)
    (tells,) = is_evidence(readings, measured_distance(readings, ONE), ONE)
    return bool(tells)


@pytest.mark.parametrize("status", [*RangeStatus, -1, 8, 300])
def test_a_target_tells_and_so_does_its_absence_but_no_failure(status):
    assert _tells(status, 0.5) == (status in SHOWN + NEAR + NO_TARGET)
    assert _tells(status, NAN) == (status in NEAR + NO_TARGET)


@given(distance=anything, status=st.integers(-1, 300))
def test_without_a_distance_only_a_missing_or_far_target_tells(distance, status):
    (shown,) = measured_distance(_readings(0.0, distance, status), ONE)
    far = status in SHOWN and 4.0 < distance < INF
    assert _tells(status, distance) == (not np.isnan(shown) or far or status in NO_TARGET)


# How long a point is kept


def test_a_point_outlives_missed_readings_but_not_its_persistence():
    state = _take(track_init(1), 10.0, now=10.0)
    state = _take(state, 10.02, now=10.02, x=NAN, shows=False)
    np.testing.assert_array_equal(state.point, [[1, 0, 0]])
    assert state.seen == 10.0  # when it was shown, not when it was missed
    assert state.used == 10.02


@pytest.mark.parametrize("late", [10.0, 9.99, -INF, NAN])
def test_a_reading_that_is_not_newer_changes_nothing(late):
    state = _take(track_init(1), 10.0, now=10.0)
    again = _take(state, late, now=10.01, x=2.0)
    np.testing.assert_array_equal(again.point, state.point)
    for part in ("seen", "used", "heard"):
        np.testing.assert_array_equal(getattr(again, part), getattr(state, part))


def test_an_older_miss_does_not_hide_behind_a_newer_hit():
    state = _take(track_init(1), 10.02, now=10.02)
    state = _take(state, 10.0, now=10.03, shows=False)
    assert (state.seen, state.used) == (10.02, 10.02)


def test_a_reading_from_the_future_waits_until_its_time():
    state = _take(track_init(1), 10.02, now=10.0)
    assert state.seen == state.used == state.heard == -INF
    state = _take(state, 10.02, now=10.02)
    assert state.seen == state.used == state.heard == 10.02


def test_a_reading_that_comes_too_late_is_used_up_but_shows_nothing():
    state = _take(track_init(1), 10.0, now=10.07)
    assert (state.used, state.heard, state.seen) == (10.0, 10.0, -INF)
    assert np.isnan(state.point).all()


def test_units_are_kept_apart():
    points = np.array([[1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0], [4.0, 0, 0]])
    shows, tells = np.array([True, False, False, True]), np.array([True, True, False, True])
    state = track(track_init(4), [1.0, 1.0, 1.0, -INF], points, shows, tells, 1.0)
    np.testing.assert_array_equal(state.point, [[1, 0, 0], [NAN] * 3, [NAN] * 3, [NAN] * 3])
    np.testing.assert_array_equal(state.seen, [1, -INF, -INF, -INF])
    np.testing.assert_array_equal(state.heard, [1, 1, -INF, -INF])
    np.testing.assert_array_equal(state.used, [1, 1, 1, -INF])


def test_a_failure_is_used_up_but_the_unit_is_not_heard():
    state = _take(_take(track_init(1), 10.0, now=10.0), 10.02, now=10.02, shows=False, tells=False)
    assert (state.used, state.heard, state.seen) == (10.02, 10.0, 10.0)
    state = _take(state, 10.04, now=10.05, shows=False)
    assert (state.used, state.heard, state.seen) == (10.04, 10.04, 10.0)


@given(
    messages=st.lists(
        st.tuples(
            st.integers(0, 30) | st.sampled_from([NAN, INF, -INF]),
            st.sampled_from([(True, True), (False, True), (False, False)]),
        ),
        min_size=1,
        max_size=12,
    )
)
def test_a_track_holds_what_was_really_shown(messages):
    state, before = track_init(1), -INF
    for tick, (at, (shows, tells)) in enumerate(messages):
        now, stamp = 0.02 * tick, 0.02 * at
        state = _take(state, stamp, now, x=stamp, shows=shows, tells=tells)  # the point tells its stamp
        assert before <= state.used[0] <= now
        assert state.seen[0] <= state.heard[0] <= state.used[0]
        before = state.used[0]
        if state.seen[0] > -INF:
            assert state.point[0, 0] == state.seen[0]
            assert any(shown and 0.02 * a == state.seen[0] for a, (shown, _) in messages[: tick + 1])
        if state.heard[0] > -INF:
            assert any(told and 0.02 * a == state.heard[0] for a, (_, told) in messages[: tick + 1])


def test_an_unheard_unit_is_not_fresh():
    state = track_init(4)
    np.testing.assert_array_equal(newer(state.used, np.array([-INF, NAN, INF, 0.0]), 0.0), [False, False, False, True])


def test_points_of_units_leave_out_those_of_other_sources():
    seen = no_obstacles()
    seen.unit, seen.point = np.array([2, 0, 3, 9]), np.arange(12.0).reshape(4, 3)
    found = points_of_units(seen, 3)
    assert found[[2, 0]].tolist() == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
    assert np.isnan(found[1]).all()
