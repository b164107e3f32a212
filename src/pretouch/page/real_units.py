"""Real sensor units on a simulated arm: their readings, in the time of the simulation."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pretouch.ports import touch_of
from pretouch.types import FloatArray, RangeReadings, TouchReadings

if TYPE_CHECKING:  # a simulated arm without real units needs no network
    from pretouch.units.skin import NetworkSkin


class _Stamps(NamedTuple):
    """Stamps (K,) of the newest readings [s]."""

    source: FloatArray
    simulated: FloatArray


class RealUnits:
    """The port `SkinPort` of a simulated arm that carries real units.

    A reading that comes is as old in the simulation as it is in the room; from then on it ages with the simulation.
    """

    def __init__(self, source: "NetworkSkin", clock: Callable[[], float] = time.monotonic) -> None:
        """Take where readings come from, and the clock of their stamps."""
        self.source, self._clock = source, clock
        self._simulated: Callable[[], float] = lambda: 0.0
        count = len(source.read().stamp)
        self._ranges, self._touches = (_Stamps(np.full(count, -np.inf), np.full(count, -np.inf)) for _ in range(2))

    def begin(self, simulated: Callable[[], float]) -> None:
        """Go by another simulation's time [s]; what was measured before stays as old as it is."""
        self._simulated = simulated
        for stamps in (self._ranges, self._touches):
            stamps.source[:] = stamps.simulated[:] = -np.inf

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit, stamped in the simulation's time."""
        readings = self.source.read()
        return RangeReadings(self._moved(self._ranges, readings.stamp), readings.distance, readings.status)

    def touch(self) -> TouchReadings | None:
        """Return the newest touch reading of each unit, stamped as ranges are; None while none is known."""
        touch = touch_of(self.source)
        return None if touch is None else replace(touch, stamp=self._moved(self._touches, touch.stamp))

    def _moved(self, before: "_Stamps", stamp: FloatArray) -> FloatArray:
        """Return stamps (K,) [s] of the machine's clock on the simulation's; those that are not new keep theirs."""
        fresh = stamp > before.source
        before.source[fresh] = stamp[fresh]
        ahead = self._simulated() - self._clock()
        before.simulated[fresh] = np.maximum(before.simulated[fresh], stamp[fresh] + ahead)
        return before.simulated.copy()
