"""When the samples of an IMU were taken, from the numbers and ages that came with them.

A datagram tells the number of its first sample, how many there are, and how old the newest is by the unit's clock. The
sensor's own oscillator, some per cent off its nominal rate, makes the samples; the unit's crystal, some millionths off,
tells the ages; the receiver brackets the offset between the unit's clock and its own. Each is steady, so that the
ages' jitter averages out: the unit's time is a slowly bending line over the samples' numbers, and the offset one over
the unit's time.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import sparse
from scipy.sparse.linalg import spsolve

from pretouch.errors import ParameterError
from pretouch.traces import ImuTrace
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

_RATE_BEND_S, _OFFSET_BEND_S = 10.0, 60.0
"""Time over which the sensor's rate, and the drift between the clocks, are taken as constant [s]."""
_SHORTEST_S, _DRIFT_TOLD_S = 1.0, 10.0
"""A clock that was heard for less time tells no rate, and no drift that its offset's errors would not hide [s]."""
_DRIFT, _SLACK_S = 2e-4, 1e-3
"""Offsets of one clock that differ by more than their bounds, this fraction of the time between, and this [s], are of
two."""
_OVERTAKEN = 64 * 32
"""A datagram is overtaken by fewer samples than these; an index further back began anew."""
_FEW, _APART = 5, 50
"""Batches of which the median is taken where samples may be miscounted, and whose distance tells the rate."""
_AGE_ERROR = 0.04
"""An age is off by up to this part of itself: a unit counts the samples it left waiting at the nominal rate."""
_ROUNDS = 12
_SPARSE = 100
"""Stamps that span more than this many times the time their samples take are not all of one clock."""
_WRAP, _LONGEST_US = 2**32, 2**32 - 1
"""Where an index begins anew by itself, and an age that tells nothing [us]."""


@value
class Instants:
    """When samples were taken. M of them, in the order of the batches they came in."""

    instant: FloatArray
    """(M,) receiver's time [s]; NaN where it is not known."""
    rate: float
    """Mean rate of the sensor by the receiver's clock [Hz]; NaN if nothing tells it."""
    jitter: float
    """Standard deviation of the batches' own stamps about these [s]."""


@dataclass(frozen=True, eq=False)
class _Line:
    """A line (x, y) that bends at even steps only."""

    x: FloatArray
    y: FloatArray

    def __call__(self, x: FloatArray) -> FloatArray:
        """Return the line there (...,); beyond its ends it goes on straight."""
        at = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 2)
        slope = np.diff(self.y) / np.diff(self.x)
        return self.y[at] + slope[at] * (x - self.x[at])


@dataclass(frozen=True, eq=False)
class _Clock:
    """What was heard of a unit while its clock ran on, in the order in which it was measured. B batches."""

    batch: IntArray
    """(B,) which of the batches given these are."""
    count: IntArray
    """(B,) samples in each."""
    newest: IntArray
    """(B,) number of the newest sample of each, not wrapped."""
    unit: FloatArray
    """(B,) when that was taken, unit's time [s]."""
    age: FloatArray
    """(B,) how long that was before the datagram was made [s]."""
    offset: FloatArray
    """(B,) the receiver's time minus the unit's [s]."""
    bound: FloatArray
    """(B,) most that is off by [s]."""


def instants(
    index: IntArray, count: IntArray, time_us: IntArray, imu_age_us: IntArray, offset: FloatArray, bound: FloatArray
) -> Instants:
    """Find when the IMU samples of one unit were taken, from B batches in the order in which they came.

    A unit that begins anew half-way, datagrams that are lost or overtake each other, and an index that wraps at 2^32
    are dealt with. Where the clock is not known, or was heard for less than a second, instants are NaN.

    Args:
        index: (B,) number of the first sample of each since the unit's reset.
        count: (B,) how many samples each has.
        time_us: (B,) unit's clock when the datagram was made [us].
        imu_age_us: (B,) from the newest sample to `time_us` [us].
        offset: (B,) the receiver's time minus the unit's [s]; NaN while that is not known.
        bound: (B,) most the true offset differs from it [s].

    Raises:
        ParameterError: the arrays are not of one length.
    """
    lengths = {len(a) for a in (index, count, time_us, imu_age_us, offset, bound)}
    if len(lengths) > 1:
        raise ParameterError(f"The batches' arrays have {sorted(lengths)} numbers: give one of each for each batch.")
    count = np.asarray(count, dtype=np.int64)
    begins = np.cumsum(count) - count
    instant = np.full(int(count.sum()), np.nan)
    samples = duration = 0.0
    residuals = [np.zeros(0)]
    for clock in _clocks(index, count, time_us, imu_age_us, offset, bound):
        newest, period = _recounted(clock)
        if period <= 0 or not np.ptp(newest):
            continue
        unit = _fitted(newest, clock.unit, 0.3 * period + _AGE_ERROR * clock.age, _RATE_BEND_S / period)
        ahead = _ahead(clock)
        when = unit(_each(newest - clock.count + 1, clock.count).astype(np.float64))
        when += ahead(when)
        instant[_each(begins[clock.batch], clock.count)] = when
        samples += float(newest[-1] - newest[0])
        duration += float(when[-1] - when[clock.count[0] - 1])
        residuals.append(clock.unit - unit(newest.astype(np.float64)))
    if not duration:
        return Instants(instant, np.nan, np.nan)
    return Instants(instant, samples / duration, _spread(np.concatenate(residuals)))


def retimed(imu: ImuTrace, instant: FloatArray) -> ImuTrace:
    """Return samples at instants (M,) [s] found for them, by time; without those whose instants are not known."""
    order = np.argsort(instant, kind="stable")[: np.count_nonzero(np.isfinite(instant))]
    return ImuTrace(instant[order], imu.acceleration[order], imu.angular_velocity[order])


