"""The driver of the sensor with zones on a fake one."""

import os
import struct
import sys

import fake_vl53l5cx
from fake_bus import driven, error_of
from fake_receiver import steps
from fake_vl53l5cx import FakeVl53l5cx
from vl53l5cx import VL53L5CX

os.chdir(sys.path[0])


def _made(side=4, feed=None):
    _file(fake_vl53l5cx.FILE)
    return driven(lambda bus, time: VL53L5CX(bus, side, feed=feed, time=time), FakeVl53l5cx)


def _begun(side=4):
    clock, _, device, sensor = _made(side)
    sensor.begin()
    return clock, device, sensor


def _file(content):
    with open("vl53l5cx.bin", "wb") as file:
        file.write(content)


def _read(target):
    """Let 4 x 4 zones see this, and read them."""
    clock, device, sensor = _begun(4)
    device.target = lambda us: target
    clock.advance(17_000)
    sensor.read()
    return sensor


def _zones(sensor):
    return [struct.unpack_from("<HHB", sensor.zones, 2 + 5 * k) for k in range(sensor.zones[0] ** 2)]


def it_ranges_at_sixty_and_at_fifteen_hertz():
    for side, rate in ((4, 60), (8, 15)):
        clock, device, sensor = _begun(side)
        assert device.side == side
        count, end = 0, clock.now_us + 1_000_000
        while clock.now_us < end:
            if sensor.ready():
                sensor.read()
                assert not sensor.ready()
                count += 1
            clock.advance(1000)
        assert rate - 1 <= count <= rate, count
        assert sensor.zones[:2] == bytes([side, 0])


def what_it_is_set_to_is_as_sts_driver_has_it():
    _, device, _ = _begun(4)
    told = [device.part(0xAD38, k) for k in (4, 6, 9)], [device.part(0x5450, k) for k in (0, 1, 4, 5)]
    assert told == ([64, 64, 4], [4, 4, 8, 8]), told
    assert (device.part(0xAD30, 1), device.part(0xAD30, 3), device.part(0xE108, 0x25), device.part(0xE108, 0x26)) == (
        1, 3, 1, 1,
    )  # fmt: skip
    assert device.sends[0xD964] == bytes(4)
    _, device, _ = _begun(8)
    assert device.sends[0x2E18] == fake_vl53l5cx.NVM[8:488] + b"\x00\x00\x00\x0f\x03\x01\x01\xe4"
    assert device.sends[0x2CF8] == fake_vl53l5cx.CROSSTALK


def grids_of_4_x_4_are_means():
    _, device, _ = _begun(4)
    sent, nvm = device.sends[0x2E18], fake_vl53l5cx.NVM
    words = struct.unpack(">64I", nvm[0x3C : 0x3C + 256])
    means = struct.unpack(">16I", sent[0x34 : 0x34 + 64])
    assert means[5] == (words[18] + words[19] + words[26] + words[27]) // 4
    assert sent[0x34 + 64 : 0x34 + 256] == bytes(192)
    assert sent[8:16] == b"\x0f\x04\x04\x00\x08\x10\x10\x07"
    assert device.sends[0x2CF8][0x134:0x138] == b"\xa0\xfc\x01\x00"


def a_reading_has_each_zones_own_distance_along_its_beam():
    sensor = _read([(5, 1, 4 * 1000 + k, 128 * 3, 16 * 20) for k in range(16)])
    # beams of 4 x 4 zones lie at 5.625 and 16.875 degrees: 1 / cos is 1.0097, 1.0497 and 1.0882 of two of them
    mm = [zone[0] for zone in _zones(sensor)]
    assert abs(mm[5] - 1.0097 * 1001.25) <= 1, mm
    assert abs(mm[1] - 1.0497 * 1000.25) <= 1, mm
    assert abs(mm[0] - 1.0882 * 1000) <= 1.5, mm
    assert abs(mm[15] - 1.0882 * 1003.75) <= 1.5, mm
    assert {zone[1:] for zone in _zones(sensor)} == {(12, 0)}
    assert (sensor.status, sensor.mm, sensor.sigma, sensor.ambient) == (0, min(mm), 12, 20)


def every_status_is_translated_and_no_target_is_nothing_near():
    expected = {0: 255, 1: 2, 2: 4, 3: 1, 4: 14, 5: 0, 6: 6, 7: 14, 8: 2, 9: 11, 10: 0, 11: 14, 12: 14, 13: 14, 255: 2}
    clock, device, sensor = _begun(4)
    for told in tuple(range(16)) + (200, 255):  # noqa: RUF005 MicroPython unpacks no star here
        device.target = lambda us, told=told: [(told, 1, 400, 128, 0)] * 15 + [(5, 0, 400, 128, 0)]
        clock.advance(17_000)
        sensor.read()
        codes = [zone[2] for zone in _zones(sensor)]
        assert codes == [expected.get(told, 14)] * 15 + [2], (told, codes)


def the_nearest_target_is_told_and_not_a_nearer_doubt():
    sensor = _read([(4, 1, 40, 128, 0), (9, 1, 8000, 256, 0), (5, 1, 4000, 128, 16)] + [(255, 0, 0, 0, 0)] * 13)
    assert (sensor.status, sensor.mm, sensor.sigma, sensor.ambient) == (0, _zones(sensor)[2][0], 4, 1)


def a_negative_distance_is_none():
    assert [zone[0] for zone in _zones(_read([(5, 1, -8, 128, 0)] * 16))] == [0] * 16


def a_torn_frame_is_an_error_and_no_reading():
    clock, device, sensor = _begun(4)
    clock.advance(17_000)
    device.corrupt = True
    before = bytes(sensor.zones)
    assert error_of(sensor.read) == 5
    assert bytes(sensor.zones) == before
    device.corrupt = False
    assert sensor.ready()
    sensor.read()


def a_program_that_is_missing_or_not_whole_is_named():
    _, _, _, sensor = _made()
    for content in (b"", fake_vl53l5cx.FILE[:-1], b"XXXX" + fake_vl53l5cx.FILE[4:]):
        _file(content)
        assert error_of(sensor.begin) == 2
    os.remove("vl53l5cx.bin")
    assert error_of(sensor.begin) == 2
    _file(fake_vl53l5cx.FILE[:100] + b"\xff" + fake_vl53l5cx.FILE[101:])
    assert error_of(sensor.begin) == 110, "it does not run"


def it_recalibrates_and_goes_on():
    clock, device, sensor = _begun()
    before = clock.now_us
    sensor.recalibrate()
    assert clock.now_us - before < 100_000
    clock.advance(17_000)
    assert device.ranging
    assert sensor.ready()


def the_watchdog_is_fed_all_along():
    fed = []
    clock, _, _, sensor = _made(8, lambda: fed.append(clock.now_us))
    sensor.begin()
    assert max(steps(fed)) < 200_000, max(steps(fed))


def other_counts_of_zones_are_refused():
    assert "zones along a side" in error_of(lambda: VL53L5CX(None, 5), kind=ValueError)
