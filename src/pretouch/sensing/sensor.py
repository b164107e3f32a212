"""Types of range finders, as their data sheets or skin files describe them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from pretouch.checks import Check, NonNegative, Positive
from pretouch.composition import Part
from pretouch.errors import ParameterError, SkinError
from pretouch.types import FloatArray, IntArray, Number

MOST_ZONES = 8
"""Zones along a side, at most: a type with more is a depth camera, an outside source of points."""
RINGS = 2
"""Circles of rays that represent a sensor's cone: with its axis 19 rays."""
_Angle = Annotated[float, Check(low=0.0, high=120.0, open_low=True)]
_Zones = Annotated[int, Check(low=1, high=MOST_ZONES)]


@dataclass(frozen=True)
class Sensor(Part, group="pretouch.sensors"):
    """A range finder with one cone about its axis, or a square of zones that each measure a distance.

    A type of your own is a subclass with a name and its own defaults, or a table in a skin file.
    """

    field_of_view_deg: _Angle = 27.0
    """Full angle of the cone, or of the square from side to side [deg]."""
    zones: _Zones = 1
    """Zones along each side of the square; 1: one cone."""
    nearest_m: Positive = 0.04
    """Smallest distance it measures [m]; nearer targets count as there."""
    farthest_m: Positive = 4.0
    """Largest distance it measures [m]."""
    rate_hz: Positive = 50.0
    """Readings in a second, at most [Hz]."""
    noise: Positive = 1.0
    """Noise relative to the VL53L1X's in the simulation [1]."""
    blind_s: NonNegative = 0.0
    """Longest burst of "no target" before a near target [s]: shorter ones are no evidence of free space.

    0, unless somebody has measured one: each "no target" counts.
    """
    delay_s: NonNegative = 0.0
    """Time from the middle of a measurement to the moment that a reading is ready [s]."""
    own_name: str = ""
    """Name in the skin file that describes it; '' for other types."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.nearest_m >= self.farthest_m:
            raise ParameterError(
                f"{type(self).__name__}.nearest_m is {self.nearest_m:g} and farthest_m {self.farthest_m:g}: it must"
                " measure farther than its nearest distance."
            )

    @property
    def grey_m(self) -> float:
        """Distance at which a grey target that fills the cone is just visible [m]."""
        return self.farthest_m

    @property
    def timing(self) -> tuple[float, float, float]:
        """`blind_s`, the delay of the middle of a reading, and the time between readings [s]."""
        return self.blind_s, self.delay_s, 1.0 / self.rate_hz

    @property
    def label(self) -> str:
        """Name in skin files."""
        return self.own_name or self.name

    @property
    def angle(self) -> float:
        """Full angle of the cone [rad]; for zones, that of a cone as large as one of them."""
        side = float(np.deg2rad(self.field_of_view_deg))
        return side if self.zones == 1 else side / self.zones * 2.0 / math.sqrt(math.pi)

    @property
    def spread(self) -> float:
        """Standard deviation of the direction of a target [rad]; 0: eq. 1 assumes it on the axis."""
        return 0.0

    def looks(self) -> FloatArray:
        """Return the rotations (zones^2, 3, 3) from each zone's frame, z along its beam, to the sensor's.

        Zones are numbered along x, then along y, and lie at equal angles.
        """
        tilt = np.tan(np.deg2rad(self.field_of_view_deg) * ((np.arange(self.zones) + 0.5) / self.zones - 0.5))
        y, x = np.meshgrid(tilt, tilt, indexing="ij")
        beams = np.stack([x.ravel(), y.ravel(), np.ones(self.zones**2)], axis=1)
        return np.array([_rotation_to(beam / np.linalg.norm(beam)) for beam in beams])


def _rotation_to(beam: FloatArray) -> FloatArray:
    """Return the least rotation (3, 3) that takes the z axis to a unit vector (3,) of the same half-space."""
    x, y, z = beam.tolist()
    return np.array([
        [1.0 - x * x / (1.0 + z), -x * y / (1.0 + z), x],
        [-x * y / (1.0 + z), 1.0 - y * y / (1.0 + z), y],
        [-x, -y, z],
    ])  # fmt: skip


@dataclass(frozen=True)
class VL53L1X(Sensor, name="vl53l1x"):
    """ST's time-of-flight sensor of the paper (data sheet DS12385: 16 x 16 SPADs, 27 degrees, 4 cm to 4 m).

    No burst of "no target" is known: 1230 readings of a table in a row are all numbers
    (github.com/daniel-carlebach/vl53l1x_testing). Its delay was never published.
    """

    delay_s: NonNegative = 0.0075
    """Half of the 15 ms in which our firmware lets it measure: what it needs besides is not known [s]."""

    @property
    def grey_m(self) -> float:
        """See `Sensor`; the short mode's, which 50 Hz need."""
        return min(1.3, self.farthest_m)


