"""A simulated sensor unit on the wire: the firmware's use of sensors, clock and session."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isclose

import numpy as np

from pretouch.checks import Checked, NonNegative, Positive
from pretouch.sensing.sensor import PAPER_SENSOR
from pretouch.sensing.unit import ACCELERATION_LSB, ANGULAR_RATE_LSB
from pretouch.sim.imu import ImuParams, ImuSample
from pretouch.sim.range_finder import RangeSample
from pretouch.sim.touch_sensor import TouchSample
from pretouch.types import RangeStatus, TouchStatus
from pretouch.units.keys import UnitKey
from pretouch.units.wire import (
    CHALLENGE_SIZE,
    IMU_MOST,
    IMU_SAMPLE,
    LONGEST_US,
    NO_FORCE,
    ZONE,
    ZONES,
    Flag,
    Hello,
    Mac,
    Reset,
    Sample,
    TouchPart,
    decode_beacon,
    session_mac,
)

FIRMWARE = 0x0001
"""Version that a simulated unit reports: 0.1, that of `firmware/`."""
FIFO_MOST = 682
"""IMU samples that the LSM6DS3's FIFO of 8 kB holds (data sheet)."""
_RANGE_PERIOD_S, _FRAME_PERIOD_S = 0.02, 1 / 15
"""Longest time from one range to the next of a sensor without zones, and of one with them [s]."""
_ROUNDING_S = 1e-9
_LAST = 0xFFFFFFFF
"""Last sequence number of a session."""
_BATTERY_MV, _TEMPERATURE_CDEG = 3900, 3100


@dataclass(frozen=True)
class UnitParams(Checked):
    """Clock and session of a simulated unit."""

    hello_s: Positive = 0.1
    """Mean time between hellos, spread by a quarter either way [s] (firmware)."""
    silence_s: Positive = 2.0
    """Time without a beacon after which a unit leaves its session [s] (firmware)."""
    shortest_s: Positive = 0.01
    """Least time from one sample to the next; past it, one is sent as soon as there is a new range [s] (firmware)."""
    longest_s: Positive = 0.025
    """Time from one sample to the next while there is no new range [s] (firmware)."""
    ready_s: NonNegative = 0.0025
    """Time until the unit has a measurement that is ready [s]: bus and loop (firmware's tests: 1.5 to 4.5 ms)."""
    boot_s: NonNegative = 2.0
    """Time from a reset to the first hello [s]: start of the firmware and joining the network; an assumption."""
    drift_ppm: NonNegative = 20.0
    """Each unit's clock is fast or slow by up to this [1e-6]: a common crystal."""
    age_max_s: Positive = 600.0
    """Units were switched on up to this long before the start [s]."""


