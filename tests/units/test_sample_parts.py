"""Zones and touch from simulated sensors over units, sockets and receiver to what a skin reads."""

from dataclasses import replace
from functools import partial
from struct import pack

import numpy as np
import pytest

from pretouch.control.path import Circle
from pretouch.robot.postures import brought_to
from pretouch.sensing.sensor import VL53L5CX
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import TouchPatch
from pretouch.sim.imu import ImuParams, Imus
from pretouch.sim.plant import Plant, PointForce
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import Box, SceneSpec
from pretouch.units.fleet import FleetParams
from pretouch.units.wire import (
    IMU_MOST,
    NO_FORCE,
    SAMPLE_LEAST,
    SAMPLE_MOST,
    Flag,
    Mac,
    Sample,
    TouchPart,
    decode_sample,
    sample_size,
    touch_part,
    zones_size,
)
from tests.units.fake_unit import imu_taken
from tests.wire_skin import WireSkin

SESSION = Mac(bytes(range(32)))
PLAIN = Sample(*[7, 1, 1, 5_000_000], *[0] * 13, 2, *[0] * 4, imu=bytes(24))
FOUR = b"\x02\x00" + b"".join(pack("<HHB", 100 * k + 1, 8 * k, k) for k in (1, 2, 3, 4))
"""2 x 2 zones: 101, 201, 301, 401 mm, standard deviations of 2, 4, 6, 8 mm, statuses 1 to 4."""

PART = TouchPart(1, 0, 400, 2500, 1200)


@pytest.mark.parametrize("part", [PART, TouchPart(0, 1, 2, NO_FORCE, 0)])
def test_a_touch_reading_goes_behind_the_imu_samples_and_a_sample_without_is_as_before(part):
    datagram = PLAIN.encode(SESSION)
    assert len(datagram) == SAMPLE_LEAST + 24
    back = decode_sample(datagram, SESSION)
    assert back == PLAIN
    assert touch_part(back) is None
    whole = replace(PLAIN, flags=int(Flag.TOUCH), touch=part.encode())
    datagram = whole.encode(SESSION)
    assert len(datagram) == SAMPLE_LEAST + 24 + 12
    assert datagram[62 + 24 : -16] == part.encode()
    back = decode_sample(datagram, SESSION)
    assert back == whole
    assert touch_part(back) == part


def test_zones_go_behind_the_imu_samples_and_touch():
    whole = replace(PLAIN, flags=1 | Flag.TOUCH | Flag.ZONES, touch=bytes(12), zones=FOUR)
    datagram = whole.encode(SESSION)
    assert datagram[6:8] == b"\x81\x01"
    assert datagram[62 + 24 + 12 : -16].hex() == "0200" + "6500080001" + "c900100002" + "2d01180003" + "9101200004"
    assert len(datagram) == SAMPLE_LEAST + 24 + 12 + 22 == sample_size(datagram)
    assert decode_sample(datagram, SESSION) == whole


def test_the_largest_sample_fits_a_frame_of_ethernet():
    zones = b"\x08\x00" + bytes(5 * 64)
    most = replace(
        PLAIN, flags=1 | Flag.TOUCH | Flag.ZONES, imu_count=IMU_MOST, imu=bytes(12 * 32), touch=bytes(12), zones=zones
    )
    assert len(most.encode(SESSION)) == SAMPLE_MOST == 796 < 1472
    assert zones_size(4) == 82


@pytest.mark.parametrize(
    "wrong",
    [
        replace(PLAIN, flags=1 | Flag.TOUCH),  # the flag without the bytes
        replace(PLAIN, touch=PART.encode()),  # the bytes without the flag
        replace(PLAIN, flags=1 | Flag.TOUCH, touch=PART.encode() + bytes(12)),
        replace(PLAIN, flags=1 | Flag.TOUCH, touch=PART.encode(), imu_count=3),
        replace(PLAIN, flags=1 | Flag.ZONES),
        replace(PLAIN, zones=FOUR),
        replace(PLAIN, flags=1 | Flag.ZONES, zones=FOUR[:-1]),
        replace(PLAIN, flags=1 | Flag.ZONES, zones=FOUR + b"\0"),
        replace(PLAIN, flags=1 | Flag.ZONES, zones=b"\x03" + FOUR[1:]),  # of other counts
        replace(PLAIN, flags=1 | Flag.ZONES, zones=b"\0\0"),
        replace(PLAIN, flags=1 | Flag.ZONES, zones=b"\x09\0" + bytes(5 * 81)),
        replace(PLAIN, flags=1 | Flag.ZONES, zones=FOUR, imu_count=1),
        replace(PLAIN, flags=1 | Flag.ZONES | Flag.TOUCH, zones=FOUR),
        replace(PLAIN, imu_count=IMU_MOST + 1, imu=bytes(12 * (IMU_MOST + 1))),
    ],
)
def test_a_length_that_does_not_go_with_the_flags_is_refused(wrong):
    assert decode_sample(wrong.encode(SESSION), SESSION) is None


def test_what_is_cut_off_or_garbled_before_its_tag_raises_nothing():
    body = replace(PLAIN, flags=1 | Flag.ZONES, zones=FOUR).encode(SESSION)[:-16]
    rng = np.random.default_rng(0)
    for cut in range(SAMPLE_LEAST - 16, len(body)):
        assert decode_sample(body[:cut] + SESSION.tag(body[:cut]), SESSION) is None
    for _ in range(2000):
        bad = bytearray(body)
        for place in rng.integers(6, len(bad), 3).tolist():
            bad[place] = int(rng.integers(256))
        back = decode_sample(bytes(bad) + SESSION.tag(bad), SESSION)
        assert back is None or len(back.zones) == (zones_size(back.zones[0]) if back.flags & Flag.ZONES else 0)


