"""Time of a unit: wrapping ticks [us] for what is near, microseconds since it began to serve for the wire."""


class Clock:
    """Microseconds that never wrap, made of ticks that do (every 2**30 us on an ESP8266).

    `source` is MicroPython's module `time`, or what stands for it. Ticks of one moment may only be compared with those
    of a moment less than half a wrap (9 minutes) away.
    """

    def __init__(self, source):
        self.ticks = source.ticks_us
        self.add = source.ticks_add
        self.diff = source.ticks_diff
        self._last = self.ticks()
        self._total = 0

    def us(self, ticks):
        """Time of these ticks since the clock was made [us]; to be asked at least every 9 minutes."""
        self._total += self.diff(ticks, self._last)
        self._last = ticks
        return self._total
