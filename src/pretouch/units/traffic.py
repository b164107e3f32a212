"""What a receiver tells of each unit: plain numbers, cheap to keep, for monitors and records."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pretouch.types import FloatArray
from pretouch.units.wire import Reset, Sample, imu_values

UnitState = Literal["never heard", "greeting", "live", "silent"]
"""Nothing genuine yet; hellos only; samples; neither any more."""

REASONS = (
    "size",
    "format",
    "unit",
    "tag",
    "replayed",
    "no session",
    "too many hellos",
    "old hello",
)
"""Why datagrams are thrown away: no size, or no magic, version and kind, of ours; a unit this skin lacks; a wrong tag;
a sequence number seen already or long past; a sample of a unit without session; more hellos than are answered; a hello
of the very session that is live."""


@dataclass(slots=True)
class UnitTraffic:
    """What was heard of one unit."""

    id: str
    number: int
    state: UnitState = "never heard"
    accepted: int = 0
    """Samples believed."""
    lost: int = 0
    """Samples that never came: counted once 64 later ones were sent, or another session began."""
    replayed: int = 0
    """Datagrams with a sequence number that was used already or is long past; their tags are not looked at."""
    hellos: int = 0
    """Hellos answered; recorded ones among them."""
    sessions: int = 0
    """Sessions that were live."""
    reboots: int = 0
    """Sessions that found the unit's clock begun anew."""
    firmware: int = 0
    """Version it told when its session began: major * 256 + minor."""
    reset: int = Reset.UNKNOWN
    """Why it last began anew, by what it told then: a `Reset`."""
    address: tuple[str, int] | None = None
    """Host and port of its last sample."""
    last_arrival: float = -math.inf
    """When its last sample arrived [s]."""
    last_reading_stamp: float = -math.inf
    """Stamp of its newest reading [s]."""
    offset: float = math.nan
    """Host time minus unit time [s]; NaN while not known."""
    bound: float = math.inf
    """Most the true offset differs from it [s]."""
    clock_jumps: int = 0
    """How often the unit's clock contradicted itself."""
    latency: float = math.nan
    """From the making of a sample to its arrival [s], the most it can have been; mean of about the last 16."""
    stuck: bool = False
    """Whether its readings repeat to the last digit."""
    zones: int = 1
    """Zones along each side of its sensor, by the skin."""
    zones_told: int = 0
    """The same by its newest range, 1 of one without zones; 0 before the first."""
    misfits: int = 0
    """Ranges that were no reading because of other zones than the skin's."""
    sample: Sample | None = None
    """Its last sample."""


@dataclass(slots=True)
class Received:
    """A sample as it arrived, for recordings."""

    unit: int
    """Index in the `NetworkUnits` of the skin."""
    arrival: float
    """When it was taken in [s], host's clock."""
    stamp: float
    """Stamp of its range reading [s], the earliest it can have been; NaN if it has none, or it cannot be told."""
    offset: float
    """Host time minus unit time [s]; NaN while not known."""
    bound: float
    """Most the true offset differs from it [s]."""
    sample: Sample


@dataclass(slots=True)
class ImuBatch:
    """Consecutive IMU samples of one unit, sensor frame."""

    unit: int
    """Index in the `NetworkUnits` of the skin."""
    stamp: FloatArray
    """(M,) instants [s]: the newest is the earliest it can have been; the others lie before it by the nominal period,
    which a sensor keeps to some per cent."""
    acceleration: FloatArray
    """(M, 3) specific force [m/s^2]."""
    angular_velocity: FloatArray
    """(M, 3) [rad/s]."""
    index: int
    """Number of the first of them since the unit's reset; a gap to the batch before shows what was lost."""


def imu_batch(received: Received) -> ImuBatch | None:
    """Return the IMU samples that came with a sample; None if there are none, no instant, or no such scale or rate."""
    sample = received.sample
    if not sample.imu_count or not sample.imu_rate_hz or math.isnan(received.offset):
        return None
    try:
        acceleration, angular_velocity = imu_values(sample.imu, sample.imu_scale)
    except ValueError:  # a scale the sensor does not have
        return None
    newest = 1e-6 * (sample.time_us - sample.imu_age_us) + received.offset - received.bound
    stamp = newest + np.arange(1 - sample.imu_count, 1) / sample.imu_rate_hz
    return ImuBatch(received.unit, stamp, acceleration, angular_velocity, sample.imu_index)
