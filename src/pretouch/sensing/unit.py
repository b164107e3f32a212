"""A sensor unit: a range finder with a pose on a link, with one beam or zones; its network identity, and its IMU."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Annotated

import numpy as np

from pretouch.checks import Check, Checked
from pretouch.errors import SkinError
from pretouch.robot.body import from_axes
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor
from pretouch.types import FloatArray

LARGEST_NUMBER = 1000.0
"""Largest number in a pose: a larger one is a mistake, and its square may not be finite."""

LARGEST_POSITION_SIGMA = 0.5
"""Largest standard deviation of a unit's position [m]: beyond it the place on the arm is unknown."""

LARGEST_ORIENTATION_SIGMA = np.pi / 2
"""Largest standard deviation of a unit's orientation [rad]: beyond it the direction is unknown."""


@dataclass(frozen=True)
class TouchPatch(Checked):
    """The touch sensor of a unit: a round patch about the unit, on its link's surface.

    The values are those of a unit whose case, 40 mm wide, rests on a force-sensing resistor of Interlink's 400 series
    (data sheet: it measures from 0.1 N on; a case held by foam so that it does not press by itself takes more).
    """

    radius_m: Annotated[float, Check(0.0, 0.2, open_low=True)] = 0.02
    """Radius of the patch [m]: a touch of a larger one has no place."""
    force_min_n: Annotated[float, Check(0.0, 100.0, open_low=True)] = 0.5
    """Smallest force that counts as a touch [N]: beyond 100 N a person is hurt before."""
    measures_force: bool = True
    """True if it measures the size of the force, False for contact only."""


