"""The datagrams between sensor units and their receiver, version 1 (docs/reference/wire.md). Bytes to values and back.

Three kinds, all little-endian, each ended by the first 16 bytes of an HMAC-SHA256:

- HELLO, unit to receiver: "I have no session"; carries a random challenge. Under the unit's own key.
- BEACON, receiver to unit: opens a session by its random nonce, and is the time signal from then on. Under the unit's
  own key, and mixed with the unit's challenge: a beacon of an earlier session or of before a reboot never verifies.
- SAMPLE, unit to receiver: what was measured. Under the session's key, made of key, challenge and nonce: a sample of an
  earlier session never verifies.
"""

import hmac
import struct
from dataclasses import dataclass, fields
from enum import IntEnum, IntFlag
from hmac import compare_digest
from operator import attrgetter

import numpy as np

from pretouch.sensing.sensor import MOST_ZONES
from pretouch.sensing.unit import counts_of
from pretouch.types import FloatArray

MAGIC = b"PT"
VERSION = 1
TAG_SIZE = 16
CHALLENGE_SIZE = NONCE_SIZE = 8

PREFIX = struct.Struct("<2sBBH")
"""Magic, version, kind, number of the unit."""
HELLO = struct.Struct("<HBB8sQ")
"""After the prefix: firmware version, cause of the last reset, 0, challenge, time since it began to serve [us]."""
BEACON = struct.Struct("<I8s")
"""After the prefix: number of the beacon, nonce of the session."""
SAMPLE = struct.Struct("<HIQIIHhHBBHIHHHHBBHII")
"""After the prefix: the fields of `Sample` in their order, to `imu_age_us`; `imu_count` IMU samples follow."""
IMU_SAMPLE = struct.Struct("<6h")
"""Gyroscope x, y, z, accelerometer x, y, z, as the sensor's FIFO has them."""
TOUCH = struct.Struct("<BBHII")
"""Behind the IMU samples of a sample with `Flag.TOUCH`: the fields of `TouchPart` in their order."""
NO_FORCE = 0xFFFFFFFF
"""In place of a force [mN] that is not measured."""
ZONES = struct.Struct("<BB")
"""Behind those in a sample with `Flag.ZONES`: zones along a side, and 0. A `ZONE` for each of them follows, in the
order of `pretouch.sensing.skin.Skin`."""
ZONE = np.dtype([("mm", "<u2"), ("sigma", "<u2"), ("status", "u1")])
"""Measurement of a zone: as `range_mm`, `range_sigma` and `range_status` of a `Sample`."""
IMU_MOST = 32
"""Most IMU samples in a datagram."""

HELLO_SIZE = PREFIX.size + HELLO.size + TAG_SIZE
BEACON_SIZE = PREFIX.size + BEACON.size + TAG_SIZE
SAMPLE_LEAST = PREFIX.size + SAMPLE.size + TAG_SIZE
"""Size of a sample without any of the IMU [B]."""
SAMPLE_MOST = SAMPLE_LEAST + IMU_MOST * IMU_SAMPLE.size + TOUCH.size + ZONES.size + MOST_ZONES**2 * ZONE.itemsize
"""Size of the largest sample [B]."""
_COUNT_AT = PREFIX.size + struct.calcsize("<HIQIIHhHBBHIHHHH")
"""Where a sample says how many IMU samples it has."""

NO_TEMPERATURE = -32768
LONGEST_US = 0xFFFFFFFF
"""Largest age or hold a field can tell [us]; what is longer reads as this."""

_HELLO_LABEL, _BEACON_LABEL, _SESSION_LABEL = b"PT1HELLO", b"PT1BEACN", b"PT1SESSN"


class Kind(IntEnum):
    """Kind of a datagram."""

    HELLO = 1
    BEACON = 2
    SAMPLE = 3


class Flag(IntFlag):
    """State of a unit, as its sample reports it."""

    RANGE_NEW = 1
    """It holds a range measured since the last one."""
    RANGE_BUS_ERROR = 2
    """The range finder did not answer on the bus in this cycle."""
    IMU_BUS_ERROR = 4
    """The IMU did not answer on the bus in this cycle."""
    IMU_LOST = 8
    """The IMU's FIFO ran over: samples before these are lost."""
    RANGE_RESTARTED = 16
    """The range finder was initialised anew in this cycle."""
    IMU_RESTARTED = 32
    """The IMU was initialised anew in this cycle."""
    RANGE_LATE = 64
    """The range finder has had nothing new for more than two of its periods."""
    TOUCH = 128
    """It holds a touch reading."""
    ZONES = 256
    """It holds the zones of a range."""


_TOUCH, _ZONES = int(Flag.TOUCH), int(Flag.ZONES)


class Reset(IntEnum):
    """Reason of a unit's restart."""

    UNKNOWN = 0
    POWER_ON = 1
    HARD = 2
    WATCHDOG = 3
    DEEP_SLEEP = 4
    SOFT = 5


