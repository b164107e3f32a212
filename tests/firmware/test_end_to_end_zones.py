"""The firmware on a fake sensor with zones, and the receiver, talk by UDP."""

from pathlib import Path

import numpy as np
import pytest

from pretouch.hardware.keys import Keys, UnitKey
from pretouch.hardware.receiver import SkinReceiver
from pretouch.sensing.network import NetworkUnits
from pretouch.sensing.sensor import VL53L5CX
from pretouch.types import RangeStatus
from tests.firmware.test_end_to_end import KEY, NUMBER, SCRIPT, running_unit, served

KEYS = Keys([UnitKey("one", NUMBER, KEY)])


def zoned(side: int) -> str:
    """The script with another range finder: its zone k sees a target k mm beyond 500 mm, but for zone 3."""
    light = "16 * (20 + us // 20_000 % 10)"
    targets = f"[(5, 1, 4 * (500 + k), 384, {light}) if k != 3 else (255, 0, 0, 0, {light}) for k in range({side**2})]"
    made = f"""
import fake_vl53l5cx
from vl53l5cx import VL53L5CX
with open("vl53l5cx.bin", "wb") as file: file.write(fake_vl53l5cx.FILE)
device = fake_vl53l5cx.FakeVl53l5cx(now)
device.target = lambda us: {targets}
i2c.add(device)
"""
    script = SCRIPT.replace("i2c.add(range_finder)\n", made)
    return script.replace("RangeFinder(VL53L1X(i2c),", f"RangeFinder(VL53L5CX(i2c, {side}),")


@pytest.mark.parametrize(("side", "least"), [(4, 40), (8, 12)])
def test_the_firmware_brings_each_zone_to_the_receiver(side: int, least: int, tmp_path: Path) -> None:
    units = NetworkUnits(("one",), (side,))
    with SkinReceiver(units, KEYS) as receiver, running_unit(receiver.address[1], tmp_path, zoned(side)):
        served(receiver, 150)
        readings, traffic, samples = receiver.readings(), receiver.units[0], receiver.take_samples()
    assert (traffic.state, traffic.lost, traffic.misfits, traffic.zones_told) == ("live", 0, 0, side)
    assert not any(receiver.rejected.values())
    new = [one.sample for one in samples[-75:] if one.sample.flags & 1]
    seconds = 1e-6 * (new[-1].time_us - new[0].time_us)
    assert (len(new) - 1) / seconds > least
    assert [k for k, status in enumerate(readings.status) if status != RangeStatus.OK] == [3]
    # told square to the window, the distance along a beam is that by the cosine of the beam in the skin
    along = (0.5 + 0.001 * np.arange(side**2)) / VL53L5CX(zones=side).looks()[:, 2, 2]
    seen = np.arange(side**2) != 3
    assert readings.distance[seen] == pytest.approx(along[seen], abs=1.6e-3)


def test_a_skin_without_its_zones_gets_no_reading_and_counts_them(tmp_path: Path) -> None:
    with SkinReceiver(["one"], KEYS) as receiver, running_unit(receiver.address[1], tmp_path, zoned(4)):
        served(receiver, 100)
        readings, traffic = receiver.readings(), receiver.units[0]
    assert readings.status.tolist() == [RangeStatus.NONE]
    assert traffic.zones_told == 4
    assert traffic.misfits > 20
