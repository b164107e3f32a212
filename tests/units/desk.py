"""Units on a desk: simulated ones that send in real time, from a thread, what they are told to measure."""

import threading
import time
from typing import Self

import numpy as np

from pretouch.sim.imu import ImuParams, ImuSample
from pretouch.sim.range_finder import RangeSample
from pretouch.types import RangeStatus
from pretouch.units.fleet import Fleet, FleetParams
from pretouch.units.keys import Keys

IMU_HZ = 416.0
AT_REST = np.array([0, 0, 0, 0, 0, 8192])


class Desk:
    """Units that see a wall and lie still; a context manager."""

    def __init__(self, keys: Keys, port: int, params: FleetParams | None = None) -> None:
        params = params or FleetParams(imu=ImuParams())
        self.fleet = Fleet(tuple(keys), keys, params, 0, ("127.0.0.1", port))
        self.distance = 0.5
        """Of the wall [m]."""
        self._rng = np.random.default_rng(0)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        begun = time.monotonic()
        ranges, imu = 0, 0
        while not self._end.wait(0.002):
            now = time.monotonic()
            while ranges <= (now - begun) / 0.02:
                at = begun + 0.02 * ranges
                for k in range(len(self.fleet.ids)):
                    distance = self.distance + 0.003 * self._rng.standard_normal()
                    self.fleet.take_range(RangeSample(k, at, distance, RangeStatus.OK, 0.004, 0.1))
                ranges += 1
            while imu <= (now - begun) * IMU_HZ:
                for k in range(len(self.fleet.ids)):
                    self.fleet.take_imu(ImuSample(k, begun + imu / IMU_HZ, AT_REST))
                imu += 1
            self.fleet.step(time.monotonic)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()
        self.fleet.close()
