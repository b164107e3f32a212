"""One unit as its receiver sees it: session, clock, newest reading and counts."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pretouch.traces import ImuTrace
from pretouch.types import FloatArray, IntArray, RangeStatus, TouchStatus
from pretouch.units.clock import UnitClock
from pretouch.units.keys import UnitKey
from pretouch.units.session import Session, UnitLink
from pretouch.units.wire import NO_FORCE, ZONE, ZONES, Flag, Reset, Sample, imu_values, touch_part

UnitState = Literal["never heard", "greeting", "live", "silent"]
"""Nothing genuine yet; hellos only; samples; neither any more."""
Address = tuple[str, int]

_RANGE_NEW, _STUCK = int(Flag.RANGE_NEW), int(RangeStatus.STUCK)
_LEAST = 10
"""Readings that must be alike; fewer may be so by chance."""
DRIFT = 50e-6
"""Largest difference in rate between a unit's clock and the host's, as a fraction (crystals of 20 ppm, their
temperature, and the steering of the host's clock)."""
CLOCK_WINDOW_S = 10.0
"""How long a bound on a unit's clock counts [s]."""
SILENT_AFTER_S = 0.3
"""Time without a sample after which a unit is called silent [s]; the controller judges by itself."""
STUCK_AFTER_S = 1.0
"""Time of equal readings, to the last digit, after which a unit counts as stuck [s]; noise alone changes them."""
_GREETING_S = 1.0
"""Time without a hello after which a unit no longer asks for a session [s]; it would ask ten times in it."""
NOTHING = (-math.inf, 0.0, float(RangeStatus.NONE), -math.inf, 0.0, math.nan, float(TouchStatus.NONE))
"""Row of a unit that has measured nothing: stamp [s], distance [m] and status of its range; stamp [s], contact, force
[N] and status of its touch sensor."""


@dataclass(slots=True)
class UnitTraffic:
    """Counts of the datagrams of one unit: plain numbers, cheap to keep."""

    id: str
    number: int
    state: UnitState = "never heard"
    accepted: int = 0
    """Accepted samples."""
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
    """Version that it sent as its session began: major * 256 + minor."""
    reset: int = Reset.UNKNOWN
    """Reason of its last restart, as it reported it: a `Reset`."""
    address: Address | None = None
    """Host and port of its last sample."""
    last_arrival: float = -math.inf
    """Arrival of its last sample [s]."""
    last_reading_stamp: float = -math.inf
    """Stamp of its newest reading [s]."""
    offset: float = math.nan
    """Host time minus unit time [s]; NaN while it is not known."""
    bound: float = math.inf
    """Most the true offset differs from it [s]."""
    clock_jumps: int = 0
    """Number of times that the unit's clock contradicted itself."""
    stuck: bool = False
    """True if its readings repeat to the last digit."""
    zones: int = 1
    """Zones along each side of its sensor, by the skin."""
    zones_told: int = 0
    """The same by its newest range, 1 of one without zones; 0 before the first."""
    misfits: int = 0
    """Ranges that were no reading because of other zones than the skin's."""


@dataclass(slots=True)
class Received:
    """A sample as it arrived."""

    unit: int
    """Index in the `NetworkUnits` of the skin."""
    arrival: float
    """Time at which it was received [s], host's clock."""
    stamp: float
    """Stamp of its range reading [s], the earliest it can have been; NaN if it has none, or it cannot be known."""
    offset: float
    """Host time minus unit time [s]; NaN while it is not known."""
    bound: float
    """Most the true offset differs from it [s]."""
    sample: Sample


def imu_batch(received: Received) -> ImuTrace | None:
    """Return the IMU samples that came with a sample; None if there are none, no instant, or no such scale or rate.

    The newest is stamped with the earliest instant it can be of; the others lie before it by the nominal period, which
    a sensor keeps to some per cent.
    """
    sample = received.sample
    if not sample.imu_count or not sample.imu_rate_hz or math.isnan(received.offset):
        return None
    try:
        acceleration, angular_velocity = imu_values(sample.imu, sample.imu_scale)
    except ValueError:  # a scale the sensor does not have
        return None
    newest = 1e-6 * (sample.time_us - sample.imu_age_us) + received.offset - received.bound
    stamp = newest + np.arange(1 - sample.imu_count, 1) / sample.imu_rate_hz
    return ImuTrace(stamp, acceleration, angular_velocity)


class StuckDetector:
    """Watches the readings of one unit: a range finder that repeats itself to the last digit does not measure."""

    def __init__(self, after: float) -> None:
        """Call a unit stuck whose readings are alike for so long [s]."""
        self._after = after
        self.stuck = False
        self._values: tuple[int | bytes, ...] = ()
        self._alikes, self._values_since = 0, math.inf
        self.forget_stream()

    def forget_stream(self) -> None:
        """Let the count of measurements begin anew, as after a reboot; values that were alike still are."""
        self._stream, self._streams, self._stream_since = -1, 0, math.inf

    def update(self, sample: Sample, now: float) -> bool:
        """Take in a sample newer than those before, that arrived at this instant [s]; return whether it is stuck."""
        if not sample.flags & _RANGE_NEW:
            return self.stuck
        if sample.range_stream != self._stream:
            self._stream, self._streams, self._stream_since = sample.range_stream, 0, now
        light = sample.range_signal, sample.range_ambient, sample.range_spads
        values = sample.range_mm, sample.range_sigma, *light, sample.zones
        if values != self._values:
            self._values, self._alikes, self._values_since = values, 0, now
        self._streams += 1
        self._alikes += 1
        self.stuck = (self._streams >= _LEAST and now - self._stream_since >= self._after) or (
            self._alikes >= _LEAST and now - self._values_since >= self._after
        )
        return self.stuck


class UnitEndpoint:
    """Address, sessions and traffic of one unit. Times in seconds of the host's clock."""

    def __init__(self, index: int, unit: UnitKey, zones: int, draw: Callable[[int], bytes], rows: FloatArray) -> None:
        """Begin without data of the unit with this index in the `NetworkUnits` of the skin.

        What it measures goes to `rows` (`zones` squared, 7), as `NOTHING` has it; a touch to the first of them.
        """
        self._reading, self._touch = rows[:, :3], rows[0, 3:]
        self.traffic = UnitTraffic(unit.id, unit.number, zones=zones)
        self.address: Address | None = None
        """Address that its last sample came from, as the socket knows it."""
        self._index = index
        self._link = UnitLink(unit.key, draw)
        self._clock = UnitClock(DRIFT, CLOCK_WINDOW_S)
        self._stuck = StuckDetector(STUCK_AFTER_S)
        self._session: Session | None = None
        self._newest_us = 0
        """The unit's clock in its last sample [us]."""
        self._last_hello = -math.inf
        self._echoed = 0
        """Beacon whose echo was used last: the same one again tells nothing new."""
        self._trusted_from = 0
        """First beacon whose echo tells the time: those before were heard before the unit's clock jumped."""

    def hello(self, datagram: memoryview, now: float) -> bytes | str:
        """Return the answer to what looks like a hello, or why there is none."""
        answer = self._link.hello(datagram, now)
        if isinstance(answer, bytes):
            traffic = self.traffic
            traffic.hellos += 1
            self._last_hello = now
            if traffic.state in ("never heard", "silent"):
                traffic.state = "greeting"
        return answer

    def sample(self, datagram: memoryview, sequence: int, address: Address, now: float) -> Received | str:
        """Return the result of a datagram that looks like a sample, or the reason to reject it."""
        verified = self._link.sample(datagram, sequence, now)
        traffic = self.traffic
        if isinstance(verified, str):
            traffic.replayed += verified == "replayed"
            return verified
        session, sample, lost = verified
        if session is not self._session:
            self._begin(session)
        traffic.state = "live"
        traffic.accepted += 1
        traffic.lost += lost
        traffic.last_arrival = now
        self._newest_us = sample.time_us
        if address != self.address:
            self.address, traffic.address = address, address[:2]
        self._tell_time(session, sample, now)
        if sample.touch:
            self._take_touch(sample)
        stamp = math.nan
        if sample.flags & _RANGE_NEW:
            traffic.zones_told = sample.zones[0] if sample.zones else 1
            if traffic.zones_told == traffic.zones:
                stamp = self._take_reading(sample, now)
            else:  # where each zone looks is not known
                traffic.misfits += 1
        return Received(self._index, now, stamp, traffic.offset, traffic.bound, sample)

    def beacon_due(self, now: float) -> bool:
        """Return whether a beacon is due for `address`; expire what is too old."""
        traffic = self.traffic
        if (traffic.state == "live" and now - traffic.last_arrival > SILENT_AFTER_S) or (
            traffic.state == "greeting" and now - self._last_hello > _GREETING_S
        ):
            traffic.state = "silent"
        self._link.expire(now)
        return now >= self._link.beacon_due

    def beacon(self, now: float) -> bytes:
        """Return the beacon that is due, to be sent at once."""
        return self._link.beacon(now)

    def _begin(self, session: Session) -> None:
        """Begin another session."""
        traffic = self.traffic
        traffic.sessions += 1
        if session.hello.uptime_us < self._newest_us:
            traffic.reboots += 1
            self._stuck.forget_stream()
        traffic.firmware, traffic.reset = session.hello.firmware, session.hello.reset
        self._session, self._trusted_from, self._echoed = session, 0, 0
        self._clock.forget()

    def _tell_time(self, session: Session, sample: Sample, now: float) -> None:
        """Update offset and bound."""
        clock, traffic = self._clock, self.traffic
        sent = None
        if sample.beacon != self._echoed and sample.beacon >= self._trusted_from:
            sent, self._echoed = session.sent.get(sample.beacon), sample.beacon
        if not clock.update(1e-6 * sample.time_us, now, sent, 1e-6 * sample.beacon_hold_us):
            # take the time from no beacon that was sent already, and send another soon
            self._trusted_from, self._link.beacon_due = session.number + 1, now
        traffic.clock_jumps = clock.jumps
        traffic.offset, traffic.bound = clock.offset, clock.bound

    def _take_reading(self, sample: Sample, now: float) -> float:
        """Keep a reading if it is the newest; return its stamp, NaN if it cannot be told."""
        traffic, clock = self.traffic, self._clock
        instant = 1e-6 * (sample.time_us - sample.range_age_us)
        newest = instant > clock.last_reading
        if newest:
            traffic.stuck = self._stuck.update(sample, now)
        stamp = clock.stamp(instant)
        if not clock.bounded:
            return math.nan
        if newest and stamp > traffic.last_reading_stamp:
            traffic.last_reading_stamp = stamp
            mm: int | IntArray = sample.range_mm
            status: int | IntArray = sample.range_status
            if sample.zones:
                zones = np.frombuffer(sample.zones, ZONE, offset=ZONES.size)
                mm, status = zones["mm"], zones["status"]
            stamps, distances, statuses = self._reading.T
            stamps[:], distances[:] = stamp, 1e-3 * mm
            statuses[:] = _STUCK if traffic.stuck else status
        return stamp

    def _take_touch(self, sample: Sample) -> None:
        """Keep a touch reading if it is the newest whose instant is known."""
        part = touch_part(sample)
        if part is None or not self._clock.bounded:
            return
        stamp = self._clock.earliest(1e-6 * (sample.time_us - part.age_us))
        if stamp > self._touch[0]:
            force = math.nan if part.force_mn == NO_FORCE else 1e-3 * part.force_mn
            self._touch[:] = stamp, float(part.contact != 0), force, part.status
