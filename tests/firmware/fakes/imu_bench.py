"""What tests of the IMU begin with: one on a bus, and what it gives. Runs in both interpreters."""

import struct

from fake_bus import Bus, Clock
from fake_lsm6ds3 import FakeLsm6ds3
from lsm6ds3 import LSM6DS3, SET_SIZE

MOST = 32


def made(start_us=0, **faults):
    clock = Clock(start_us)
    bus = Bus(clock)
    device = FakeLsm6ds3(clock, **faults)
    bus.add(device)
    clock.advance(10_000)
    sensor = LSM6DS3(bus, sleep_ms=clock.sleep_ms, ticks_us=clock.ticks_us, ticks_diff=clock.ticks_diff)
    return clock, bus, device, sensor


def drained(sensor, most=MOST):
    buffer = memoryview(bytearray(MOST * SET_SIZE))
    count = sensor.drain(buffer, most)
    return [struct.unpack("<6h", buffer[SET_SIZE * i : SET_SIZE * (i + 1)]) for i in range(count)]
