"""Real sensor units on a simulated arm: their readings, in the time of the simulation."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from pretouch.ports import touch_of
from pretouch.types import RangeReadings, TouchReadings


class UnitSource(Protocol):
    """Where readings of real units come from, stamped by the machine's monotonic clock."""

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit."""
        ...

    @property
    def alive(self) -> bool:
        """Whether anything can come."""
        ...


class RealUnits:
    """The port `Skin` of a simulated arm that carries real units.

    A reading that comes is as old in the simulation as it is in the room; from then on it ages with the simulation.
    """

    def __init__(self, source: UnitSource, clock: Callable[[], float] = time.monotonic) -> None:
        """Take the source, and the clock its stamps come from."""
        self.source, self._clock = source, clock
        self._simulated: Callable[[], float] = lambda: 0.0
        first = source.read()
        self._seen = np.full(len(first.stamp), -np.inf)
        self._stamp = self._seen.copy()
        self._touch_seen, self._touch_stamp = self._seen.copy(), self._seen.copy()

    def begin(self, simulated: Callable[[], float]) -> None:
        """Go by another simulation's time [s]; what was measured before stays as old as it is."""
        self._simulated = simulated
        self._seen[:] = self._stamp[:] = -np.inf
        self._touch_seen[:] = self._touch_stamp[:] = -np.inf

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit, stamped in the simulation's time."""
        readings = self.source.read()
        fresh = readings.stamp > self._seen
        self._seen[fresh] = readings.stamp[fresh]
        self._stamp[fresh] = np.maximum(self._stamp[fresh], readings.stamp[fresh] + self._ahead())
        return RangeReadings(self._stamp.copy(), readings.distance, readings.status)

    def touch(self) -> TouchReadings | None:
        """Return the newest touch reading of each unit, stamped as ranges are; None while none is known."""
        touch = touch_of(self.source)
        if touch is None:
            return None
        fresh = touch.stamp > self._touch_seen
        self._touch_seen[fresh] = touch.stamp[fresh]
        self._touch_stamp[fresh] = np.maximum(self._touch_stamp[fresh], touch.stamp[fresh] + self._ahead())
        return replace(touch, stamp=self._touch_stamp.copy())

    def _ahead(self) -> float:
        """By how much the simulation's clock is ahead of the machine's [s]."""
        return self._simulated() - self._clock()