@dataclass(frozen=True)
class VL53L5CX(Sensor, name="vl53l5cx"):
    """ST's 4 x 4 zones at 60 Hz (data sheet DS13754: 45 degrees from side to side, 2 cm to 4 m; VL53L8CX likewise).

    `zones = 8` measures 8 x 8 at 15 Hz. The sensor must be set to report the nearest target of each zone: its default
    is the strongest one.
    """

    field_of_view_deg: _Angle = 45.0
    zones: _Zones = 4
    nearest_m: Positive = 0.02
    rate_hz: Positive = 60.0
    noise: Positive = 2.0
    blind_s: NonNegative = 0.86
    """Square to a panel at 0.35 to 0.5 m, 8 x 8 zones (flights of github.com/ETH-PBL/Matrix_ToF_Drones) [s]."""
    delay_s: NonNegative = 0.034
    """Delay of 4 x 4 zones [s]: half of their 17 ms, and half of the 51 ms by which the last zones of 8 x 8 trail
    besides. The flights do not tell how much of those is the sensor's: half errs by 25 ms at most."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.zones not in _FASTEST_HZ:
            raise ParameterError(f"{type(self).__name__}.zones is {self.zones}: it measures 4 x 4 or 8 x 8.")

    @property
    def grey_m(self) -> float:
        """See `Sensor`."""
        return min(_GREY_M[self.zones], self.farthest_m)

    @property
    def timing(self) -> tuple[float, float, float]:
        """See `Sensor`; 8 x 8 are measured in four parts, one after another, each as long as a measurement of 4 x 4."""
        delay_s = self.delay_s + (1.5 / _FASTEST_HZ[4] if self.zones == 8 else 0.0)
        return self.blind_s, delay_s, 1.0 / min(self.rate_hz, _FASTEST_HZ[self.zones])


_FASTEST_HZ = {4: 60.0, 8: 15.0}
"""Most frames a second (data sheet)."""
_GREY_M = {4: 1.7, 8: 1.2}
"""Ours, less than the 4 m of a white target in the dark imply; to be measured with the sensor in use [m]."""


@dataclass(frozen=True)
class VL53L7CX(VL53L5CX, name="vl53l7cx"):
    """The same with 60 degrees from side to side, 90 along the diagonal (UM3038)."""

    field_of_view_deg: _Angle = 60.0


@dataclass(frozen=True)
class Capacitive(Sensor, name="capacitive"):
    """A self-capacitance electrode, with the map from its signal to a distance (`examples/10_map_of_an_electrode.py`).

    signal = gain / (distance + offset)^power, 0 with nothing near. The map here is that of the simulation's electrode,
    of a finger, a fist, a forearm and a flat hand; a printed skin has reached 18 cm (GenTact-Prox, 2026).
    """

    field_of_view_deg: _Angle = 120.0
    """Full angle of the sensitive cone [deg]: ours."""
    nearest_m: Positive = 0.005
    farthest_m: Positive = 0.18
    rate_hz: Positive = 60.0
    gain: Positive = 1.84e-4
    """Signal at a distance of 1 m less the offset [1]."""
    offset_m: Positive = 0.036
    """About the size of the electrode [m]."""
    power: Positive = 2.58
    """Exponent of the signal's decay [1]."""
    spread_1: Positive = 0.46
    """Standard deviation of the distance over possible objects, as a part of it [1]."""

    def distance(self, signal: float) -> float:
        """Return the distance [m] of the map's objects for a signal: at least 0, infinite without a signal."""
        return math.inf if signal <= 0.0 else max(0.0, (self.gain / signal) ** (1.0 / self.power) - self.offset_m)

    def signal(self, distance: Number) -> Number:
        """Return the signal of an object at a distance [m]."""
        return self.gain / (distance + self.offset_m) ** self.power

    @property
    def spread(self) -> float:
        """Error of the distance as a direction [rad], of which profiles subtract two.

        An object at the edge of the field, at half an angle a from the axis, is d cos a above a flat body: two of
        (1 - cos a) / 2 cover that. An object may also give another signal than those of the map.
        """
        return math.hypot((1.0 - math.cos(self.angle / 2)) / 2, self.spread_1)


class Sensors(NamedTuple):
    """K sensors, placed in the base frame."""

    position: FloatArray
    """(K, 3) [m]."""
    rotation: FloatArray
    """(K, 3, 3), z along the beam."""
    link: IntArray
    """(K,) link of each."""


