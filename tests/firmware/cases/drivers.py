"""What each driver does where its sensor or the bus fails, on fakes of them."""

import os
import struct
import sys

import fake_vl53l5cx
from fake_bus import driven, error_of
from fake_lsm6ds3 import FakeLsm6ds3
from fake_vl53l1x import FakeVl53l1x
from fake_vl53l5cx import FakeVl53l5cx
from lsm6ds3 import LSM6DS3
from vl53l1x import VL53L1X
from vl53l5cx import VL53L5CX

os.chdir(sys.path[0])
with open("vl53l5cx.bin", "wb") as _file:
    _file.write(fake_vl53l5cx.FILE)
DRIVERS = {"VL53L1X": (VL53L1X, FakeVl53l1x), "VL53L5CX": (VL53L5CX, FakeVl53l5cx), "LSM6DS3": (LSM6DS3, FakeLsm6ds3)}
SHORT_SET_UP = ("VL53L1X", "LSM6DS3")


def _made(name, **faults):
    return driven(*DRIVERS[name], **faults)


def _take(sensor):
    """Take what there is, ready or not; return its number, None of nothing."""
    if not isinstance(sensor, LSM6DS3):
        sensor.read()
        return sensor.stream
    buffer = memoryview(bytearray(384))
    if not sensor.drain(buffer, 32):
        return None
    number, *rest = struct.unpack("<6h", buffer[:12])
    assert rest == [2, -3, 4, -5, 8192]
    return number


def _works(clock, sensor):
    """Whether a sensor begins, and measures from its first measurement on."""
    sensor.begin()
    clock.advance(20_000)
    return _take(sensor) == 0


def another_chip_and_none_are_errors():
    others = {"VL53L1X": {"model": 0xEEAA}, "VL53L5CX": {"revision": 0x0C}, "LSM6DS3": {"identity": 0x6C}}
    for name in DRIVERS:
        _, _, device, sensor = _made(name, **others[name])
        assert error_of(sensor.begin) == 19, name
        device.power_off()
        assert error_of(sensor.begin) == 19, name


def a_failed_transfer_and_a_bus_held_down_are_told_and_do_no_harm():
    for name in DRIVERS:
        clock, bus, _, sensor = _made(name)
        bus.stuck = True
        assert error_of(sensor.begin) == 110, name
        bus.stuck = False
        sensor.begin()
        clock.advance(20_000)
        before = getattr(sensor, "status", None)
        bus.fail_next(1)
        assert error_of(_take, sensor) == 19, name
        bus.stuck = True
        assert error_of(_take, sensor) == 110, name
        bus.stuck = False
        assert getattr(sensor, "status", None) == before
        assert _take(sensor) == 0, name


def a_failure_anywhere_in_its_set_up_is_told_and_the_next_try_works():
    for name in SHORT_SET_UP:
        _, bus, _, sensor = _made(name)
        sensor.begin()
        survived, errors = [], set()
        for at in range(1, bus.transfers + 1):
            clock, bus, _, sensor = _made(name)
            bus.fail_at = at
            try:
                sensor.begin()
                survived.append(at)
            except OSError as error:
                errors.add(error.args[0])
            assert _works(clock, sensor), (name, at)
        assert errors == {19}
        assert survived == ([3, 4] if name == "VL53L1X" else []), survived  # whether it has booted is asked again


def a_register_that_does_not_keep_its_value_is_an_error():
    for name, registers in (("VL53L1X", (0x6F,)), ("LSM6DS3", (0x08, 0x0A, 0x10, 0x11))):
        for register in registers:
            _, _, device, sensor = _made(name)
            write = device._write_one
            device._write_one = lambda at, value, lost=register, write=write: None if at == lost else write(at, value)
            assert error_of(sensor.begin) == 5, (name, register)


def lost_power_is_an_error_and_never_a_measurement():
    for name in DRIVERS:
        clock, _, device, sensor = _made(name)
        assert _works(clock, sensor)
        device.power_off()
        assert error_of(_take, sensor) == 19, name
        device.power_on()
        clock.advance(100_000)
        assert error_of(_take, sensor) in (5, 19), name
        assert _works(clock, sensor), name


def a_sensor_found_running_is_set_up_anew():
    for name in DRIVERS:
        clock, bus, _, sensor = _made(name)
        sensor.begin()
        clock.advance(123_456)
        assert _works(clock, DRIVERS[name][0](bus, time=clock)), name


def a_data_line_that_is_held_never_reads_as_a_measurement():
    for name in DRIVERS:
        for level in (0xFF, 0x00):
            clock, bus, _, sensor = _made(name)
            sensor.begin()
            clock.advance(20_000)
            before = getattr(sensor, "status", None)
            bus.held = lambda level=level: level
            assert error_of(_take, sensor) == 5, (name, level)
            assert error_of(sensor.begin) in (5, 19, 110), (name, level)
            assert getattr(sensor, "status", None) == before
            bus.held = None
            assert _works(clock, sensor), (name, level)
