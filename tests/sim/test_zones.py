"""A sensor with zones in a simulated room: all of them at once, and what they show beside the axis."""

from dataclasses import replace

import numpy as np
import pytest
from tests.perception.watcher import Watcher
from tests.sim.ranging import EXACT, ORIGIN, wall

from pretouch.perception.obstacles import silent_units, track_init
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import profile
from pretouch.sensing.sensor import VL53L5CX
from pretouch.sensing.skin import Skin
from pretouch.sim.scene import HandSpec
from pretouch.types import RangeStatus

EIGHT = VL53L5CX(zones=8)


def aside(angle: float, gap: float) -> HandSpec:
    """A fist whose surface is `gap` [m] before the sensor, so many degrees off its axis, towards +y of the base."""
    away = gap + 0.05
    x, y, z = ORIGIN + away * np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0])
    return HandSpec(start=(float(x), float(y), float(z)))


def test_all_zones_of_a_unit_are_measured_and_lost_at_once(rig):
    readings = rig(wall(0.5), units=2, sensor=VL53L5CX(), jitter_s=0.0, dropout=0.2).collect(1.0)
    stamps = [readings["stamp"][readings["unit"] == zone] for zone in range(32)]
    for unit in range(2):
        assert all(np.array_equal(stamps[16 * unit], stamps[k]) for k in range(16 * unit, 16 * unit + 16))
    assert not np.array_equal(stamps[0], stamps[16])
    assert 35 < len(stamps[0]) < 60  # 60 Hz less a fifth that is lost


def test_a_wall_is_read_along_each_beam(rig):
    readings = rig(wall(0.5), sensor=EIGHT, **EXACT).collect(0.2)
    last = {int(unit): d for unit, d in zip(readings["unit"], readings["distance"], strict=True)}
    z = EIGHT.looks()[:, 2, 2]  # cosine of each beam's tilt
    # the calibration is for a wall square to the beam: 21 degrees off it a zone of 6.3 degrees errs by less than 1 %
    assert [last[k] for k in range(64)] == pytest.approx((0.5 / z).tolist(), rel=0.01)


def test_what_is_beside_the_axis_is_seen_where_it_is(rig, panda_model):
    hand = aside(17.0, 0.25)  # a single cone of 27 degrees, 13.5 to each side, sees its edge at most
    for sensor in (VL53L5CX(), EIGHT):
        seen_by = rig(hand=hand, sensor=sensor, **EXACT)
        seen_by.collect(0.2)
        watcher = Watcher(panda_model, seen_by.skin, no_fixtures(), profile("pretouch").perception)
        seen = watcher.take(seen_by.finders.read(), seen_by.plant.time)
        off = np.linalg.norm(seen.point - hand.start, axis=1) - 0.05
        assert len(off) >= 1
        assert off.max() < 0.3 * 2 * np.tan(seen_by.skin.units[0].sensor.angle / 2)
        # the nearest of what is seen is no farther than it truly is, but for 1 cm
        truly = np.linalg.norm(seen.body_point - hand.start, axis=1) - 0.05
        assert truly.min() - 0.04 < seen.body_distance.min() < truly.min() + 0.01


def test_a_single_cone_does_not_see_it(rig):
    assert (rig(hand=aside(26.0, 0.25), **EXACT).collect(0.2)["status"] == RangeStatus.SIGNAL).all()


def test_a_silent_unit_is_named_once(panda_model, paper_skin):
    skin = Skin([replace(paper_skin.units[0], sensor=VL53L5CX())], panda_model)
    silent_after, status = profile("pretouch").perception.silent_after_s, np.full(len(skin), int(RangeStatus.NONE))
    assert silent_units(skin, track_init(len(skin)).report_stamp, status, 1.0, silent_after) == "hand_left"