class Cones(NamedTuple):
    """Fields of view of K sensors of T kinds: a cone about the axis of each."""

    kind: Annotated[IntArray, "K"]
    """(K,) kind of each."""
    edge: Annotated[FloatArray, "T", 3]
    """(T, 3) cosine, sine and tangent of half the angle."""
    range: Annotated[FloatArray, "T", 2]
    """(T, 2) smallest and largest distance [m]."""
    rays: Annotated[FloatArray, "T", "R", 3]
    """(T, R, 3) unit vectors that fill the cone, sensor frame, the axis first."""
    spread: Annotated[FloatArray, "T"]
    """(T,) standard deviation of a target's direction, without that of the unit's own orientation [rad]."""
    timing: Annotated[FloatArray, "T", 3]
    """(T, 3) longest burst of "no target", delay of a reading, period of the fastest mode [s]."""


PAPER_SENSOR = VL53L1X()
"""Default sensor of a unit in a skin file."""


def cone_rays(rings: int, angle: float) -> FloatArray:
    """Return unit vectors (1 + 3 rings (rings + 1), 3) that fill a cone of a full angle [rad], sensor frame.

    The axis comes first, then `rings` circles of 6, 12, ... rays, the outermost on the edge of the cone.
    """
    rays = [np.array([0.0, 0.0, 1.0])]
    for ring in range(1, rings + 1):
        tilt = angle / 2 * ring / rings
        for turn in 2 * np.pi * np.arange(6 * ring) / (6 * ring):
            rays.append(np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)]))
    return np.array(rays)


def cones_of(sensors: Sequence[Sensor]) -> Cones:
    """Return the fields of view of K sensors, for compiled code."""
    kinds = list(dict.fromkeys(sensors)) or [PAPER_SENSOR]
    half = [kind.angle / 2 for kind in kinds]
    return Cones(
        np.array([kinds.index(sensor) for sensor in sensors], dtype=np.int64),
        np.array([[np.cos(a), np.sin(a), np.tan(a)] for a in half]),
        np.array([[kind.nearest_m, kind.farthest_m] for kind in kinds]),
        np.array([cone_rays(RINGS, kind.angle) for kind in kinds]),
        np.array([kind.spread for kind in kinds]),
        np.array([kind.timing for kind in kinds]),
    )


_LIKE, _OWN = "like", "own_name"


def sensor_called(name: Any, of: str, types: dict[str, Sensor]) -> Sensor:
    """Return the sensor of a type by its name; `of` is the owner in messages, `types` are the skin file's own."""
    names = (*types, *Sensor.choices())
    if not isinstance(name, str) or name not in names:
        raise SkinError(f"{of} has the sensor {name!r}: choose from {', '.join(names)}, or describe [sensor.NAME].")
    return types[name] if name in types else cast(Sensor, Sensor.called(name)())


def own_type(name: str, table: Any) -> Sensor:
    """Return a type that a skin file describes: a known type, and its differences."""
    of = f"The type [sensor.{name}]" if name.isprintable() else f"The type {name!r}"
    if not isinstance(table, dict):
        raise SkinError(f"{of} is {table!r}: write a table [sensor.NAME].")
    like = sensor_called(table.get(_LIKE, PAPER_SENSOR.name), of, {})
    if name in Sensor.choices():
        raise SkinError(f"{of} has the name of a known type: give yours another name, and like = {name!r}.")
    return cast(Sensor, replace(changed_by(like, table, of, _LIKE), own_name=name))


def changed_by(usual: Any, table: dict[str, Any], of: str, *others: str) -> Any:
    """Return parameters changed by a table of a skin file, which may have `others` as keys; `of` is for messages."""
    allowed = [f.name for f in fields(usual) if f.name != _OWN]
    unknown = sorted(set(table) - {*others, *allowed})
    if unknown:
        raise SkinError(f"{of} has the unknown key {unknown[0]!r}: use {', '.join((*others, *allowed))}.")
    try:
        return replace(usual, **{key: value for key, value in table.items() if key not in others})
    except ParameterError as error:
        raise SkinError(f"{of} is not possible: {error}") from error


def tables_of(sensors: Iterable[Sensor]) -> dict[str, dict[str, Any]]:
    """Return the tables of a skin file for types of its own; none if all types are known by name."""
    tables = {}
    for sensor in sensors:
        if sensor.own_name:
            usual = type(sensor)()
            values = {f.name: getattr(sensor, f.name) for f in fields(sensor) if f.name != _OWN}
            tables[sensor.own_name] = {_LIKE: sensor.name} | {k: v for k, v in values.items() if v != getattr(usual, k)}
    return {"sensor": tables} if tables else {}
