"""The range finder VL53L5CX (ST; VL53L7CX likewise): 4 x 4 or 8 x 8 zones, by a program that it is given at each begin.

The program is ST's, not ours: `vl53l5cx.bin` on the unit's flash (docs/how-to/flashing.md). Facts from ST: user manual
UM2884, and registers, sequence and block headers of the driver STSW-IMG023 2.0. Errors are OSError: 2 no sound program,
19 no such device, 5 it refuses or lost its set-up, 110 it does not answer in time.
"""

import math
import struct
import time

from micropython import const
from vl53l5cx_processor import Processor

_CHUNK = const(1024)
_IO = const(5)
_ADDRESS = const(0x29)

# what a rectangle of zones is set by: in driver structures, byte and value
_DSS, _ZONES, _RATE, _MODE, _ORDER = const(0xAD38), const(0x5450), const(0x5458), const(0xAD30), const(0xAE64)
_SINGLE, _SIZE_TOLD = const(0xD964), const(0x5440)
_OUT_LIST, _OUT_SIZE, _OUT_ENABLE = const(0xD980), const(0xD968), const(0xD970)
_FASTEST_HZ = {4: 60, 8: 15}
_DELAY_US = {4: 34_000, 8: 59_000}  # as `timing` of the package's type VL53L5CX, which says where it is from

_AMBIENT, _TARGETS, _SIGMA, _DISTANCE, _TARGET_STATUS = (
    const(0x54D0), const(0xDB84), const(0xDEC4), const(0xDF44), const(0xE084),
)  # fmt: skip
# headers of all outputs: index, size * 16 + type (of elements of so many bytes, up to 12), whether it is wanted
_OUTPUTS = (
    (0x0000, 0x000D, True), (0x54B4, 0x00C0, True), (0x54C0, 0x0040, True), (_AMBIENT, 0x0104, True),
    (0x55D0, 0x0404, False), (_TARGETS, 0x0401, True), (0xDBC4, 0x0404, False), (_SIGMA, 0x0402, True),
    (_DISTANCE, 0x0402, True), (0xE044, 0x0401, False), (_TARGET_STATUS, 0x0401, True), (0xD858, 0x08C0, False),
)  # fmt: skip
_ENDS = const(24)
"""Of a frame, besides its blocks: 12 bytes before the first and 12 behind the last, both with the frame's number."""
_BLOCKS_AT = const(16)

# the device's status of a target to the codes of UM2356; 255 no target; what leaves in doubt what is there is 14
_STATUS_OF = b"\xff\x02\x04\x01\x0e\x00\x06\x0e\x02\x0b\x00\x0e\x0e\x0e"
_NOTHING, _DOUBT = const(2), const(14)


