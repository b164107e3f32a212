"""Real sensor units on a simulated arm: their readings, in the time of the simulation."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from pretouch.hardware.receiver_process import Traffic
from pretouch.hardware.traffic import ImuBatch, Received
from pretouch.ports import touch_of
from pretouch.types import RangeReadings, TouchReadings

_STEADY_S = 0.05
"""Difference between the two clocks up to which IMU samples keep their spacing [s]: a page advances in steps."""


class UnitSource(Protocol):
    """Where readings of real units come from, stamped by the machine's monotonic clock."""

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit."""
        ...

    def take_imu(self) -> list[ImuBatch]:
        """Return what the units' IMUs measured since the last call."""
        ...

    def take_samples(self) -> list[Received]:
        """Return what came of the units since the last call."""
        ...

    def traffic(self) -> Traffic:
        """Return what was counted of each unit."""
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
        self._imu_ahead = 0.0
        first = source.read()
        self._seen = np.full(len(first.stamp), -np.inf)
        self._stamp, self._last_imu = self._seen.copy(), self._seen.copy()
        self._touch_seen, self._touch_stamp = self._seen.copy(), self._seen.copy()

    def begin(self, simulated: Callable[[], float]) -> None:
        """Go by another simulation's time [s]; what was measured before stays as old as it is."""
        self._simulated = simulated
        self._seen[:] = self._stamp[:] = self._last_imu[:] = -np.inf
        self._touch_seen[:] = self._touch_stamp[:] = -np.inf
        self._imu_ahead = self._ahead()

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

    def take_imu(self) -> list[ImuBatch]:
        """Return what the units' IMUs measured since the last call, stamped in the simulation's time.

        Where that is slower than the room's, what would overlap is left out.
        """
        if abs(self._ahead() - self._imu_ahead) > _STEADY_S:
            self._imu_ahead = self._ahead()
        ahead, taken = self._imu_ahead, []
        for batch in self.source.take_imu():
            stamp = batch.stamp + ahead
            later = stamp > self._last_imu[batch.unit]
            if later.any():
                self._last_imu[batch.unit] = stamp[-1]
                acceleration, angular_velocity = batch.acceleration[later], batch.angular_velocity[later]
                taken.append(replace(
                    batch, stamp=stamp[later], acceleration=acceleration, angular_velocity=angular_velocity
                ))  # fmt: skip
        return taken

    def _ahead(self) -> float:
        """By how much the simulation's clock is ahead of the machine's [s]."""
        return self._simulated() - self._clock()
