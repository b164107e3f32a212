"""What a unit measures with: a type of range finder, as its data sheet describes it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pretouch.checks import Check, Positive
from pretouch.composition import Part
from pretouch.errors import ParameterError
from pretouch.groups import Cones
from pretouch.types import FloatArray

RINGS = 2
"""Circles of rays that stand for what a sensor sees: with its axis 19 rays."""


@dataclass(frozen=True)
class RangingMode:
    """How a sensor measures: a distance mode with a timing budget that serves it."""

    period_s: float
    """Time between readings: timing budget plus overhead [s]."""
    distance_max_m: float
    """Farthest target [m]."""


@dataclass(frozen=True)
class Sensor(Part, group="pretouch.sensors"):
    """A range finder that sees one cone about its axis.

    A type of one's own is a subclass with a name and defaults of its own, or a table in a skin file.
    """

    field_of_view_deg: Annotated[float, Check(low=0.0, high=120.0, open_low=True)] = 27.0
    """Full angle of the cone [deg]. More than 120 needs a sensor of several beams."""
    nearest_m: Positive = 0.04
    """Smallest distance it measures [m]; what is nearer is taken to be there."""
    farthest_m: Positive = 4.0
    """Largest distance it measures [m]."""
    rate_hz: Positive = 50.0
    """Readings in a second, at most [Hz]."""
    noise: Positive = 1.0
    """Times the noise of the VL53L1X in the simulation."""
    own_name: str = ""
    """What a skin file calls it, where it is of a type of that file's own."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.nearest_m >= self.farthest_m:
            raise ParameterError(
                f"{type(self).__name__}.nearest_m is {self.nearest_m:g} and farthest_m {self.farthest_m:g}: it must"
                " measure farther than its nearest distance."
            )

    def ranging(self, mode: str) -> RangingMode:
        """Return how it measures in a distance mode of its own; one without modes does so in one way."""
        return RangingMode(1.0 / self.rate_hz, self.farthest_m)

    @property
    def label(self) -> str:
        """What a skin file calls it."""
        return self.own_name or self.name

    @property
    def angle(self) -> float:
        """Full angle of the cone [rad]."""
        return float(np.deg2rad(self.field_of_view_deg))


_MODES = {"short": RangingMode(period_s=0.02, distance_max_m=1.3), "long": RangingMode(0.14, 4.0)}
"""50 Hz are to be had in short mode only; four metres need a budget of 140 ms (data sheet DS12385)."""


@dataclass(frozen=True)
class VL53L1X(Sensor, name="vl53l1x"):
    """ST's time-of-flight sensor of the paper (data sheet DS12385: 16 x 16 SPADs, 27 degrees, 4 cm to 4 m)."""

    def ranging(self, mode: str) -> RangingMode:
        """See `Sensor`; modes are short and long."""
        own, fastest = _MODES[mode], 1.0 / self.rate_hz
        return RangingMode(max(own.period_s, fastest), min(own.distance_max_m, self.farthest_m))


PAPER_SENSOR = VL53L1X()
"""What a unit has unless its skin file says otherwise."""


def cone_rays(rings: int, angle: float) -> FloatArray:
    """Unit vectors (1 + 3 rings (rings + 1), 3) that fill a cone of a full angle [rad], sensor frame.

    The axis comes first, then `rings` circles of 6, 12, ... rays, the outermost on the edge of the cone.
    """
    rays = [np.array([0.0, 0.0, 1.0])]
    for ring in range(1, rings + 1):
        tilt = angle / 2 * ring / rings
        for turn in 2 * np.pi * np.arange(6 * ring) / (6 * ring):
            rays.append(np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)]))
    return np.array(rays)


def cones_of(sensors: Sequence[Sensor]) -> Cones:
    """Return what K sensors see, for compiled code."""
    kinds = list(dict.fromkeys(sensors)) or [PAPER_SENSOR]
    half = [kind.angle / 2 for kind in kinds]
    return Cones(
        np.array([kinds.index(sensor) for sensor in sensors], dtype=np.int64),
        np.array([[np.cos(a), np.sin(a), np.tan(a)] for a in half]),
        np.array([[kind.nearest_m, kind.farthest_m] for kind in kinds]),
        np.array([cone_rays(RINGS, kind.angle) for kind in kinds]),
    )