class VL53L5CX:
    """One sensor on an I2C bus. `begin` makes it range; then, each cycle: `if sensor.ready(): sensor.read()`.

    `side` zones along a side; `view_deg` is their full angle, which the distances along their beams follow from: the
    device tells them square to its window. `feed` is called all along `begin`, which takes some 3 s at 400 kHz.
    """

    def __init__(self, i2c, side=4, view_deg=45, feed=None, time=time):
        if side not in _FASTEST_HZ:
            raise ValueError(f"zones along a side are 4 or 8, not {side}")
        self._i2c = i2c
        self._side = side
        block = bytearray(_CHUNK)
        self._processor = Processor(i2c, _ADDRESS, time.sleep_ms, feed or _rest, block)
        self._four = bytearray(4)
        self._longer = _lengthening(side, view_deg)
        self._frame = memoryview(block)[: _frame_size(side)]
        self._device_stream, self._nearest = 255, 0
        self.zones = bytearray(2 + 5 * side * side)
        """The newest measurement as it stands in a sample (`wire`)."""
        self.zones[0] = side
        self.period_us, self.delay_us = 1_000_000 // _FASTEST_HZ[side], _DELAY_US[side]
        """From the start of a measurement to that of the next, and from its middle until it is ready [us]."""
        self.stream = 0
        """The device's count of measurements, from 0 to 254."""
        self.status = 255
        """Of the zone with the nearest target, as `mm` and `sigma`: a status of UM2356."""
        self.mm = self.sigma = 0
        """Distance along its beam [mm], its standard deviation [mm / 4]."""
        self.signal = self.spads = 0
        """Not asked for."""
        self.ambient = 0
        """Rate of ambient light there, by SPAD [kcps / 128]."""

    def begin(self):
        """Load the program, set up the sensor and make it range without a pause."""
        self._processor.load()
        self._set_zones()
        self._processor.replace(_RATE, 4, 1, bytes([_FASTEST_HZ[self._side]]))
        self._processor.replace(_ORDER, 4, 0, b"\x01")  # the nearest target of a zone, not the strongest
        self._processor.replace(_MODE, 8, 1, b"\x01")
        self._processor.replace(_MODE, 8, 3, b"\x03")
        self._processor.write(_SINGLE, b"\x00\x00\x00\x00")
        self._start()

    def ready(self):
        """Whether there is a measurement that was not read."""
        four = self._four
        self._i2c.readfrom_mem_into(_ADDRESS, 0, four, addrsize=16)
        if four[3] & 0x80 and four[0] != 255:
            raise OSError(_IO, "VL53L5CX has failed")
        fresh = four[0] != self._device_stream and four[0] != 255
        return fresh and four[1] == 5 and four[2] & 5 == 5 and four[3] & 0x10 != 0

    def read(self):
        """Take the newest measurement into `zones` and `stream` to `ambient`; allocates nothing."""
        frame = self._frame
        self._i2c.readfrom_mem_into(_ADDRESS, 0, frame, addrsize=16)
        size = len(frame)
        if frame[10] != frame[size - 2] or frame[11] != frame[size - 1] or frame[0] == 255:
            raise OSError(_IO, "VL53L5CX: a torn frame")
        ambient = targets = sigma = distance = status = 0
        at = _BLOCKS_AT
        while at < size - 12:
            index = frame[at] << 8 | frame[at + 1]
            kind = frame[at + 3] & 15
            length = frame[at + 2] << 4 | frame[at + 3] >> 4
            at += 4
            if index == _AMBIENT:
                ambient = at
            elif index == _TARGETS:
                targets = at
            elif index == _SIGMA:
                sigma = at
            elif index == _DISTANCE:
                distance = at
            elif index == _TARGET_STATUS:
                status = at
            at += length * kind if 1 < kind < 13 else length
        if at != size - 12 or not (ambient and targets and sigma and distance and status):
            raise OSError(_IO, "VL53L5CX: a frame without what was asked for")
        self._device_stream = self.stream = frame[0]
        self._take(targets, sigma, distance, status)
        at = ambient + 4 * self._nearest
        self.ambient = min((frame[at + 1] << 12) | frame[at + 2] << 4 | frame[at + 3] >> 4, 0xFFFF)

    def _take(self, targets, sigma, distance, status):
        """Write the zones as a sample has them, from where the blocks begin, and find the nearest."""
        frame, zones = self._frame, self.zones
        best, nearest = 0x7FFFFFFF, 0
        for zone in range(self._side * self._side):
            two, one = 2 * (zone ^ 1), zone ^ 3
            mm = frame[distance + two] << 8 | frame[distance + two + 1]
            mm = 0 if mm & 0x8000 else (mm * self._longer[zone]) >> 12
            doubt = (frame[sigma + two] << 8 | frame[sigma + two + 1]) >> 5
            told = frame[status + one]
            code = _NOTHING if not frame[targets + one] or told == 255 else _DOUBT
            if code == _DOUBT and told < len(_STATUS_OF):
                code = _STATUS_OF[told]
            at = 2 + 5 * zone
            zones[at], zones[at + 1] = mm & 0xFF, mm >> 8
            zones[at + 2], zones[at + 3], zones[at + 4] = doubt & 0xFF, doubt >> 8, code
            order = mm if code == 0 or code == 6 or code == 11 else mm | 0x10000
            if order < best:
                best, nearest = order, zone
                self.mm, self.sigma, self.status = mm, doubt, code
        self._nearest = nearest

    def recalibrate(self):
        """Stop and start, with which its program calibrates itself."""
        self._processor.stop()
        self._start()

    def _set_zones(self):
        side = self._side
        spads, repeat, width = (64, 4, 8) if side == 4 else (16, 1, 4)
        data = self._processor.read(_DSS, 16)
        for at, value in ((4, spads), (6, spads), (9, repeat)):
            data[at ^ 3] = value
        self._processor.write(_DSS, data)
        data = self._processor.read(_ZONES, 8)
        for at, value in ((0, side), (1, side), (4, width), (5, width)):
            data[at ^ 3] = value
        self._processor.write(_ZONES, data)
        self._processor.send_grids(side)
        self._processor.forget_grids()

    def _start(self):
        listed = b"".join(
            struct.pack(">HH", index, _sized(index, size, self._side) if wanted else size)
            for index, size, wanted in _OUTPUTS
        )
        enabled = sum(wanted << bit for bit, (_, _, wanted) in enumerate(_OUTPUTS))
        size = len(self._frame)
        self._processor.write(_OUT_LIST, listed)
        self._processor.write(_OUT_SIZE, struct.pack(">II", size, len(_OUTPUTS) + 1))
        self._processor.write(_OUT_ENABLE, struct.pack(">IIII", enabled, 0, 0, 0xC0000000))
        self._device_stream = 255
        self._processor.range()
        told = self._processor.read(_SIZE_TOLD, 12)
        if told[10] << 8 | told[11] != size:
            raise OSError(_IO, f"VL53L5CX sends frames of {told[10] << 8 | told[11]} bytes, not {size}")


def _rest():
    """In place of a watchdog's `feed`."""


def _sized(index, size, side):
    """Size and type of a wanted output of so many zones along a side."""
    return side * side << 4 | size & 15 if 1 <= size & 15 < 13 else size


def _frame_size(side):
    size = _ENDS
    for _, told, wanted in _OUTPUTS:
        kind = told & 15
        if wanted:
            size += 4 + (side * side * kind if 1 <= kind < 13 else told >> 4)
    return size


def _lengthening(side, view_deg):
    """How much longer than square to the window the way is along each zone's beam [1 / 1024]."""
    tilts = [math.tan(math.radians(view_deg) * ((k + 0.5) / side - 0.5)) for k in range(side)]
    return tuple(round(1024 * math.sqrt(1 + x * x + y * y)) for y in tilts for x in tilts)
