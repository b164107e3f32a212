"""A simulated arm and its units moved on as real time passes."""

import time
from typing import TypeVar

from pretouch.sim.imu import ImuSample
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeSample
from pretouch.sim.touch_sensor import TouchSample
from pretouch.units.fleet import Fleet

_SLICE_S = 0.002
"""The simulation moves on by so much at once [s]: how late a datagram may leave."""
LATE_S = 0.1
"""A machine that is later than this leaves the time out [s]: until then it makes up for it."""

Measured = TypeVar("Measured", RangeSample, ImuSample, TouchSample)


class RealTime:
    """The port `Clock`: moves arm and units on as real time passes. Its ticks are of the simulated time."""

    def __init__(self, plant: Plant, period: float) -> None:
        """Take the arm, and the control period [s]."""
        self._plant, self._slices = plant, max(1, round(period / _SLICE_S))
        self._slice = period / self._slices
        self._fleet: Fleet | None = None
        self._start = self._next = 0.0
        self._plant_start = float("inf")
        self.now = 0.0
        """Real time since the start [s]: the units' time."""
        self.left_out = 0.0
        """Time that the machine was too slow to simulate [s]."""

    def begin(self, fleet: Fleet) -> None:
        """Let the time of arm and units begin."""
        self._fleet, self._start, self._plant_start = fleet, time.monotonic(), self._plant.time
        self._next = self._start

    def tick(self) -> float:
        """Wait for the next control period and return the simulated time [s]."""
        for _ in range(self._slices):
            self._next += self._slice
            wait = self._next - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            elif wait < -LATE_S:
                self._next -= wait
                self.left_out -= wait
            self._look()
            self._plant.advance(self._slice)
            if self._fleet:
                self._fleet.step(self._look)
        return self._plant.time

    def _look(self) -> float:
        self.now = time.monotonic() - self._start
        return self.now

    def real(self, sample: Measured) -> Measured:
        """Return a measurement with its instant in real time since the start."""
        return sample._replace(time=self._since(sample.time))

    def monotonic(self, simulated: float) -> float:
        """Return an instant of the simulated time by this machine's monotonic clock [s]."""
        return self._start + self._since(simulated)

    def _since(self, simulated: float) -> float:
        """Real time since the start [s]; what was before it counts as being at the start.

        It is when the simulation was due to be there, not when a late machine was, so that time flows evenly.
        """
        return max(0.0, simulated - self._plant_start) + self.left_out
