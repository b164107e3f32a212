"""A sensor unit: looks after its sensors and its session, and says what it measured as soon as it has a range."""

import gc

from micropython import const
from wire import Sample

_SHORTEST_US = const(10_000)
_LONGEST_US = const(25_000)
_SLOW = const(50)
_COLLECT = const(5)


class Unit:
    """Call `step` as often as possible. Samples keep pace with the range finder; without it one comes every 25 ms.

    `battery_mv()` returns the battery's voltage [mV], 0 if it cannot be told. `touch` is its touch sensor, if it has
    one: a touch that begins or ends is told as soon as a sample may follow the last one.
    """

    def __init__(self, number, link, range_finder, imu, bus, clock, battery_mv, touch=None):
        self._link = link
        self._range_finder = range_finder
        self._imu = imu
        self._bus = bus
        self._clock = clock
        self._battery_mv = battery_mv
        self._touch = touch
        self._sample = Sample(number, len(range_finder.zones))
        self._cycles = 0
        self._last = clock.ticks()

    def step(self):
        """One pass: beacons, range finder, and a sample when it is due."""
        now = self._clock.ticks()
        self._link.step(now)
        self._range_finder.step(now)
        if self._touch is not None:
            self._touch.step(now)
        if self._due(now):
            self._last = now
            self._cycle(now)

    def _due(self, now):
        waited = self._clock.diff(now, self._last)
        soon = self._range_finder.new or (self._touch is not None and self._touch.new)
        return waited >= _LONGEST_US or (waited >= _SHORTEST_US and soon)

    def _cycle(self, now):
        sample = self._sample
        if self._cycles % _SLOW == 0:
            sample.battery_mv = self._battery_mv()
            self._imu.look_at_temperature()
            self._range_finder.look_at_temperature(self._imu.temperature_cdeg)
        self._cycles += 1
        self._imu.step(sample.imu, now)
        now = self._clock.ticks()
        sample.flags = 0
        self._range_finder.put(sample, now)
        self._imu.put(sample, now)
        if self._touch is not None:
            self._touch.put(sample, now)
        sample.bus_errors = self._bus.errors
        if self._link.live:
            self._link.send(sample, now)
        if self._cycles % _COLLECT == 0:
            gc.collect()
