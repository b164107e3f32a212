import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.perception.obstacles import TrackState, is_informative, locate, measured, newer, track_init, update_tracks
from pretouch.sensing.sensor import PAPER_SENSOR, cones_of
from pretouch.types import RangeStatus

INF, NAN = np.inf, np.nan
SHOWN = [RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED]
NEAR = [RangeStatus.MIN_RANGE, RangeStatus.MIN_CLIPPED]
NO_TARGET = [RangeStatus.SIGNAL, RangeStatus.SIGMA, RangeStatus.OUT_OF_BOUNDS, RangeStatus.WRAPPED]


def _reading(distance, status) -> tuple[np.ndarray, np.ndarray]:
    return np.array([distance]), np.array([int(status)])


def track(
    state: TrackState, stamps: list[float], points: np.ndarray, shows: np.ndarray, tells: np.ndarray, now: float
) -> TrackState:
    """The state after readings of these stamps."""
    after, stamp = TrackState._make(part.copy() for part in state), np.array(stamps)
    flags = newer(state.reading_stamp, stamp, now), shows, tells
    update_tracks(after, stamp, points, flags)
    return after


def _take(state, stamp, now, x, shows, tells):
    """One reading of one unit that shows something at (x, 0, 0)."""
    return track(state, [stamp], np.array([[x, 0.0, 0.0]]), np.array([shows]), np.array([tells]), now)


# Eq. 1


def test_an_obstacle_lies_along_the_beam():
    position = np.array([[0.1, 0.2, 0.3], [1.0, 0.0, 0.0]])
    tilted = [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]  # beam along (0.6, 0, 0.8)
    level = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]  # beam along x
    found = locate(position, np.array([tilted, level]), np.array([0.5, 0.25]))
    np.testing.assert_allclose(found, [[0.4, 0.2, 0.7], [1.25, 0.0, 0.0]], atol=1e-15)


# What a reading stands for

ONE = cones_of([PAPER_SENSOR])


@pytest.mark.parametrize("status", [s for s in [*RangeStatus, -1, 8, 300] if s not in SHOWN])
def test_only_good_and_too_near_readings_show_a_target(status):
    for distance in (0.5, 0.0, NAN, INF, -1.0):
        (shown,) = measured(*_reading(distance, status), ONE)
        np.testing.assert_equal(shown, 0.04 if status in NEAR else NAN)


@pytest.mark.parametrize("status", SHOWN)
@pytest.mark.parametrize(
    ("distance", "shown"),
    [(0.5, 0.5), (4.0, 4.0), (0.04, 0.04), (0.01, 0.04), (0.0, 0.04)]
    + [(impossible, NAN) for impossible in (-0.01, 4.1, 65.535, 1e300, INF, NAN)],
)
def test_a_good_reading_is_taken_within_what_the_sensor_can_measure(distance, shown, status):
    np.testing.assert_equal(measured(*_reading(distance, status), ONE), [shown])


# Which readings tell anything


@pytest.mark.parametrize("status", [*RangeStatus, -1, 8, 300])
def test_a_target_tells_and_so_does_its_absence_but_no_failure(status):
    for distance, known in ((0.5, True), (100.0, True), (-1.0, False), (NAN, False), (INF, False)):
        readings = _reading(distance, status)
        (tells,) = is_informative(*readings, measured(*readings, ONE), ONE)
        assert tells == (status in NEAR + NO_TARGET or (known and status in SHOWN))


# How long a point is kept

HIT, MISS, FAILURE = (True, True), (False, True), (False, False)
"""Whether a reading shows something, and whether it tells anything."""


@pytest.mark.parametrize(
    ("readings", "seen", "used", "heard"),
    [
        # a point outlives a missed reading: it was seen when it was shown
        ([(10.0, 10.0, HIT), (10.02, 10.02, MISS)], 10.0, 10.02, 10.02),
        # what is not newer changes nothing
        *(([(10.0, 10.0, HIT), (late, 10.01, HIT)], 10.0, 10.0, 10.0) for late in (10.0, 9.99, -INF, NAN)),
        ([(10.02, 10.02, HIT), (10.0, 10.03, MISS)], 10.02, 10.02, 10.02),
        # a reading from the future waits until its time
        ([(10.02, 10.0, HIT)], -INF, -INF, -INF),
        ([(10.02, 10.0, HIT), (10.02, 10.02, HIT)], 10.02, 10.02, 10.02),
        # a failure is used up, but is no report
        ([(10.0, 10.0, HIT), (10.02, 10.02, FAILURE)], 10.0, 10.02, 10.0),
        ([(10.0, 10.0, HIT), (10.02, 10.02, FAILURE), (10.04, 10.05, MISS)], 10.0, 10.04, 10.04),
    ],
)
def test_what_is_remembered_of_a_unit_after_readings(readings, seen, used, heard):
    state = track_init(1)
    for stamp, now, (shows, tells) in readings:
        state = _take(state, stamp, now, x=stamp, shows=shows, tells=tells)  # the point tells its stamp
    stamps = state.point_stamp, state.reading_stamp, state.report_stamp
    assert stamps == (seen, used, heard)
    np.testing.assert_array_equal(state.point, [[NAN] * 3 if seen == -INF else [seen, 0.0, 0.0]])


def test_units_are_kept_apart():
    points = np.array([[1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0], [4.0, 0, 0]])
    shows, tells = np.array([True, False, False, True]), np.array([True, True, False, True])
    state = track(track_init(4), [1.0, 1.0, 1.0, -INF], points, shows, tells, 1.0)
    np.testing.assert_array_equal(state.point, [[1, 0, 0], [NAN] * 3, [NAN] * 3, [NAN] * 3])
    np.testing.assert_array_equal(state.point_stamp, [1, -INF, -INF, -INF])
    np.testing.assert_array_equal(state.report_stamp, [1, 1, -INF, -INF])
    np.testing.assert_array_equal(state.reading_stamp, [1, 1, 1, -INF])


@given(
    messages=st.lists(
        st.tuples(st.integers(0, 30) | st.sampled_from([NAN, INF, -INF]), st.sampled_from([HIT, MISS, FAILURE])),
        min_size=1,
        max_size=12,
    )
)
def test_a_track_holds_what_was_really_shown(messages):
    state, before = track_init(1), -INF
    for tick, (at, (shows, tells)) in enumerate(messages):
        now, stamp = 0.02 * tick, 0.02 * at
        state = _take(state, stamp, now, x=stamp, shows=shows, tells=tells)  # the point tells its stamp
        assert before <= state.reading_stamp[0] <= now
        assert state.point_stamp[0] <= state.report_stamp[0] <= state.reading_stamp[0]
        before = state.reading_stamp[0]
        if state.point_stamp[0] > -INF:
            assert state.point[0, 0] == state.point_stamp[0]
            assert any(shown and 0.02 * a == state.point_stamp[0] for a, (shown, _) in messages[: tick + 1])
        if state.report_stamp[0] > -INF:
            assert any(told and 0.02 * a == state.report_stamp[0] for a, (_, told) in messages[: tick + 1])
