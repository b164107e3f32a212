"""Touch from a simulated sensor over units, sockets and receiver to a control step."""

from dataclasses import replace

import numpy as np
import pytest
from tests.wire_skin import WireSkin

from pretouch.control.path import Circle
from pretouch.control.posture import brought_to
from pretouch.hardware.wire import (
    NO_FORCE,
    SAMPLE_LEAST,
    Flag,
    Mac,
    Sample,
    TouchPart,
    decode_sample,
    touch_part,
)
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import TouchPatch
from pretouch.serving.fleet import FleetParams
from pretouch.sim.plant import Plant, PointForce
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import SceneSpec

SESSION = Mac(bytes(range(32)))
PLAIN = Sample(*[7, 0, 1, 5_000_000], *[0] * 13, 2, *[0] * 4, imu=bytes(24))
PART = TouchPart(1, 0, 400, 2500, 1200)


@pytest.mark.parametrize("part", [PART, TouchPart(0, 1, 2, NO_FORCE, 0)])
def test_a_touch_reading_goes_behind_the_imu_samples(part):
    whole = replace(PLAIN, flags=int(Flag.TOUCH), touch=part.encode())
    datagram = whole.encode(SESSION)
    assert len(datagram) == SAMPLE_LEAST + 24 + 12
    assert datagram[62 + 24 : -16] == part.encode()
    back = decode_sample(datagram, SESSION)
    assert back == whole
    assert back is not None
    assert touch_part(back) == part


def test_a_sample_without_touch_is_as_before_and_has_no_part():
    datagram = PLAIN.encode(SESSION)
    assert len(datagram) == SAMPLE_LEAST + 24
    back = decode_sample(datagram, SESSION)
    assert back == PLAIN
    assert back is not None
    assert touch_part(back) is None


@pytest.mark.parametrize(
    "wrong",
    [
        replace(PLAIN, flags=int(Flag.TOUCH)),  # the flag without the bytes
        replace(PLAIN, touch=PART.encode()),  # the bytes without the flag
        replace(PLAIN, flags=int(Flag.TOUCH), touch=PART.encode() + bytes(12)),
        replace(PLAIN, flags=int(Flag.TOUCH), touch=PART.encode(), imu_count=3),
    ],
)
def test_a_length_that_does_not_go_with_the_flag_is_refused(wrong):
    assert decode_sample(wrong.encode(SESSION), SESSION) is None


@pytest.fixture
def arm(panda_model) -> Plant:
    start = brought_to(panda_model, Circle().point(0.0))
    return Plant(panda_model, SceneSpec(), PlantParams(), start, 0)


def feeling(skin: Skin, model, *units: int) -> Skin:
    return Skin([replace(u, touch=TouchPatch()) if k in units else u for k, u in enumerate(skin.units)], model)


class Presser:
    """Presses on the first unit with 3 N from 1.5 s to 2.5 s."""

    def __init__(self, plant: Plant, skin: Skin) -> None:
        self.plant, self.link, self.T = plant, int(skin.link[0]), skin.T_link_sensor[0]

    def __call__(self, time: float) -> list[PointForce]:
        if not 1.5 <= time < 2.5:
            return []
        R = self.plant.link_rotation[self.link]
        return [
            PointForce(self.link, self.plant.link_position[self.link] + R @ self.T[:3, 3], -3.0 * R @ self.T[:3, 2])
        ]


def test_a_touch_comes_over_the_wire_with_its_force_and_never_fresher_than_it_is(arm, panda_model, paper_skin):
    skin = feeling(paper_skin, panda_model, 0, 2)
    with WireSkin(arm, skin, RangeFinderParams(), FleetParams(), 0, laid=Presser(arm, skin)) as wire:
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
        taken = wire.receiver.take_samples()
        assert {received.unit for received in taken if received.sample.touch} == {0, 2}
        assert sum(wire.receiver.rejected.values()) == 0


def test_a_skin_without_touch_sensors_sends_the_samples_it_always_did(arm, paper_skin):
    with WireSkin(arm, paper_skin, RangeFinderParams(), FleetParams(), 0) as wire:
        arm.advance(2.0)
        assert wire.touch() is None
        samples = [received.sample for received in wire.receiver.take_samples()]
    assert samples
    assert not any(sample.flags & Flag.TOUCH or sample.touch for sample in samples)
