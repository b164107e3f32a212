"""Health of a sensor unit: numbers from the datagrams of the last seconds."""

import math
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pretouch.checks import Checked, Fraction, Positive, PositiveCount
from pretouch.types import FloatArray, RangeStatus, TouchStatus
from pretouch.units.unit import Received, UnitTraffic
from pretouch.units.wire import NO_TEMPERATURE, Flag, Sample, touch_part


@dataclass(frozen=True)
class HealthParams(Checked):
    """Limits of a unit's health: beyond them there is a warning or a fault."""

    window_s: Positive = 10.0
    """Time over which everything is counted [s]: some 500 samples; as long as a bound on the unit's clock counts."""
    settle_s: Positive = 2.0
    """Time from a unit's first sample on during which its rates and its clock are not judged [s]: about a hundred
    samples and eight beacons. Also how long its clock may be unknown."""
    silent_s: Positive = 0.3
    """Time without a sample from which a unit is silent [s]: the arm holds then (`silent_after_s` of a profile)."""
    rate_hz: Positive = 34.0
    """Fewest readings a second [Hz]: with fewer, one lost reading leaves a sensed point without any for longer than it
    is kept (`persistence_s` of a profile, 0.06 s). Not judged while the window holds a silence or a reboot."""
    rate_fault_hz: Positive = 10.0
    """Fewest readings a second that can be worked with [Hz]: at an age of 0.1 s the arm begins to slow."""
    loss: Fraction = 0.15
    """Largest share of samples lost on their way: the static experiment is shown to bear 10 %, and of 500 samples at
    10 % hardly ever more than 14 % are lost (three standard deviations)."""
    loss_fault: Fraction = 0.3
    """Largest share of lost samples that experiments covered."""
    latency_s: Positive = 0.08
    """Largest median time from a measurement to its arrival [s]: a hand at 1.6 m/s comes 13 cm nearer in it. Of 4 x 4
    zones it begins with 34 ms, before they are sent."""
    latency_late_s: Positive = 0.1
    """Largest time of all but one in twenty [s]: at that age of a reading the arm begins to slow. Single late ones are
    used with their age, and no reason for concern."""
    bound_s: Positive = 0.01
    """Largest doubt about the unit's clock [s]: a reading is taken as older by up to twice this. Not judged while the
    window holds a silence or a reboot: a clock that begins anew is not known well yet."""
    sigma_m: Positive = 0.015
    """Largest median standard deviation by the sensor's own estimate [m]: its own limit for status SIGMA."""
    noise_m: Positive = 0.02
    """Largest scatter of successive readings [m]: the data sheet's ranging error in the dark."""
    failed: Fraction = 0.1
    """Largest share of readings whose status says that the sensor failed, rather than that nothing is there."""
    failed_fault: Fraction = 0.5
    """The same share, from which most readings tell nothing."""
    touch_held_s: Positive = 9.0
    """Time for which a unit may say without a break that it is touched [s]: the controller believes it for 10 s."""
    touch_failed: Fraction = 0.1
    """Largest share of touch readings that say the sensor has failed: a lead that works loose."""
    range_late: PositiveCount = 3
    """Samples without a range in time from which the range finder is warned of, within the window."""
    battery_v: Positive = 3.5
    """Least voltage of the battery [V]: a lithium cell has about a tenth of its charge left."""
    battery_fault_v: Positive = 3.3
    """Voltage below which the regulator can no longer hold the 3.3 V of the unit [V]."""
    temperature_low_c: float = -20.0
    """Least temperature [degrees C]: below it the range finder is not specified."""
    temperature_c: Positive = 60.0
    """Largest temperature [degrees C]: a lithium cell must not be discharged above it."""
    temperature_fault_c: Positive = 85.0
    """Temperature above which range finder and IMU are not specified [degrees C]."""
    bus_errors: PositiveCount = 3
    """Failed transfers on the unit's bus from which its wiring is warned of, within the window."""
    imu_rate_hz: Positive = 375.0
    """Fewest IMU samples a second [Hz]: nine tenths of the 416 Hz that the firmware sets; an impact lasts
    milliseconds."""
    imu_loss: Fraction = 0.02
    """Largest share of IMU samples lost beyond those in lost datagrams: its FIFO ran over."""
    machine_late_s: Positive = 0.5
    """Time within the window by which this machine itself is late [s], from which on it is named in place of what units
    lose and delay: a twentieth of the window, as much as makes a reading of twenty late."""
    reboots: PositiveCount = 1
    """Reboots within the window that are warned of; each is a second of silence."""


