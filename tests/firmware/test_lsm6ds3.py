"""The IMU's driver: what its FIFO gives, and when it runs over. The cases are unit-side code (harness.py)."""

import numpy as np

from pretouch.hardware.wire import imu_values
from pretouch.sensing.imu_scale import ACCELERATION_LSB, ANGULAR_RATE_LSB, STANDARD_GRAVITY
from tests.firmware.harness import Run
from tests.firmware.together import run_all


def test_the_driver_of_the_imu(unit_python: Run) -> None:
    run_all(unit_python, "lsm6ds3")


def test_the_driver_of_an_imu_that_fails(unit_python: Run) -> None:
    run_all(unit_python, "lsm6ds3_faults")


def test_the_wire_reads_its_samples_and_its_scales(unit_python: Run) -> None:
    """The sensor at rest, z up, turning at 100 degrees a second about x; counts by the data sheet's sensitivities."""
    script = """
from fake_bus import Bus, Clock
from fake_lsm6ds3 import FakeLsm6ds3
from lsm6ds3 import LSM6DS3

SCALES = (2, 125, 16393, 22857), (4, 500, 8197, 5714), (8, 245, 4098, 11429), (16, 2000, 2049, 1429)
for g, dps, one_g, turn in SCALES:
    clock = Clock()
    bus = Bus(clock)
    device = FakeLsm6ds3(clock)
    device.sample = lambda k: (turn, 0, 0, 0, 0, one_g)
    bus.add(device)
    sensor = LSM6DS3(bus, sleep_ms=clock.sleep_ms, ticks_us=clock.ticks_us, ticks_diff=clock.ticks_diff)
    sensor.begin(416, g, dps)
    clock.advance(20_000)
    buffer = memoryview(bytearray(120))
    count = sensor.drain(buffer, 10)
    print(sensor.scale_code, bytes(buffer[: 12 * count]).hex())
"""
    for line in unit_python({}, script):
        code, data = line.split()
        acceleration, turn = imu_values(bytes.fromhex(data), int(code))
        assert len(turn) == 8
        np.testing.assert_allclose(acceleration, [[0, 0, STANDARD_GRAVITY]] * 8, atol=max(ACCELERATION_LSB.values()))
        np.testing.assert_allclose(turn, [[np.deg2rad(100), 0, 0]] * 8, atol=max(ANGULAR_RATE_LSB.values()))