def median_period(stamp: FloatArray) -> float:
    """Return the median time between stamps (M,), two at least [s]."""
    return float(np.median(np.diff(stamp)))


def of_several_clocks(stamp: FloatArray) -> bool:
    """Tell whether stamps (M,), two at least, are spread over far more time than so many samples take [s]."""
    return float(np.ptp(stamp)) > _SPARSE * median_period(stamp) * len(stamp)


def _each(first: IntArray, count: IntArray) -> IntArray:
    """Return the whole numbers from each first one on, so many of each, one after the other."""
    return np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count)


def _clocks(
    index: IntArray, count: IntArray, time_us: IntArray, imu_age_us: IntArray, offset: FloatArray, bound: FloatArray
) -> Iterator[_Clock]:
    """Yield what was heard of each clock for long enough to tell a rate."""
    known = np.flatnonzero((count > 0) & (imu_age_us < _LONGEST_US) & np.isfinite(offset) & np.isfinite(bound))
    count, offset, bound = count[known], offset[known], bound[known]
    age: FloatArray = 1e-6 * imu_age_us[known].astype(np.float64)
    unit = 1e-6 * time_us[known] - age
    first = index[known].astype(np.int64)
    step = (np.diff(first) + _WRAP // 2) % _WRAP - _WRAP // 2
    apart = bound[1:] + bound[:-1] + _SLACK_S + _DRIFT * np.abs(np.diff(unit))
    anew = (np.abs(np.diff(offset)) > apart) | (step < -_OVERTAKEN)
    newest = np.concatenate([first[:1], step]).cumsum() + count - 1
    for which in np.split(np.arange(len(known)), np.flatnonzero(anew) + 1):
        i = which[np.argsort(newest[which], kind="stable")]
        if len(i) > _FEW and np.ptp(unit[i]) >= _SHORTEST_S and np.ptp(newest[i]):
            yield _Clock(known[i], count[i], newest[i], unit[i], age[i], offset[i], bound[i])


def _recounted(clock: _Clock) -> tuple[IntArray, float]:
    """Return the numbers (B,) of the newest samples as they must have been, and the rough period [s].

    What a unit itself lost it counts by the nominal rate; its own clock tells how many samples that was.
    """
    newest, unit, apart = clock.newest, clock.unit, min(_APART, len(clock.unit) - 1)
    numbers = np.maximum(newest[apart:] - newest[:-apart], 1)
    period = float(np.median((unit[apart:] - unit[:-apart]) / numbers))
    late = unit - period * newest
    median = np.median(sliding_window_view(np.pad(late, _FEW, mode="edge"), _FEW), axis=-1)
    jump = median[_FEW + 1 : len(late) + _FEW] - median[1 : len(late)]
    step = np.abs(np.diff(late))
    missing = newest[1:] - clock.count[1:] != newest[:-1]
    step *= missing & (np.abs(jump) > 1.5 * period)
    largest = sliding_window_view(np.pad(step, _FEW), 2 * _FEW + 1).max(axis=-1)
    more = np.where((step > 0) & (step == largest), np.round(jump / period), 0.0).astype(np.int64)
    return newest + np.concatenate([[0], np.cumsum(more)]), period


def _ahead(clock: _Clock) -> _Line:
    """Fit the receiver's time minus the unit's [s] over the unit's time."""
    if np.ptp(clock.unit) >= _DRIFT_TOLD_S:
        return _fitted(clock.unit, clock.offset, np.maximum(clock.bound, 1e-6), _OFFSET_BEND_S)
    best = float(np.median(clock.offset[clock.bound <= 1.1 * clock.bound.min()]))
    return _Line(np.array([0.0, 1.0]), np.full(2, best))


def _fitted(x: FloatArray | IntArray, y: FloatArray, sigma: FloatArray, bend: float) -> _Line:
    """Fit a line to points (B,) of standard deviations (B,) that bends about each `bend`; outliers count little.

    Where there is no point it goes straight on.
    """
    x = np.asarray(x, dtype=np.float64)
    pieces = max(1, round(float(np.ptp(x)) / bend))
    knots = np.linspace(x.min(), x.max(), pieces + 1)
    at = np.minimum(((x - knots[0]) / (knots[1] - knots[0])).astype(np.int64), pieces - 1)
    share = (x - knots[at]) / (knots[1] - knots[0])
    points, weight = np.arange(len(x)), 1.0 / sigma
    hats = sparse.csr_array(
        (np.concatenate([1.0 - share, share]), (np.tile(points, 2), np.concatenate([at, at + 1]))),
        shape=(len(x), pieces + 1),
    )
    bending = sparse.diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(max(pieces - 1, 0), pieces + 1))
    stiffness = np.median(weight) ** 2 * bending.T @ bending
    straight = np.polyfit(x - x.mean(), y, 1)
    center = y - np.polyval(straight, x - x.mean())
    belief = np.ones(len(x))
    for _ in range(_ROUNDS):
        scaled = hats.multiply((belief * weight**2)[:, None]).tocsr()
        found = spsolve((hats.T @ scaled + stiffness).tocsc(), scaled.T @ center)
        error = np.abs(center - hats @ found) * weight
        belief = np.minimum(1.0, 1.5 * max(_spread(error), 1e-9) / np.maximum(error, 1e-12))
    return _Line(knots, found + np.polyval(straight, knots - x.mean()))


def _spread(residuals: FloatArray) -> float:
    """Standard deviation of residuals about zero, whatever outliers there are."""
    return 1.4826 * float(np.median(np.abs(residuals)))