_MAD_TO_SIGMA = 1.4826
"""Standard deviation over median absolute deviation, of a normal distribution."""
_NEW, _LATE = int(Flag.RANGE_NEW), int(Flag.RANGE_LATE)
_RESTARTED = int(Flag.RANGE_RESTARTED | Flag.IMU_RESTARTED)
_BUS_ERROR = int(Flag.RANGE_BUS_ERROR | Flag.IMU_BUS_ERROR)
_OK = int(RangeStatus.OK)
_FEW = 5
"""Fewer readings than this tell no noise."""


@dataclass(frozen=True)
class UnitHealth:
    """Health of one unit over the last seconds. NaN where a value is unknown."""

    unit: str
    traffic: UnitTraffic
    heard_s: float
    """Time within the window since its first sample [s]."""
    silent_s: float
    """Time since its last sample [s], infinite before the first."""
    gap_s: float
    """Longest time between two of its samples within the window [s]."""
    rate_hz: float
    """Fresh readings a second [Hz]."""
    loss: float
    """Share of its samples that were lost on their way."""
    latency_s: float
    """Median time from the measurement to its arrival, at most [s]."""
    latency_late_s: float
    """The time that one in twenty of these is over [s]."""
    distance_m: float
    """Newest reading [m], whatever its status."""
    status: int
    """`RangeStatus` of it."""
    sigma_m: float
    """Median standard deviation by the sensor's own estimate, of good readings [m]."""
    noise_m: float
    """Scatter of successive good readings; a steady motion drops out of it [m]."""
    statuses: dict[str, int]
    """Fresh readings by status."""
    battery_v: float
    """[V]"""
    temperature_c: float
    """[degrees C]"""
    bus_errors: int
    """Failed transfers on its bus within the window."""
    restarts: int
    """Number of times that it initialised a sensor again within the window."""
    clock_unknown_s: float
    """Time for which its clock has been unknown, within the window [s]; 0 while it is known."""
    range_late: int
    """Samples that said the range finder was late."""
    imu_rate_hz: float
    """IMU samples a second by its own count [Hz]."""
    imu_loss: float
    """Share of them that its FIFO lost."""
    reboots: int
    """Within the window."""
    clock_jumps: int
    """Within the window."""
    touched: float = math.nan
    """Share of its touch readings with a touch; NaN for a unit without a touch sensor."""
    touch_failed: float = 0.0
    """Share of its touch readings with a failed sensor."""


class Lateness:
    """Delay of this machine within the last seconds: a late machine makes its units seem late."""

    def __init__(self, every: float, length: float) -> None:
        """Take the time between two looks when it is not late, and the length of the window [s]."""
        self._every, self._length = every, length
        self._last, self._left_out = math.inf, 0.0
        self._late: deque[tuple[float, float]] = deque()

    def look(self, now: float, left_out: float = 0.0) -> None:
        """Take note of a look [s], and of the time that a simulation on this machine has left out so far [s]."""
        late = now - self._last - self._every
        late = (late if late > 0.5 * self._every else 0.0) + left_out - self._left_out
        self._last, self._left_out = now, left_out
        if late > 0.0:
            self._late.append((now, late))
        while self._late and self._late[0][0] <= now - self._length:
            self._late.popleft()

    @property
    def total(self) -> float:
        """Return it [s]."""
        return sum(late for _, late in self._late)


class UnitWindow:
    """Datagrams of one unit within the last seconds."""

    def __init__(self, length: float) -> None:
        """Take the window's length [s]."""
        self._length = length
        self._samples: deque[Received] = deque()
        self._counts: deque[tuple[float, UnitTraffic]] = deque()

    def take(self, now: float, samples: Iterable[Received], traffic: UnitTraffic) -> None:
        """Take in the samples since the last call, and the counts of the receiver by now [s]."""
        self._samples.extend(samples)
        self._counts.append((now, replace(traffic)))
        while self._samples and self._samples[0].arrival <= now - self._length:
            self._samples.popleft()
        while len(self._counts) > 1 and self._counts[1][0] <= now - self._length:
            self._counts.popleft()

    def health(self, now: float, traffic: UnitTraffic) -> UnitHealth:
        """Return the health of the unit at an instant [s]."""
        return unit_health(list(self._samples), now, traffic, self._counts[0][1] if self._counts else traffic)