@pytest.fixture
def arm(panda_model) -> Plant:
    start = brought_to(panda_model, Circle().point(0.0))
    wall = Box("wall", (0.9, 0.0, 0.5), (0.05, 2.0, 2.0), 25_000.0)
    return Plant(panda_model, SceneSpec(boxes=(wall,)), PlantParams(), start, 0)


@pytest.fixture
def zoned(panda_model, paper_skin) -> Skin:
    """Three units: 4 x 4 zones, a single range, and 8 x 8 zones with a touch sensor."""
    a, b, c = paper_skin.units[:3]
    last = replace(c, sensor=VL53L5CX(zones=8), touch=TouchPatch())
    return Skin([replace(a, sensor=VL53L5CX()), b, last], panda_model)


def test_readings_of_zones_are_those_measured_to_the_millimetre(arm, zoned):
    with WireSkin(arm, zoned, RangeFinderParams(), FleetParams(), 0) as skin:
        rows = []
        RangeFinders(arm, zoned, RangeFinderParams(), 0, lambda s: rows.append((s.unit, s.time, s.distance, s.status)))
        told = []
        for _ in range(150):
            arm.advance(0.01)
            told.append(skin.read())
        touch = skin.touch()
        assert sum(skin.receiver.rejected.values()) == 0
        assert [(u.zones, u.zones_told, u.misfits) for u in skin.receiver.units] == [(4, 4, 0), (1, 1, 0), (8, 8, 0)]
    assert len(told[-1].stamp) == len(zoned) == 16 + 1 + 64
    seen = 0
    for k in range(len(zoned)):
        mine = np.array([row[1:] for row in rows if row[0] == k])
        for stamp, distance, status in {(r.stamp[k], r.distance[k], r.status[k]) for r in told}:
            if np.isfinite(stamp):
                at = np.searchsorted(mine[:, 0], stamp - 5e-6)
                assert mine[at, 0] - stamp < 0.006
                assert distance == pytest.approx(mine[at, 1], abs=0.51e-3)
                assert status == mine[at, 2]
                seen += 1
    assert seen > 16 * 50 + 40 + 64 * 12
    assert all(len(set(told[-1].stamp[a:b])) == 1 for a, b in ((0, 16), (17, 81)))
    assert touch is not None
    assert np.flatnonzero(touch.status == 0).tolist() == [17], "a unit's touch sensor is told at its first zone"


def test_a_unit_with_zones_has_one_imu_in_its_own_axes(arm, panda_model, zoned, paper_skin):
    whole = Skin(list(paper_skin.units[:3]), panda_model)
    with WireSkin(arm, zoned, RangeFinderParams(), FleetParams(imu=ImuParams()), 0) as skin:
        true = []
        Imus(arm, whole, ImuParams(), 0, lambda s: true.append((s.unit, s.counts.tolist())))
        sent = []
        Imus(arm, zoned, ImuParams(), 0, lambda s: sent.append((s.unit, s.counts.tolist())))
        arm.advance(0.5)
        batches = imu_taken(skin.receiver)
    assert {batch.unit for batch in batches} == {0, 1, 2}
    assert sent == [(int(zoned.first[unit]), counts) for unit, counts in true]


def pressed(plant: Plant, skin: Skin, time: float) -> list[PointForce]:
    """The first unit is pressed on with 3 N from 1.5 s to 2.5 s."""
    link, T = int(skin.link[0]), skin.T_link_sensor[0]
    R, at = plant.link_rotation[link], plant.link_position[link]
    return [PointForce(link, at + R @ T[:3, 3], -3.0 * R @ T[:3, 2])] if 1.5 <= time < 2.5 else []


def test_a_touch_comes_over_the_wire_with_its_force_and_never_fresher_than_it_is(arm, panda_model, paper_skin):
    units = [replace(u, touch=TouchPatch()) if k in (0, 2) else u for k, u in enumerate(paper_skin.units)]
    skin = Skin(units, panda_model)
    with WireSkin(arm, skin, RangeFinderParams(), FleetParams(), 0, laid=partial(pressed, arm, skin)) as wire:
        assert wire.touch() is None
        rows = []
        for _ in range(320):
            arm.advance(0.01)
            rows.append((arm.time, wire.touch()))
        last = [(time, told) for time, told in rows if time >= 1.0]
        assert all(told is not None for _, told in last)
        for time, told in last:
            assert told is not None
            assert told.status.tolist() == [0, 255, 0, 255, 255, 255, 255]
            assert 0.0 <= time - told.stamp[0] <= 0.07
        on = [(time, told.force[0]) for time, told in last if told is not None and told.contact[0]]
        # noise, radio and a sample each 10 ms or more: the touch is told within 40 ms, and so is its end
        assert 1.5 < on[0][0] <= 1.55
        assert 2.5 < on[-1][0] <= 2.56
        assert np.median([force for _, force in on]) == pytest.approx(3.0, rel=0.12)
        assert not any(told.contact[2] for _, told in last if told is not None)
        assert {received.unit for received in wire.receiver.take_samples() if received.sample.touch} == {0, 2}
        assert sum(wire.receiver.rejected.values()) == 0