class Mac:
    """HMAC-SHA256 of one key, first 16 bytes; the key is hashed once."""

    def __init__(self, key: bytes) -> None:
        self._begun = hmac.new(key, digestmod="sha256")

    def whole(self, *parts: bytes | memoryview) -> bytes:
        """All 32 bytes, of parts one after the other."""
        mac = self._begun.copy()
        for part in parts:
            mac.update(part)
        return mac.digest()

    def tag(self, *parts: bytes | memoryview) -> bytes:
        """The tag of parts one after the other."""
        return self.whole(*parts)[:TAG_SIZE]


def session_mac(key: Mac, challenge: bytes, nonce: bytes) -> Mac:
    """Mac of the samples of one session."""
    return Mac(key.whole(_SESSION_LABEL, challenge, nonce))


@dataclass(slots=True)
class Hello:
    """A unit asks for a session."""

    unit: int
    firmware: int
    """Major version * 256 + minor version."""
    reset: int
    """A `Reset`."""
    challenge: bytes
    uptime_us: int

    def encode(self, key: Mac) -> bytes:
        """Encode as a datagram under the unit's key."""
        hello = HELLO.pack(self.firmware, self.reset, 0, self.challenge, self.uptime_us)
        body = PREFIX.pack(MAGIC, VERSION, Kind.HELLO, self.unit) + hello
        return body + key.tag(_HELLO_LABEL, body)


def decode_hello(datagram: bytes | memoryview, key: Mac) -> Hello | None:
    """Return what a datagram of the right size, magic, version and kind says; None if its tag is wrong."""
    body = datagram[:-TAG_SIZE]
    if not compare_digest(key.tag(_HELLO_LABEL, body), datagram[-TAG_SIZE:]):
        return None
    firmware, reset, _, challenge, uptime = HELLO.unpack_from(body, PREFIX.size)
    return Hello(PREFIX.unpack_from(body)[3], firmware, reset, challenge, uptime)


@dataclass(slots=True)
class Beacon:
    """The receiver opens or continues a session of one unit."""

    unit: int
    number: int
    """Grows with each beacon of a session, from 1."""
    nonce: bytes

    def encode(self, key: Mac, challenge: bytes) -> bytes:
        """Encode as a datagram under the unit's key, for the unit that sent this challenge."""
        body = PREFIX.pack(MAGIC, VERSION, Kind.BEACON, self.unit) + BEACON.pack(self.number, self.nonce)
        return body + key.tag(_BEACON_LABEL, challenge, body)


def decode_beacon(datagram: bytes, key: Mac, challenge: bytes) -> Beacon | None:
    """Return what a datagram says to a unit that sent a challenge; None if it is no beacon, or its tag is wrong."""
    if len(datagram) != BEACON_SIZE:
        return None
    body = datagram[:-TAG_SIZE]
    magic, version, kind, unit = PREFIX.unpack_from(body)
    if (magic, version, kind) != (MAGIC, VERSION, Kind.BEACON):
        return None
    if not compare_digest(key.tag(_BEACON_LABEL, challenge, body), datagram[-TAG_SIZE:]):
        return None
    number, nonce = BEACON.unpack_from(body, PREFIX.size)
    return Beacon(unit, number, nonce)


@dataclass(slots=True)
class Sample:
    """Measurements of a unit since its last sample. Integers as on the wire; properties in SI units."""

    unit: int
    flags: int
    """`Flag`s."""
    sequence: int
    """Grows by 1 with each sample of a session, from 1."""
    time_us: int
    """The unit's clock when the datagram was made: time since it began to serve [us]."""
    beacon: int
    """Number of the last beacon it heard."""
    beacon_hold_us: int
    """Time since it heard the beacon [us]."""
    battery_mv: int
    """Voltage of its battery [mV]; 0 if it cannot tell."""
    temperature_cdeg: int
    """Temperature of its IMU [0.01 degrees C]; `NO_TEMPERATURE` if it cannot tell."""
    bus_errors: int
    """Failed transfers on its bus since the unit began to serve; stays at 65535."""
    range_stream: int
    """The range finder's own count of measurements, from 0 to 255 and then from 128 on again."""
    range_status: int
    """A `RangeStatus`; 255 if nothing was measured."""
    range_mm: int
    """Distance [mm]."""
    range_age_us: int
    """Time from the middle of the measurement to `time_us` [us]."""
    range_sigma: int
    """Standard deviation of the distance, estimated by the sensor [mm / 4]."""
    range_signal: int
    """Rate of the signal [Mcps / 128]."""
    range_ambient: int
    """Rate of ambient light [Mcps / 128]."""
    range_spads: int
    """SPADs in use [1 / 256]."""
    imu_count: int
    """IMU samples in this datagram."""
    imu_scale: int
    """Full scales: accelerometer in bits 0-1 (2, 4, 8, 16 g), gyroscope in bits 4-6 (125, 245, 500, 1000, 2000 dps)."""
    imu_rate_hz: int
    """Nominal rate of the IMU [Hz]."""
    imu_index: int
    """Number of the first IMU sample in this datagram since the unit began to serve; lost ones are counted, as far as
    known."""
    imu_age_us: int
    """Time from the newest IMU sample to `time_us` [us]."""
    imu: bytes = b""
    """`imu_count` times `IMU_SAMPLE`."""
    touch: bytes = b""
    """One `TOUCH` with `Flag.TOUCH`, else nothing."""
    zones: bytes = b""
    """`ZONES` and each zone's `ZONE` with `Flag.ZONES`, else nothing. The fields of the range are of the nearest."""

    def body(self) -> bytes:
        """Encode as a datagram without its tag, as `sample_of` takes it."""
        body = PREFIX.pack(MAGIC, VERSION, Kind.SAMPLE, self.unit) + SAMPLE.pack(*_NUMBERS(self))
        return body + self.imu + self.touch + self.zones

    def encode(self, session: Mac) -> bytes:
        """Encode as a datagram of a session."""
        body = self.body()
        return body + session.tag(body)