class SimulatedUnit:
    """One unit. Bytes in, bytes out; the time [s] is given and is the same for sensors, network and receiver."""

    def __init__(
        self, key: UnitKey, params: UnitParams, rng: np.random.Generator, imu: ImuParams | None = None,
        reboots: Iterable[float] = (), zones: int = 1,
    ) -> None:  # fmt: skip
        """Switch the unit on at a random time in the past; it has no session yet.

        Args:
            key: its name, number and key.
            params: its habits.
            rng: for its clock, its challenges and the spread of its hellos.
            imu: how its IMU is set, if it has one.
            reboots: when it is to begin anew [s], in order; there may be no end of them.
            zones: of its range finder along each side.
        """
        self._zones = zones
        self.key, self._params, self._rng = key, params, rng
        self._mac = Mac(key.key)
        self._rate = 1.0 + 1e-6 * params.drift_ppm * float(rng.uniform(-1, 1))
        self._began = -float(rng.uniform(0, params.age_max_s))
        self._up = 0.0
        self._reset = Reset.POWER_ON
        self._reboots: Iterator[float] = iter(reboots)
        self._next_reboot = next(self._reboots, np.inf)
        self._imu_scale, self._imu_rate = 0, 0
        if imu is not None:  # full scales as a sample has them
            rates = list(ANGULAR_RATE_LSB).index(imu.angular_rate_range_dps)
            self._imu_scale = list(ACCELERATION_LSB).index(imu.acceleration_range_g) | rates << 4
            self._imu_rate = round(imu.rate_hz)
        self.silent = False
        """True if it neither sends nor hears: out of power, or out of reach."""
        self.delay_s = PAPER_SENSOR.delay_s
        """Time from the middle of a measurement, or its stamp, until it is ready [s]."""
        self.stuck = False
        """True if its range finder repeats what it measured last."""
        self._forget()

    def _forget(self) -> None:
        """Clear the state, as after a reset."""
        self._measuring: deque[list[RangeSample]] = deque()
        self._range: list[RangeSample] = []
        self._range_new, self._stream = False, 0
        self._touch: TouchSample | None = None
        self._touch_new = False
        self._fifo: deque[ImuSample] = deque()
        self._fifo_first, self._fifo_lost = 0, False
        self._imu_time, self._imu_step, self._imu_period, self._imu_phase = np.nan, np.nan, np.nan, 0.0
        self._next_hello = self._up + self._params.hello_s * float(self._rng.uniform())
        self._sampled = self._up - self._params.longest_s * float(self._rng.uniform())
        self._leave()

    def _leave(self) -> None:
        """Leave the session; what it was under is never used again."""
        self._session: Mac | None = None
        self._challenge, self._nonce = self._rng.bytes(CHALLENGE_SIZE), b""
        self._sequence = self._beacon = 0
        self._beacon_time = -np.inf

    @property
    def in_session(self) -> bool:
        """True while it sends samples."""
        return self._session is not None

    def reboot(self, now: float) -> None:
        """Restart at a time [s]; its clock begins at 0."""
        self._began, self._up, self._reset = now, now + self._params.boot_s, Reset.WATCHDOG
        self._forget()

    def take_range(self, sample: RangeSample, zone: int = 0) -> None:
        """Let its range finder measure, with a zone of it; it has the reading `delay_s` and `UnitParams.ready_s` later.

        What zones measure at one time is one reading. A zone that measures nothing then has status NONE.
        """
        if sample.time < self._up:
            return
        if not self._measuring or self._measuring[-1][0].time != sample.time:
            self._measuring.append([_nothing(sample.time)] * self._zones**2)
        self._measuring[-1][zone] = sample

    def take_touch(self, sample: TouchSample) -> None:
        """Let its touch sensor measure: a pin that its loop looks at in each pass."""
        if sample.time >= self._up:
            self._touch_new = self._touch is None or sample.contact != self._touch.contact
            self._touch = sample

    def _touch_part(self, now: float) -> bytes:
        """Return its touch reading, if it has one."""
        touch = self._touch
        if touch is None:
            return b""
        force = NO_FORCE if np.isnan(touch.force) else round(1e3 * touch.force)
        return TouchPart(int(touch.contact), TouchStatus.OK, 0, force, self._since(touch.time, now)).encode()

    def _zones_part(self) -> bytes:
        """Return the zones of a new range, if it has some."""
        if self._zones == 1 or not self._range_new:
            return b""
        rows = [(_field(zone.distance, 1e3), _field(zone.sigma, 4e3), zone.status) for zone in self._range]
        return ZONES.pack(self._zones, 0) + np.array(rows, ZONE).tobytes()

    def _look_at_range(self, now: float) -> None:
        """Take the readings that are ready."""
        late = self.delay_s + self._params.ready_s
        while self._measuring and self._measuring[0][0].time + late <= now + _ROUNDING_S:
            ready = self._measuring.popleft()
            self._range_new = True
            if self.stuck and self._range:
                self._range = [sample._replace(time=ready[0].time) for sample in self._range]
            else:
                self._range, self._stream = ready, self._stream + 1 if self._stream < 255 else 128

    def take_imu(self, sample: ImuSample) -> None:
        """Let its IMU's FIFO take a sample in; full, it loses the oldest.

        Samples that were due since the one before, and never came, count as lost, and what waits with them.
        """
        if sample.time < self._up:
            return
        before, step = self._imu_step, sample.time - self._imu_time
        self._imu_time, self._imu_step = sample.time, step
        if step > 0.0 and isclose(step, before, rel_tol=1e-6):  # twice the same: nothing is missing
            self._imu_period = step
        elif step > self._imu_period:
            self._imu_phase += step / self._imu_period - 1.0  # what is no whole sample counts at the next gap
            missing = round(self._imu_phase)
            if missing > 0:
                self._imu_phase -= missing
                self._fifo_first += len(self._fifo) + missing
                self._fifo.clear()
                self._fifo_lost = True
        self._fifo.append(sample)
        if len(self._fifo) > FIFO_MOST:
            self._fifo.popleft()
            self._fifo_first += 1
            self._fifo_lost = True

    def receive_beacon(self, datagram: bytes, now: float) -> None:
        """Take in what came from the network at a time [s]."""
        if self.silent or now < self._up:
            return
        beacon = decode_beacon(datagram, self._mac, self._challenge)
        if beacon is None or beacon.unit != self.key.number:
            return
        if self._session is None:
            self._session, self._nonce = session_mac(self._mac, self._challenge, beacon.nonce), beacon.nonce
        elif beacon.nonce != self._nonce or beacon.number <= self._beacon:
            return
        self._beacon, self._beacon_time = beacon.number, now

    def tick(self, now: float) -> list[bytes]:
        """Run the unit at a time [s], and return the datagrams to send."""
        while self._next_reboot <= now:
            self.reboot(self._next_reboot)
            self._next_reboot = next(self._reboots, np.inf)
        if now < self._up:
            return []
        if self._session is not None and (now - self._beacon_time > self._params.silence_s or self._sequence == _LAST):
            self._leave()
            self._next_hello = now
        sample = self._cycle(now)
        if self.silent:
            return []
        if self._session is None:
            return self._greet(now)
        if sample is None:
            return []
        self._sequence += 1
        sample.sequence, sample.beacon = self._sequence, self._beacon
        sample.beacon_hold_us = self._since(self._beacon_time, now)
        return [sample.encode(self._session)]

    def _greet(self, now: float) -> list[bytes]:
        if now < self._next_hello:
            return []
        self._next_hello = now + self._params.hello_s * float(self._rng.uniform(0.75, 1.25))
        hello = Hello(self.key.number, FIRMWARE, self._reset, self._challenge, self._own(now))
        return [hello.encode(self._mac)]

    def _own(self, now: float) -> int:
        """Its own clock [us]."""
        return int(1e6 * self._rate * (now - self._began))

    def _since(self, then: float, now: float) -> int:
        """Time since an instant by its own clock [us]."""
        return min(max(0, self._own(now) - self._own(then)), LONGEST_US)

    def _cycle(self, now: float) -> Sample | None:
        """Make the sample that is due, if one is. What it tells is not told again, whether it is sent or not."""
        self._look_at_range(now)
        soon = self._range_new or self._touch_new
        if now < self._sampled + (self._params.shortest_s if soon else self._params.longest_s):
            return None
        self._sampled = now
        flags = Flag.RANGE_NEW if self._range_new else Flag(0)
        period = _RANGE_PERIOD_S if self._zones == 1 else _FRAME_PERIOD_S
        if self._range and now - self._range[0].time > 2 * period:
            flags |= Flag.RANGE_LATE
        if self._fifo_lost:
            flags |= Flag.IMU_LOST
        touch = self._touch_part(now)
        if touch:
            flags |= Flag.TOUCH
        zones = self._zones_part()
        if zones:
            flags |= Flag.ZONES
        self._range_new, self._touch_new, self._fifo_lost = False, False, False
        first, count = self._fifo_first, min(len(self._fifo), IMU_MOST)
        imu = [self._fifo.popleft() for _ in range(count)]
        self._fifo_first += count
        zone = min(self._range, key=lambda one: (one.status not in _SHOWS, one.distance), default=_nothing(now))
        return Sample(
            unit=self.key.number, flags=int(flags), sequence=0, time_us=self._own(now), beacon=0, beacon_hold_us=0,
            battery_mv=_BATTERY_MV, temperature_cdeg=_TEMPERATURE_CDEG, bus_errors=0, range_stream=self._stream,
            range_status=zone.status, range_mm=_field(zone.distance, 1e3), range_age_us=self._since(zone.time, now),
            range_sigma=_field(zone.sigma, 4e3), range_signal=0, range_ambient=_field(zone.ambient, 128.0),
            range_spads=0,
            imu_count=count, imu_scale=self._imu_scale, imu_rate_hz=self._imu_rate, imu_index=first,
            imu_age_us=self._since(imu[-1].time, now) if imu else 0,
            imu=b"".join(IMU_SAMPLE.pack(*sample.counts) for sample in imu), touch=touch, zones=zones,
        )  # fmt: skip


_SHOWS = [RangeStatus[name] for name in ("OK", "NO_WRAP_CHECK", "MERGED", "MIN_RANGE", "MIN_CLIPPED")]
"""Statuses with a target."""


def _nothing(time: float) -> RangeSample:
    return RangeSample(0, time, 0.0, RangeStatus.NONE, 0.0, 0.0)


def _field(value: float, units: float) -> int:
    """Number of units in a value, as 16 bits hold it."""
    return min(max(0, round(units * value)), 0xFFFF)
