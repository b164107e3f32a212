"""The driver of the sensor with zones. The cases are in `cases/`, unit-side."""

from pretouch.types import RangeStatus
from tests.firmware.harness import Run
from tests.firmware.together import run_all


def test_the_driver_of_the_sensor_with_zones(unit_python: Run) -> None:
    run_all(unit_python, "vl53l5cx")


def test_each_status_it_gives_is_one_the_controller_knows(unit_python: Run) -> None:
    printed = unit_python({}, "import vl53l5cx\nfor code in vl53l5cx._STATUS_OF: print(code)")
    assert {int(code) for code in printed} | {2, 14} <= set(RangeStatus)


def test_a_reading_allocates_nothing(micropython: Run) -> None:
    script = """
import fake_vl53l5cx
from fake_bus import Bus, Clock
from micropython import heap_lock, heap_unlock
from vl53l5cx import VL53L5CX

class Replay:
    def __init__(self, data): self.data = data

    def readfrom_mem_into(self, address, register, buffer, *, addrsize=8):
        data = self.data
        i = 0
        while i < len(buffer):
            buffer[i] = data[i]
            i += 1

for side in (4, 8):
    with open("vl53l5cx.bin", "wb") as file: file.write(fake_vl53l5cx.FILE)
    clock = Clock()
    bus = Bus(clock)
    device = fake_vl53l5cx.FakeVl53l5cx(clock)
    bus.add(device)
    sensor = VL53L5CX(bus, side, sleep_ms=clock.sleep_ms)
    sensor.begin()
    clock.advance(100_000)
    sensor._i2c = Replay(bus.readfrom_mem(0x29, 0, len(sensor._frame), addrsize=16))
    heap_lock()
    try:
        ready = sensor.ready()
        sensor.read()
    finally:
        heap_unlock()
    print(ready, sensor.status, sensor.zones[0])
"""
    assert micropython({}, script) == ["True 0 4", "True 0 8"]
