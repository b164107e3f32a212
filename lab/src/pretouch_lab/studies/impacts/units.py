"""Simulated units whole: range finders and IMUs, both as late as units send them."""

from itertools import chain

import numpy as np

from pretouch.sensing.skin import Skin
from pretouch.sim.imu import ImuParams, Imus, ImuSample, imu_counts
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.under_way import ROUNDING_S, UnderWay
from pretouch.types import ImuReadings, RangeReadings

DATAGRAM_S = 0.02
"""Time between two datagrams of a unit [s] (docs/reference/wire.md)."""


class SentImus:
    """The IMUs of a simulated skin, as late as units send what they measure.

    The samples of a unit wait for its next datagram, and all of one arrive together, as late as its ranges, or are lost
    together.
    """

    def __init__(
        self, plant: Plant, skin: Skin, ranging: RangeFinderParams, imu: ImuParams, seed: int,
        datagram_s: float = DATAGRAM_S,
    ) -> None:  # fmt: skip
        """Mount the IMUs; the seed decides how they err and what is late or lost. Latency is that of `ranging`."""
        self._plant, self._params, self._every = plant, ranging, datagram_s
        self._rng, self._lsb = np.random.default_rng([seed, 14]), imu_counts(imu)
        self._due: list[float] = self._rng.uniform(0.0, datagram_s, len(skin)).tolist()
        self._waiting: list[list[ImuSample]] = [[] for _ in skin.units]
        self._sent = UnderWay[list[ImuSample]]()
        Imus(plant, skin, imu, seed, lambda sample: self._waiting[sample.unit].append(sample))
        plant.before_each_step(self._send)

    def imu(self) -> ImuReadings:
        """Return the samples that have arrived since the last call."""
        arrived = self._sent.arrived(self._plant.time + ROUNDING_S)
        came = sorted(chain.from_iterable(arrived), key=lambda sample: sample.time)
        values = np.array([sample.counts for sample in came], dtype=np.float64).reshape(-1, 6) * self._lsb
        unit = np.array([sample.unit for sample in came], dtype=np.int64)
        stamp = np.array([sample.time for sample in came], dtype=np.float64)
        return ImuReadings(unit, stamp, values[:, 3:], values[:, :3])

    def _send(self, time: float) -> None:
        """Let each unit whose datagram is due send what waits."""
        p = self._params
        for unit, due in enumerate(self._due):
            if due > time:
                continue
            self._due[unit] = due + self._every
            late, lost = p.latency_s + self._rng.exponential(p.jitter_s), self._rng.random() < p.dropout
            taken, self._waiting[unit] = self._waiting[unit], []
            if taken and not lost:
                self._sent.send(time + late, taken)


class UnitsWithImus:
    """The port `ImuSkin` of a simulated arm."""

    def __init__(self, plant: Plant, skin: Skin, ranging: RangeFinderParams, imu: ImuParams, seed: int) -> None:
        """Mount the units; the seed decides how they err and what is late or lost."""
        self.range_finders = RangeFinders(plant, skin, ranging, seed)
        """What measures distances; `silenced` ones do not, while their IMUs go on."""
        self._imus = SentImus(plant, skin, ranging, imu, seed)

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit that has arrived by now."""
        return self.range_finders.read()

    def imu(self) -> ImuReadings:
        """Return the IMU samples that have arrived since the last call."""
        return self._imus.imu()
