"""A range finder that repeats itself to the last digit does not measure: its noise alone changes the last digit."""

import math

from pretouch.hardware.wire import Flag, Sample

_LEAST = 10
"""Readings that must be alike; fewer may be so by chance."""
_NEW = int(Flag.RANGE_NEW)


class StuckDetector:
    """Watches the readings of one unit."""

    def __init__(self, after: float) -> None:
        """Call a unit stuck whose readings are alike for so long [s]."""
        self._after = after
        self.stuck = False
        self._values: tuple[int, ...] = ()
        self._alikes, self._values_since = 0, math.inf
        self.forget_stream()

    def forget_stream(self) -> None:
        """Let the count of measurements begin anew, as after a reboot; values that were alike still are."""
        self._stream, self._streams, self._stream_since = -1, 0, math.inf

    def heard(self, sample: Sample, now: float) -> bool:
        """Take in a sample newer than those before, that arrived at this instant [s]; return whether it is stuck."""
        if not sample.flags & _NEW:
            return self.stuck
        if sample.range_stream != self._stream:
            self._stream, self._streams, self._stream_since = sample.range_stream, 0, now
        values = (
            sample.range_mm,
            sample.range_sigma,
            sample.range_signal,
            sample.range_ambient,
            sample.range_spads,
        )
        if values != self._values:
            self._values, self._alikes, self._values_since = values, 0, now
        self._streams += 1
        self._alikes += 1
        self.stuck = (self._streams >= _LEAST and now - self._stream_since >= self._after) or (
            self._alikes >= _LEAST and now - self._values_since >= self._after
        )
        return self.stuck
