"""The range finder's driver: what 50 Hz takes, what a failure reads as. The cases are in `cases/`, unit-side."""

from pretouch.types import RangeStatus
from tests.firmware.harness import Run
from tests.firmware.together import run_all


def test_the_driver_of_the_range_finder(unit_python: Run) -> None:
    run_all(unit_python, "vl53l1x")


def test_each_status_it_gives_is_one_the_controller_knows(unit_python: Run) -> None:
    printed = unit_python({}, "import vl53l1x\nfor code in vl53l1x._STATUS: print(code)")
    assert {int(code) for code in printed} <= set(RangeStatus)


def test_a_reading_allocates_nothing(micropython: Run) -> None:
    script = """
from micropython import heap_lock, heap_unlock
from vl53l1x import VL53L1X

class Replay:
    data = bytes(range(9, 26))

    def readfrom_mem_into(self, address, register, buffer, *, addrsize=8):
        data = self.data
        i = 0
        while i < len(buffer):
            buffer[i] = data[i]
            i += 1

    def writeto_mem(self, address, register, data, *, addrsize=8):
        pass

sensor = VL53L1X(Replay())
heap_lock()
try:
    ready = sensor.ready()
    sensor.read()
finally:
    heap_unlock()
print(ready, sensor.mm)
"""
    assert micropython({}, script) == [f"True {22 << 8 | 23}"]
