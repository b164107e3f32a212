"""Offset of a unit's clock from the host's, as bounds that hold whatever the network does.

A beacon sent at t1 [host] is heard at t2 [unit], not before it was sent: offset >= t1 - t2. A sample made at t3 [unit]
arrives at t4 [host], not before it was made: offset <= t4 - t3. Late packets make the bounds loose, never wrong.
Between two instants of the unit's clock the offset changes by no more than the drift times the time between them, so
that older bounds count too, each loosened by its age. Nothing is assumed of the delays, nor that they are alike both
ways.
"""

import math
from collections import deque

TICK = 1e-6
"""Resolution of the unit's clock [s]: it shows an instant up to this much too early."""
_MOST = 1024
"""Bounds of each kind that are kept at most: a unit that sends a hundred a second fills its window with a thousand."""


class UnitClock:
    """Offset of one unit's clock, host time = unit time + offset, from its echoes. Times in seconds."""

    def __init__(self, drift: float, window: float) -> None:
        """Begin without bounds.

        Args:
            drift: largest difference in rate between host and unit, as a fraction.
            window: how long a bound counts [s].
        """
        self.jumps = 0
        """Number of contradictions of the bounds: the unit's clock jumped, or drifts more than it should."""
        self._drift, self._window = drift, window
        # (instant, bound as of instant 0): all loosen at one rate, so that their order never changes
        self._lows: deque[tuple[float, float]] = deque(maxlen=_MOST)
        self._highs: deque[tuple[float, float]] = deque(maxlen=_MOST)
        self._newest = -math.inf
        self.low = -math.inf
        """Least offset there can be, as of the newest sample [s]."""
        self.high = math.inf
        """Largest offset there can be, as of the newest sample [s]."""
        self.bounded = False
        """True if both bounds are there."""
        self.last_reading = -math.inf
        """Instant of the newest reading that was stamped [s], unit's clock."""
        self._last_stamp = -math.inf

    @property
    def offset(self) -> float:
        """Middle of the bounds [s]; NaN while one is missing."""
        return 0.5 * (self.low + self.high) if self.bounded else math.nan

    @property
    def bound(self) -> float:
        """Most the true offset can differ from `offset` [s]."""
        return 0.5 * (self.high - self.low)

    def update(self, sampled: float, arrival: float, sent: float | None, hold: float) -> bool:
        """Take in a sample; return False if it contradicts the bounds, which are then reset.

        Args:
            sampled: time of the sample [s], unit's clock.
            arrival: time of its arrival, or later [s], host's clock.
            sent: time at which the echoed beacon was sent, or earlier [s], host's clock; None if unknown.
            hold: time since the unit received that beacon [s].
        """
        newest = self._newest = max(self._newest, sampled)
        _insert(self._highs, sampled, self._drift * sampled - (arrival - sampled))
        if sent is not None:
            echoed = sampled - hold
            _insert(self._lows, echoed, sent - echoed - TICK + self._drift * echoed)
        self.high = self._drift * newest - self._highs[0][1]
        if not self._lows:
            _expire(self._highs, newest - self._window)
            return True
        self.low = self._lows[0][1] - self._drift * newest
        if self.low <= self.high:
            self.bounded = True
            _expire(self._lows, newest - self._window)
            _expire(self._highs, newest - self._window)
            return True
        self.jumps += 1
        self.forget()
        return False

    def forget(self) -> None:
        """Reset the bounds; the counts stay."""
        self._lows.clear()
        self._highs.clear()
        self._newest, self.low, self.high, self.bounded = -math.inf, -math.inf, math.inf, False
        self.last_reading = self._last_stamp = -math.inf

    def earliest(self, instant: float) -> float:
        """Return the earliest host time that an instant of the unit, not after its newest sample, can be [s].

        -inf while that is not known.
        """
        return instant - TICK + self.low - self._drift * (self._newest - instant)

    def stamp(self, instant: float) -> float:
        """Return the earliest host time that a reading of an instant of the unit can be of [s]; -inf while not known.

        Readings are stamped in their order: what was known of the newest one holds for those after it too, so that
        bounds which grow worse hold none of them back.
        """
        stamp = self.earliest(instant)
        if instant <= self.last_reading:
            return stamp
        if self._last_stamp > -math.inf:
            by_the_last = self._last_stamp + (1.0 - self._drift) * (instant - self.last_reading)
            # not later than it can be: the clock may have jumped by less than could be seen
            stamp = min(max(stamp, by_the_last), instant + self.high)
        self.last_reading, self._last_stamp = instant, stamp
        return stamp


def _insert(bounds: deque[tuple[float, float]], instant: float, bound: float) -> None:
    """Add a bound, and drop those that will never again be the largest; the first is the largest."""
    while bounds and bounds[-1][1] <= bound:
        bounds.pop()
    bounds.append((instant, bound))


def _expire(bounds: deque[tuple[float, float]], oldest: float) -> None:
    """Drop the bounds that are too old, but for the last one."""
    while bounds[0][0] < oldest and len(bounds) > 1:
        bounds.popleft()
