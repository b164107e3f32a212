"""Realistic range finders against what was published of real ones: the numbers are theirs, or follow from theirs."""

import numpy as np
import pytest
from tests.sim.ranging import FORWARD, ORIGIN, Rig, wall

from pretouch.sensing.sensor import PAPER_SENSOR, VL53L5CX, Capacitive, Sensor
from pretouch.sim.scene import HandSpec
from pretouch.types import RangeStatus

EIGHT = VL53L5CX(zones=8)
CENTRAL, MIDDLE = (27, 28, 35, 36), [8 * row + column for row in range(2, 6) for column in range(2, 6)]


def frames(rig: Rig, duration: float, zones: int = 64) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps (F, U) of U units, distances of valid readings and statuses (F, U, zones); NaN where there are none."""
    rows, last = [], rig.finders.read().stamp[::zones]
    for _ in range(round(duration / 0.01)):
        rig.plant.advance(0.01)
        now = rig.finders.read()
        fresh, last = now.stamp[::zones] > last, now.stamp[::zones]
        values = np.stack([now.stamp, now.distance, now.status]).reshape(3, -1, zones)
        rows.append(np.where(fresh[:, None], values, np.nan))
    stamp, distance, status = np.array(rows).swapaxes(0, 1)
    return stamp[..., 0], np.where(status == RangeStatus.OK, distance, np.nan), status


# flights towards a wood panel, four central zones: distance, from and to [m], readings, share valid
VALID = [(0.22, 0.35, 104, 0.654), (0.35, 0.50, 452, 0.571), (0.50, 0.70, 412, 0.760), (0.70, 1.00, 336, 0.973)]
VALID += [(1.00, 1.30, 336, 0.991), (1.60, 2.00, 300, 1.000), (2.00, 2.50, 384, 0.958), (2.50, 3.00, 380, 0.868)]
VALID += [(3.00, 3.60, 672, 0.533)]


@pytest.mark.parametrize(("near", "far", "readings", "valid"), VALID)
def test_central_zones_are_valid_as_often_as_in_flights_and_others_see_nothing(rig, near, far, readings, valid):
    _, _, status = frames(rig(wall((near + far) / 2), units=12, sensor=EIGHT, realistic=True), 5.0)
    seen = status[..., CENTRAL][~np.isnan(status[..., CENTRAL])]
    few = readings / 4  # frames: zones of one are not independent
    error = np.sqrt(max(valid * (1 - valid), 1 / few) / few)
    assert np.mean(seen == RangeStatus.OK) == pytest.approx(valid, abs=3 * error)
    assert set(seen) <= {RangeStatus.OK, RangeStatus.SIGNAL}


# the same flights: distance [m], frames, those with at most 2 of 16 central zones valid, gaps
@pytest.mark.parametrize(
    ("distance", "count", "blind", "gaps"), [(0.28, 51, 6, 5), (0.42, 216, 41, 12), (0.85, 213, 0, 0)]
)
def test_whole_frames_see_nothing_for_a_while_as_often_and_as_long_as_in_flights(rig, distance, count, blind, gaps):
    stamp, _, status = frames(rig(wall(distance), units=12, sensor=EIGHT, realistic=True), 12.0)
    valid, spans, shares, left = status == RangeStatus.OK, [], [], []
    for unit in range(12):
        new = ~np.isnan(stamp[:, unit])
        dark = valid[new, unit][:, MIDDLE].sum(axis=1) <= 2
        shares.append(dark.mean())
        left += valid[new, unit][dark].sum(axis=1).tolist()
        spans += np.diff(stamp[new, unit][~dark])[np.diff(np.flatnonzero(~dark)) > 1].tolist()
    # frames of a gap come together: the share is as uncertain as the number of gaps
    error = blind / count / np.sqrt(gaps) if gaps else 1 / count
    assert np.mean(shares) == pytest.approx(blind / count, abs=2.5 * error)
    if distance == 0.42:
        assert 3 < np.mean(left) < 16  # zones that go on, of 64
        assert np.median(spans) == pytest.approx(0.27, abs=2 / 15)  # two frames
        assert np.percentile(spans, 90) == pytest.approx(0.65, abs=0.2)
        assert max(spans) < 0.86 + 2 / 15


def towards(rig, sensor: Sensor, gap: float, speed: float) -> Rig:
    """Units before a ball of 0.3 m that comes nearer."""
    x, y, z = ORIGIN.tolist()
    bench = rig(hand=HandSpec(0.3, start=(x + gap + 0.3, y, z)), units=24, sensor=sensor, realistic=True)
    bench.plant.mj_data.qvel[-3] = -speed
    return bench


# the same flights: how far each zone trails the panel [ms], rows 2 to 5 and columns 0 to 5
LAGS = np.array(
    [[73, 90, 70, 91, 76, 85], [110, 58, 109, 59, 110, 59], [80, 96, 77, 96, 77, 94], [122, 64, 114, 60, 113, 61]]
)


# the firmware's stamp is so long before the reading [s]; what 4 x 4 zones trail by is assumed to be 59 ms
@pytest.mark.parametrize(
    ("sensor", "stamped_s", "middle"), [(EIGHT, 0.059, CENTRAL), (VL53L5CX(), 0.034, (5, 6, 9, 10))]
)
def test_zones_of_a_frame_trail_its_stamp_in_a_pattern_of_two_by_two(rig, sensor, stamped_s, middle):
    n = sensor.zones
    stamp, still, _ = frames(towards(rig, sensor, 0.5, 0.0), 0.5, n * n)
    bias = {zone: np.nanmean(still[..., zone]) - 0.5 for zone in middle}
    stamp, distance, _ = frames(towards(rig, sensor, 0.7, 0.8), 0.5, n * n)
    for zone in middle:
        late = np.nanmean(distance[..., zone] - bias[zone] - (0.7 - 0.8 * stamp)) / 0.8
        row, column = divmod(zone, n)
        published = 1e-3 * LAGS[row % 2 :: 2, column % 2 :: 2].mean() if n == 8 else 0.059
        assert late + stamped_s == pytest.approx(published, abs=0.006)


@pytest.mark.parametrize(("sensor", "ready_s"), [(EIGHT, 0.059), (VL53L5CX(), 0.034), (PAPER_SENSOR, 0.0075)])
def test_a_reading_is_ready_when_its_type_says_and_its_frame_has_one_stamp(rig, sensor, ready_s):
    readings = rig(wall(1.1), sensor=sensor, units=4, realistic=True, jitter_s=0.0).collect(0.6)
    late = readings["seen"] - readings["stamp"]
    assert late == pytest.approx(ready_s + 0.0085, abs=0.0011)  # 8 ms of radio, seen at a millisecond
    units = readings["unit"] // sensor.zones**2
    frames_sent = len(set(zip(units, readings["stamp"], strict=True)))
    assert frames_sent * sensor.zones**2 == len(readings["stamp"]) > 4 * 6


@pytest.mark.parametrize(("distance", "error"), [(0.0, 0.0236), (0.05, 0.0148), (0.1, 0.0034), (0.15, -0.0112)])
def test_near_a_surface_zones_read_too_far(rig, distance, error):
    ahead = FORWARD.copy()
    ahead[0, 3] += 0.1  # so that the wall does not push the hand
    bench = rig(wall(0.1 + distance), pose=ahead, units=24, sensor=EIGHT, realistic=True)
    _, seen, _ = frames(bench, 0.4)
    assert np.nanmean(seen[..., CENTRAL]) - distance == pytest.approx(error, abs=0.004)  # 1.4 to 3 mm between zones


# standard deviation [mm]: flights with the motion taken out; a static room; VL53L1X in 100 ms, times the root of five
NOISE = [(EIGHT, 0.42, 3.8), (EIGHT, 0.6, 4.3), (EIGHT, 0.85, 4.1), (EIGHT, 2.2, 8.5), (PAPER_SENSOR, 0.415, 2.9)]
NOISE += [(PAPER_SENSOR, 0.71, 2.9), (PAPER_SENSOR, 0.95, 3.2), (PAPER_SENSOR, 1.22, 3.1)]


@pytest.mark.parametrize(("sensor", "distance", "sd_mm"), NOISE)
def test_noise_is_as_measured(rig, sensor, distance, sd_mm):
    n = sensor.zones**2
    _, seen, _ = frames(rig(wall(distance), units=8, sensor=sensor, realistic=True), 3.0, n)
    spread = np.nanstd(seen[..., CENTRAL if n > 1 else (0,)], axis=0)
    assert 1e3 * spread.mean() == pytest.approx(sd_mm, rel=0.3)  # the root of five is an estimate


def test_cones_have_the_manuals_constant_error_and_tell_wrong_numbers_below_4_cm_without_an_error(rig):
    _, seen, _ = frames(rig(wall(0.415), units=40, realistic=True, dropout=0.0), 0.6, 1)
    error = np.nanmean(seen[..., 0], axis=0) - 0.415
    assert np.abs(error).max() < 0.022
    assert (error < -0.012).any(), "as one of -18 mm was"
    near = rig(wall(0.02), units=4, realistic=True).collect(1.0)
    assert set(near["status"]) == {RangeStatus.OK}
    assert np.ptp(near["distance"]) > 0.02


@pytest.mark.parametrize("sensor", [PAPER_SENSOR, EIGHT])
def test_before_black_lacquer_a_reading_is_wrong_and_says_that_it_is_right(rig, sensor):
    black = rig(wall(0.3), sensor=sensor, realistic=True, reflectance=0.02).collect(0.3)
    assert set(black["status"]) == {RangeStatus.OK}
    assert 0.022 <= black["distance"].min() <= black["distance"].max() <= 0.027  # the two that were reported


@pytest.mark.parametrize("sensor", [Sensor(field_of_view_deg=12.0), Capacitive()])
def test_a_type_that_nobody_recorded_errs_as_usual(rig, sensor):
    usual, realistic = (rig(wall(0.1), sensor=sensor, units=3, realistic=r).collect(0.5) for r in (False, True))
    assert all(np.array_equal(usual[name], realistic[name]) for name in usual)