@dataclass(frozen=True, eq=False)
class SensorUnit:
    """A unit named `id` on a link, with its pose. The sensor's z axis points outwards along the beam.

    Two units are equal only if they are the same one: compare ids.
    """

    id: str
    link: str
    T_link_sensor: FloatArray
    """(4, 4) maps sensor coordinates to link coordinates [m]."""
    position_sigma: float = 0.0
    """Standard deviation of its position in the worst direction [m]; 0: exact."""
    orientation_sigma: float = 0.0
    """Standard deviation of its orientation about the worst axis [rad]; 0: exact."""
    touch: TouchPatch | None = None
    """Its touch sensor; None without one."""
    sensor: Sensor = PAPER_SENSOR
    """Its range finder."""
    zone: int | None = None
    """Number of a zone of its sensor, whose beam is then the z axis; None for the whole unit."""

    def __post_init__(self) -> None:
        if not self.id:
            raise SkinError("A sensor unit has an empty id: give each unit a name.")
        if not self.id.isprintable():
            raise SkinError(f"A sensor unit has the id {self.id!r}: use printable characters only.")
        T = np.asarray(self.T_link_sensor, dtype=np.float64)
        if T.shape != (4, 4) or not np.all(np.abs(T) <= LARGEST_NUMBER):
            raise SkinError(f"Unit {self.id}: its pose holds {T.tolist()}: give a finite 4 x 4 matrix, in metres.")
        off, determinant = float(np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max()), np.linalg.det(T[:3, :3])
        if off > 1e-6 or determinant < 0 or T[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise SkinError(
                f"Unit {self.id}: its pose {T.tolist()} is not a proper rotation (determinant {determinant:.6f}, R R^T"
                f" off by {off:.2g}) and a place: give a right-handed rotation, and 0 0 0 1 as the last row."
            )
        frozen = T.copy()
        frozen.flags.writeable = False
        object.__setattr__(self, "T_link_sensor", frozen)
        zone, count = self.zone, self.sensor.zones**2
        if zone is not None and (type(zone) is not int or not 0 <= zone < count):
            raise SkinError(f"Unit {self.id} is zone {zone!r} of its sensor: give one from 0 to {count - 1}.")
        self._check_sigma("position_sigma", LARGEST_POSITION_SIGMA, "m")
        self._check_sigma("orientation_sigma", LARGEST_ORIENTATION_SIGMA, "rad")

    def _check_sigma(self, name: str, largest: float, si: str) -> None:
        sigma = getattr(self, name)
        number = isinstance(sigma, int | float | np.integer | np.floating) and not isinstance(sigma, bool)
        if not number or not 0 <= sigma <= largest:
            raise SkinError(
                f"Unit {self.id}: its {name} is {sigma!r}: give a standard deviation from 0 to {largest:.4g} {si}."
            )
        object.__setattr__(self, name, float(sigma))

    @property
    def board(self) -> str:
        """Id of this unit, or of the unit of this zone."""
        return self.id if self.zone is None else self.id.rpartition(_OF)[0]


_OF = "/"
"""Separator of the id of a unit and the number of a zone."""


def zones_of(unit: SensorUnit) -> tuple[SensorUnit, ...]:
    """Return the parts with one distance each: a whole unit, or its zones; the first has the unit's touch sensor."""
    if unit.zone is not None:
        raise SkinError(f"Unit {unit.id} is a zone: give the whole unit, of `Skin.mounted`.")
    if unit.sensor.zones == 1:
        return (unit,)
    zones = []
    for zone, look in enumerate(unit.sensor.looks()):
        T = unit.T_link_sensor.copy()
        T[:3, :3] = T[:3, :3] @ look
        touch = None if zone else unit.touch
        zones.append(replace(unit, id=f"{unit.id}{_OF}{zone}", T_link_sensor=T, zone=zone, touch=touch))
    return tuple(zones)


@dataclass(frozen=True, eq=False)
class Seat:
    """A point of the surface of a link, below a unit."""

    height: float
    """Height of the unit above it [m]; negative inside."""
    normal: FloatArray
    """(3,) unit vector outwards, link frame."""


def seat(model: RobotModel, link: int, p: FloatArray) -> Seat | None:
    """Return the nearest point of a link's surface to a point p (3,) in its frame [m]; None without a capsule."""
    own = model.capsules.of_links(np.array([link]))
    if not len(own.radius):
        return None
    away = from_axes(p[None], own.a, own.b)[1][0]
    distance = np.linalg.norm(away, axis=1)
    c = int((distance - own.radius).argmin())
    return Seat(float(distance[c] - own.radius[c]), away[c] / max(float(distance[c]), 1e-9))


@dataclass(frozen=True)
class NetworkUnits:
    """B units in the order of the skin. Their measurements have K rows, one for each zone (`Skin`)."""

    ids: tuple[str, ...]
    """Names of the units, in keys and datagrams."""
    zones: tuple[int, ...]
    """Zones along each side of each one's sensor; 1: a single range."""

    @classmethod
    def of(cls, units: "NetworkUnits | Iterable[str]") -> "NetworkUnits":
        """Return units as they are, or units without zones for names."""
        if isinstance(units, NetworkUnits):
            return units
        ids = tuple(units)
        return cls(ids, (1,) * len(ids))

    @property
    def first(self) -> tuple[int, ...]:
        """Row of each unit's range, or of its first zone's; touch and IMU have the same row."""
        return tuple(accumulate((side**2 for side in self.zones[:-1]), initial=0))[: len(self.ids)]

    @property
    def rows(self) -> int:
        """Number of rows K."""
        return sum(side**2 for side in self.zones)


STANDARD_GRAVITY = 9.80665
"""Unit of the LSM6DS3, the inertial sensor of a unit [m/s^2]: its data sheet gives accelerations in thousandths."""
ACCELERATION_LSB = {g: 1e-3 * mg * STANDARD_GRAVITY for g, mg in ((2, 0.061), (4, 0.122), (8, 0.244), (16, 0.488))}
"""One count of the accelerometer [m/s^2] by its full scale [g] (data sheet, LA_So)."""
ANGULAR_RATE_LSB = {
    dps: float(np.deg2rad(1e-3 * mdps))
    for dps, mdps in ((125, 4.375), (245, 8.75), (500, 17.5), (1000, 35.0), (2000, 70.0))
}
"""One count of the gyroscope [rad/s] by its full scale [degrees/s] (data sheet, G_So)."""
LARGEST_COUNT = 2**15 - 1
"""Largest count, for any nominal full scale."""


def counts_of(scale: int) -> tuple[float, float]:
    """Return one count of accelerometer [m/s^2] and gyroscope [rad/s] by the scales of a datagram.

    Scales are those of docs/reference/wire.md; others are a ValueError.
    """
    rates = list(ANGULAR_RATE_LSB.values())
    code = scale >> 4 & 7
    if code >= len(rates):
        raise ValueError(f"the gyroscope's full scale has the code {code}: there are 0 to {len(rates) - 1}")
    return list(ACCELERATION_LSB.values())[scale & 3], rates[code]
