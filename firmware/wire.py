"""The unit's side of the datagrams, version 1 (docs/reference/wire.md), byte for byte as the receiver has them."""

import hashlib
import struct

from micropython import const

TAG_SIZE = const(16)
BEACON_SIZE = const(34)
IMU_MOST = const(32)
IMU_SAMPLE_SIZE = const(12)

RANGE_NEW = const(1)
RANGE_BUS_ERROR = const(2)
IMU_BUS_ERROR = const(4)
IMU_LOST = const(8)
RANGE_RESTARTED = const(16)
IMU_RESTARTED = const(32)
RANGE_LATE = const(64)
TOUCH = const(128)
ZONES = const(256)

TOUCH_OK, TOUCH_FAILED = const(0), const(1)
NO_FORCE = const(0xFFFFFFFF)

NO_RANGE = const(255)
NO_TEMPERATURE = const(-32768)
LONGEST_US = const(0xFFFFFFFF)

_MAGIC = b"PT"
_VERSION = const(1)
_KIND_HELLO, _KIND_BEACON, _KIND_SAMPLE = 1, 2, 3
_HELLO = "<2sBBHHBB8sQ"
_BEACON = "<2sBBHI8s"
_SAMPLE = "<2sBBHHIQIIHhHBBHIHHHHBBHII"
_SAMPLE_HEAD = const(62)
_TOUCH = "<BBHII"
_TOUCH_SIZE = const(12)
_BLOCK = const(64)


class Mac:
    """HMAC-SHA256 of one key (at most 64 bytes), its two pads made once."""

    def __init__(self, key):
        padded = key + bytes(_BLOCK - len(key))
        self._inner = bytes(byte ^ 0x36 for byte in padded)
        self._outer = bytes(byte ^ 0x5C for byte in padded)

    def whole(self, *parts):
        """All 32 bytes, of parts one after the other."""
        inner = hashlib.sha256(self._inner)
        for part in parts:
            inner.update(part)
        outer = hashlib.sha256(self._outer)
        outer.update(inner.digest())
        return outer.digest()


def session_mac(mac, challenge, nonce):
    """Mac of the samples of one session, from the unit's own."""
    return Mac(mac.whole(b"PT1SESSN", challenge, nonce))


def hello(unit, firmware, reset, challenge, uptime_us, mac):
    """Return the datagram that asks for a session."""
    body = struct.pack(_HELLO, _MAGIC, _VERSION, _KIND_HELLO, unit, firmware, reset, 0, challenge, uptime_us)
    return body + mac.whole(b"PT1HELLO", body)[:TAG_SIZE]


def open_beacon(datagram, unit, challenge, mac):
    """Return number and nonce of a beacon to this unit for this challenge, else None."""
    if len(datagram) != BEACON_SIZE:
        return None
    magic, version, kind, number_of_unit, number, nonce = struct.unpack_from(_BEACON, datagram)
    if (magic, version, kind, number_of_unit) != (_MAGIC, _VERSION, _KIND_BEACON, unit):
        return None
    tag = mac.whole(b"PT1BEACN", challenge, datagram[:-TAG_SIZE])
    wrong = 0
    for index in range(TAG_SIZE):
        wrong |= tag[index] ^ datagram[BEACON_SIZE - TAG_SIZE + index]
    return None if wrong else (number, nonce)


class Sample:
    """What the unit says next, field by field, and the datagram made of it. The units are those of the wire."""

    def __init__(self, unit, zones_size=0):
        """`zones_size` is the most that zones take [B]."""
        self._unit = unit
        most = _SAMPLE_HEAD + IMU_MOST * IMU_SAMPLE_SIZE + _TOUCH_SIZE + zones_size + TAG_SIZE
        self._datagram = memoryview(bytearray(most))
        self.zones = b""
        self.imu = self._datagram[_SAMPLE_HEAD : _SAMPLE_HEAD + IMU_MOST * IMU_SAMPLE_SIZE]
        self.flags = self.sequence = self.time_us = self.beacon = self.beacon_hold_us = 0
        self.battery_mv = self.bus_errors = 0
        self.temperature_cdeg = NO_TEMPERATURE
        self.range_stream = self.range_mm = self.range_sigma = 0
        self.range_signal = self.range_ambient = self.range_spads = 0
        self.range_status = NO_RANGE
        self.range_age_us = self.imu_age_us = LONGEST_US
        self.imu_count = self.imu_scale = self.imu_rate_hz = self.imu_index = 0
        self.touch_contact = self.touch_status = self.touch_raw_mv = 0
        self.touch_force_mn, self.touch_age_us = NO_FORCE, LONGEST_US

    def seal(self, mac):
        """Return the datagram, good until the next one is made."""
        struct.pack_into(
            _SAMPLE, self._datagram, 0, _MAGIC, _VERSION, _KIND_SAMPLE, self._unit, self.flags, self.sequence,
            self.time_us, self.beacon, self.beacon_hold_us, self.battery_mv, self.temperature_cdeg, self.bus_errors,
            self.range_stream, self.range_status, self.range_mm, self.range_age_us, self.range_sigma,
            self.range_signal, self.range_ambient, self.range_spads, self.imu_count, self.imu_scale,
            self.imu_rate_hz, self.imu_index, self.imu_age_us,
        )  # fmt: skip
        end = _SAMPLE_HEAD + self.imu_count * IMU_SAMPLE_SIZE
        if self.flags & TOUCH:
            struct.pack_into(
                _TOUCH, self._datagram, end, self.touch_contact, self.touch_status, self.touch_raw_mv,
                self.touch_force_mn, self.touch_age_us,
            )  # fmt: skip
            end += _TOUCH_SIZE
        if self.flags & ZONES:
            self._datagram[end : end + len(self.zones)] = self.zones
            end += len(self.zones)
        self._datagram[end : end + TAG_SIZE] = mac.whole(self._datagram[:end])[:TAG_SIZE]
        return self._datagram[: end + TAG_SIZE]
