"""Times of an IMU's samples, from the numbers and ages that came with them.

A datagram tells the number of its first sample, how many there are, and how old the newest is by the unit's clock. The
sensor's own oscillator, some per cent off its nominal rate, makes the samples; the unit's crystal, some millionths off,
tells the ages; the receiver brackets the offset between the unit's clock and its own. Each is steady, so that the
ages' jitter averages out: within ten seconds the unit's time is a straight line over the samples' numbers, and within a
run the offset one over the unit's time.
"""

from collections.abc import Iterator

import numpy as np

from pretouch.traces import ImuTrace
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

_STEADY_S = 10.0
"""Time over which the sensor's rate is taken as constant [s]; it changes by 0.1 % in half a minute of warming up."""
_SHORTEST_S, _FEWEST, _DRIFT_TOLD_S = 1.0, 5, 10.0
"""Least time [s] and number of datagrams for a rate, and least time for a drift that the offset's errors do not
hide [s]."""
_GAP_S = 0.5
"""A unit from which nothing came for so long may have lost samples itself [s]: it counts them by the nominal rate."""
_DRIFT, _SLACK_S = 2e-4, 1e-3
"""Offsets of one clock that differ by more than their bounds, this fraction of the time between, and this [s], are of
two."""
_OVERTAKEN = 64 * 32
"""A datagram is overtaken by fewer samples than these; an index further back began anew."""
_AGE_ERROR = 0.04
"""An age is off by up to this part of itself: a unit counts the samples it left waiting at the nominal rate."""
_ROUNDS = 12
_UNKNOWN_US = 2**32 - 1
"""An age that tells nothing [us]."""


@value
class ImuCounters:
    """Counters that date IMU samples: B batches of one unit, in the order of their arrival."""

    index: IntArray
    """(B,) number of the first sample of each since the unit's reset."""
    count: IntArray
    """(B,) how many samples each has."""
    time_us: IntArray
    """(B,) unit's clock when the datagram was made [us]."""
    imu_age_us: IntArray
    """(B,) from the newest sample to `time_us` [us]."""
    offset: FloatArray
    """(B,) the receiver's time minus the unit's [s]; NaN while that was not known."""
    bound: FloatArray
    """(B,) most the true offset differs from it [s]."""


def instants(batches: ImuCounters) -> FloatArray:
    """Find when the samples of one unit were taken, by the receiver's clock; returns (M,) [s], M the sum of `count`.

    Lost batches, overtaken ones and units that boot are dealt with. Where the clock is not known, or was heard for less
    than a second, instants are NaN.
    """
    count, offset, bound = batches.count.astype(np.int64), batches.offset, batches.bound
    newest, age = batches.index.astype(np.int64) + count - 1, 1e-6 * batches.imu_age_us
    unit, end = 1e-6 * batches.time_us - age, np.cumsum(count)
    instant = np.full(int(count.sum()), np.nan)
    dated = (count > 0) & (batches.imu_age_us < _UNKNOWN_US) & np.isfinite(offset) & np.isfinite(bound)
    for clock in _clocks(np.flatnonzero(dated), newest, unit, offset, bound):
        ahead = _offset(unit[clock], offset[clock], np.maximum(bound[clock], 1e-6))
        for piece in _pieces(clock, newest, unit):
            rough = np.ptp(unit[piece]) / np.ptp(newest[piece])
            line = _line(newest[piece], unit[piece], 0.3 * rough + _AGE_ERROR * age[piece])
            for batch in piece:
                own = np.polyval(line, np.arange(newest[batch] - count[batch], newest[batch]) + 1.0)
                instant[end[batch] - count[batch] : end[batch]] = own + np.polyval(ahead, own)
    return instant


def by_time(imu: ImuTrace) -> ImuTrace:
    """Return samples by time; without those whose stamps are NaN."""
    order = np.argsort(imu.stamp, kind="stable")[: np.count_nonzero(np.isfinite(imu.stamp))]
    return ImuTrace(imu.stamp[order], imu.acceleration[order], imu.angular_velocity[order])


def _clocks(
    batches: IntArray, newest: IntArray, unit: FloatArray, offset: FloatArray, bound: FloatArray
) -> Iterator[IntArray]:
    """Yield the batches of each clock, and of each count of samples, in the order in which they were measured."""
    if not len(batches):
        return
    before, after = batches[:-1], batches[1:]
    apart = bound[after] + bound[before] + _SLACK_S + _DRIFT * np.abs(unit[after] - unit[before])
    anew = (np.abs(offset[after] - offset[before]) > apart) | (newest[after] - newest[before] < -_OVERTAKEN)
    for part in np.split(batches, np.flatnonzero(anew) + 1):
        yield part[np.argsort(newest[part], kind="stable")]


def _pieces(clock: IntArray, newest: IntArray, unit: FloatArray) -> Iterator[IntArray]:
    """Yield batches of one clock that one line will do for: steady, and long enough to tell a rate."""
    for part in np.split(clock, np.flatnonzero(np.diff(unit[clock]) > _GAP_S) + 1):
        if len(part) > _FEWEST and np.ptp(unit[part]) >= _SHORTEST_S:
            for piece in np.array_split(part, max(1, round(float(np.ptp(unit[part])) / _STEADY_S))):
                if len(piece) > 1 and np.ptp(newest[piece]) and np.ptp(unit[piece]):
                    yield piece


def _offset(unit: FloatArray, offset: FloatArray, bound: FloatArray) -> FloatArray:
    """Return the line (2,) of the receiver's time minus the unit's [s] over the unit's time, as `polyval` takes it."""
    if np.ptp(unit) >= _DRIFT_TOLD_S:
        return _line(unit, offset, bound)
    return np.array([0.0, np.median(offset[bound <= 1.1 * bound.min()])])


def _line(x: FloatArray | IntArray, y: FloatArray, sigma: FloatArray) -> FloatArray:
    """Fit a line to points (B,) of standard deviations (B,), as `polyval` takes it (2,); outliers count little."""
    belief, middle = np.ones(len(x)), float(np.mean(x))
    for _ in range(_ROUNDS):
        weight = belief / sigma**2
        dx, dy = x - np.average(x, weights=weight), y - np.average(y, weights=weight)
        slope = float(np.sum(weight * dx * dy) / np.sum(weight * dx**2))
        error = np.abs(dy - slope * dx) / sigma
        # of normal errors, half are within 1 / 1.4826 standard deviations
        belief = np.minimum(1.0, 1.5 * max(1.4826 * float(np.median(error)), 1e-9) / np.maximum(error, 1e-12))
    return np.array([slope, float(np.average(y - slope * (x - middle), weights=weight)) - slope * middle])
