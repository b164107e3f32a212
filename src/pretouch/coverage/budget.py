"""What more units may cost: their number, their price, what they send."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pretouch.checks import Checked, Positive, PositiveCount
from pretouch.errors import ParameterError
from pretouch.hardware.wire import SAMPLE_LEAST, zones_size
from pretouch.sensing.sensor import Sensor
from pretouch.types import FloatArray

_MOST_HZ = 100.0
"""Most samples that a unit sends in a second (docs/reference/wire.md)."""


@dataclass(frozen=True)
class Budget(Checked):
    """Bounds that more units keep together; at least one."""

    units: PositiveCount | None = None
    """How many units."""
    usd: Positive | None = None
    """Price of all [USD], as `Sensor.price_usd`."""
    bytes_s: Positive | None = None
    """What all send in a second [B/s], IMU and headers of UDP aside."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.units is None and self.usd is None and self.bytes_s is None:
            raise ParameterError("The budget has no bound: give a number of units, a price, or bytes a second.")

    def shares(self, sensors: Sequence[Sensor]) -> FloatArray:
        """Which part of each bound a unit with each of C sensors takes (C, B)."""
        bounds = (
            (self.units, lambda sensor: 1.0), (self.usd, lambda sensor: sensor.price_usd), (self.bytes_s, sent),
        )  # fmt: skip
        return np.array([[of(sensor) / bound for bound, of in bounds if bound is not None] for sensor in sensors])


def sent(sensor: Sensor) -> float:
    """Return what a unit sends in a second [B/s], without an IMU."""
    rate = min(_MOST_HZ, 1.0 / sensor.ranging("short").period_s)
    return rate * (SAMPLE_LEAST + (zones_size(sensor.zones) if sensor.zones > 1 else 0))