_NUMBERS = attrgetter(*[field.name for field in fields(Sample)][1:-3])
"""Gives what `SAMPLE` holds of a sample."""


def decode_sample(datagram: bytes | memoryview, session: Mac) -> Sample | None:
    """Return what a datagram of the right size, magic, version and kind says; None if tag or length is wrong."""
    body = datagram[:-TAG_SIZE]
    if not compare_digest(session.tag(body), datagram[-TAG_SIZE:]):
        return None
    return sample_of(body)


def sample_of(body: bytes | memoryview) -> Sample | None:
    """Return what the bytes of a sample before its tag say; None if its counts do not go with its length."""
    if sample_size(body) != len(body) + TAG_SIZE:
        return None
    unit: int = PREFIX.unpack_from(body)[3]
    sample = Sample(unit, *SAMPLE.unpack_from(body, PREFIX.size))
    rest = bytes(body[PREFIX.size + SAMPLE.size :])
    imu = sample.imu_count * IMU_SAMPLE.size
    touch = imu + (TOUCH.size if sample.flags & _TOUCH else 0)
    sample.imu, sample.touch, sample.zones = rest[:imu], rest[imu:touch], rest[touch:]
    return sample


def sample_size(datagram: bytes | memoryview) -> int:
    """Return the size [B] of a sample by its own flags and counts, 0 by counts that no sample has.

    A datagram shorter than `SAMPLE_LEAST` - `TAG_SIZE` has none to go by.
    """
    flags, count = datagram[PREFIX.size] | datagram[PREFIX.size + 1] << 8, datagram[_COUNT_AT]
    if count > IMU_MOST:
        return 0
    size = SAMPLE_LEAST + count * IMU_SAMPLE.size + (TOUCH.size if flags & _TOUCH else 0)
    if flags & _ZONES:
        at = size - TAG_SIZE
        side = datagram[at] if at < len(datagram) else 0
        size = size + zones_size(side) if 1 <= side <= MOST_ZONES else 0
    return size


def zones_size(side: int) -> int:
    """Return what so many zones along a side add to a sample [B]."""
    return ZONES.size + side**2 * ZONE.itemsize


@dataclass(frozen=True, slots=True)
class TouchPart:
    """Touch readings of a sample. Integers as on the wire."""

    contact: int
    """1 if the unit is touched, 0 if not."""
    status: int
    """A `TouchStatus`."""
    raw: int
    """Voltage at the sensor's converter [mV], for calibration; 0 of another sensor."""
    force_mn: int
    """Size of the force [mN]; `NO_FORCE` where it is not measured."""
    age_us: int
    """Time from the measurement to `Sample.time_us` [us]."""

    def encode(self) -> bytes:
        """Encode as a part of a sample."""
        return TOUCH.pack(self.contact, self.status, self.raw, self.force_mn, self.age_us)


def touch_part(sample: Sample) -> TouchPart | None:
    """Return the touch reading of a sample, None of one without."""
    return TouchPart(*TOUCH.unpack(sample.touch)) if sample.touch else None


def imu_values(imu: bytes, scale: int) -> tuple[FloatArray, FloatArray]:
    """Return accelerations (M, 3) [m/s^2] and angular velocities (M, 3) [rad/s], sensor frame, of a sample's IMU data.

    Full scales there are not are a ValueError.
    """
    acceleration, angular_rate = counts_of(scale)
    counts = np.frombuffer(imu, dtype="<i2").reshape(-1, 6).astype(np.float64)
    return counts[:, 3:] * acceleration, counts[:, :3] * angular_rate