def unit_health(samples: Sequence[Received], now: float, traffic: UnitTraffic, before: UnitTraffic) -> UnitHealth:
    """Compute the health of a unit at an instant [s] from its samples in the window, in the order of their arrival.

    `traffic` are the counts of the receiver by now, `before` those at the begin of the window.
    """
    fresh = [h for h in samples if h.sample.flags & _NEW]
    good = np.array([h.sample.range_mm / 1000 if h.sample.range_status == _OK else np.nan for h in fresh])
    ages = np.array([h.arrival - h.stamp for h in fresh if math.isfinite(h.stamp)])
    sigmas = [h.sample.range_sigma / 4000 for h in fresh if h.sample.range_status == _OK]
    heard_s, clock_unknown_s = now - samples[0].arrival if samples else 0.0, 0.0
    if samples and not math.isfinite(traffic.bound):
        clocked = (h.arrival for h in samples if math.isfinite(h.bound))
        clock_unknown_s = now - max(clocked, default=samples[0].arrival)
    boot = _since_reboot([h.sample for h in samples])
    last = boot[-1] if boot else None
    newest = fresh[-1] if fresh else None
    imu_rate_hz, imu_loss = _imu(boot)
    lost = traffic.lost - before.lost
    sent = traffic.accepted - before.accepted + lost
    flags = [s.flags for s in boot]
    touch = [part for s in boot if (part := touch_part(s)) is not None]
    return UnitHealth(
        unit=traffic.id,
        traffic=traffic,
        heard_s=heard_s,
        silent_s=now - traffic.last_arrival,
        gap_s=max((b - a for a, b in pairwise(sorted(h.arrival for h in samples))), default=0.0),
        rate_hz=len(fresh) / heard_s if heard_s > 0 else math.nan,
        loss=lost / sent if sent else math.nan,
        latency_s=float(np.median(ages)) if len(ages) else math.nan,
        latency_late_s=float(np.percentile(ages, 95)) if len(ages) else math.nan,
        distance_m=newest.sample.range_mm / 1000 if newest else math.nan,
        status=newest.sample.range_status if newest else RangeStatus.NONE,
        sigma_m=float(np.median(sigmas)) if sigmas else math.nan,
        noise_m=noise_of(good),
        statuses={status_name(s): count for s, count in Counter(h.sample.range_status for h in fresh).items()},
        battery_v=last.battery_mv / 1000 if last and last.battery_mv else math.nan,
        temperature_c=last.temperature_cdeg / 100 if last and last.temperature_cdeg != NO_TEMPERATURE else math.nan,
        # its count ends at 65535, its flags do not
        bus_errors=max(last.bus_errors - boot[0].bus_errors, sum(bool(f & _BUS_ERROR) for f in flags)) if last else 0,
        restarts=sum(bool(f & _RESTARTED) for f in flags),
        clock_unknown_s=clock_unknown_s,
        range_late=sum(bool(f & _LATE) for f in flags),
        imu_rate_hz=imu_rate_hz,
        imu_loss=imu_loss,
        reboots=traffic.reboots - before.reboots,
        clock_jumps=traffic.clock_jumps - before.clock_jumps,
        touched=float(np.mean([p.contact != 0 for p in touch])) if touch else math.nan,
        touch_failed=float(np.mean([p.status != TouchStatus.OK for p in touch])) if touch else 0.0,
    )


def status_name(code: int) -> str:
    """Return the name of a `RangeStatus`, or the number of one there is not."""
    return RangeStatus(code).name if code in RangeStatus._value2member_map_ else str(code)


def _since_reboot(samples: Sequence[Sample]) -> list[Sample]:
    """Return the samples after the last one that began a count anew, by the unit's clock."""
    begin = 0
    for i in range(1, len(samples)):
        # out of step by a second or more is no mere reordering
        if samples[i].time_us < samples[i - 1].time_us - 1_000_000:
            begin = i
    return sorted(samples[begin:], key=lambda s: s.time_us)


def _imu(samples: Sequence[Sample]) -> tuple[float, float]:
    """Return rate [Hz] and loss of the IMU samples in datagrams of one boot, by time."""
    full = [s for s in samples if s.imu_count]
    if len(full) < _FEW:
        return (0.0 if len(samples) >= _FEW else math.nan), math.nan
    first, last = full[0], full[-1]
    elapsed = (last.time_us - last.imu_age_us - first.time_us + first.imu_age_us) / 1e6
    counted = last.imu_index + last.imu_count - first.imu_index - first.imu_count
    neighbours = [(a, b) for a, b in pairwise(full) if b.sequence == a.sequence + 1]
    missing = sum(b.imu_index - a.imu_index - a.imu_count for a, b in neighbours)
    if elapsed <= 0 or counted <= 0:
        return math.nan, math.nan
    return counted / elapsed, max(0, missing) / counted


def noise_of(distance: FloatArray) -> float:
    """Noise [m] of successive distances (R,), NaN where there is none: a steady motion drops out of it."""
    bend = np.diff(distance, n=2)
    bend = bend[np.isfinite(bend)]
    if len(bend) < _FEW:
        return math.nan
    # the second difference of independent errors has 1 + 4 + 1 times their variance
    return float(_MAD_TO_SIGMA * np.median(np.abs(bend - np.median(bend))) / math.sqrt(6.0))
