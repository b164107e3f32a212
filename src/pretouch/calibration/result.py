"""What a calibration found."""

from dataclasses import dataclass

import numpy as np

from pretouch.calibration.observability import Observability
from pretouch.types import FloatArray


@dataclass(frozen=True)
class Finding:
    """Something that is to be known of a unit's data, or of the joints'."""

    kind: str
    """A word for programs, such as `slipped`."""
    sentence: str
    """What is wrong and what to do about it."""
    refused: bool
    """Whether the unit's place cannot be trusted for it."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where a unit sits, with the errors of its IMU."""

    link: str
    T_link_sensor: FloatArray
    """(4, 4)."""
    covariance: FloatArray
    """(6, 6) of rotation vector in the sensor frame [rad] and position in the link frame [m]."""
    acceleration_bias: FloatArray
    """(3,) [m/s^2]."""
    angular_velocity_bias: FloatArray
    """(3,) [rad/s]."""
    acceleration_scale: FloatArray
    """(3,) error of each axis' scale."""
    angular_velocity_scale: FloatArray
    """(3,) error of each axis' scale."""
    clock_offset: float
    """By how much the unit's stamps are late [s]; the sensor's own delay, about 1 ms, is part of it."""
    acceleration_residual: float
    """Root mean square of what the model does not explain [m/s^2], after the low-pass."""
    angular_velocity_residual: float
    """The same of the gyroscope [rad/s]."""
    used: float
    """Share of the instants that were used."""

    @property
    def position_sigma(self) -> float:
        """Standard deviation of the position in its worst direction [m]."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[3:, 3:])[-1]))

    @property
    def orientation_sigma(self) -> float:
        """Standard deviation of the orientation about its worst axis [rad]."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:3, :3])[-1]))


@dataclass(frozen=True, eq=False)
class UnitCalibration:
    """What was found of one unit."""

    id: str
    place: Place | None
    """None where nothing can be said at all."""
    findings: tuple[Finding, ...] = ()
    observability: Observability | None = None
    """How well each direction of the place is known; None where there is no place."""

    @property
    def accepted(self) -> bool:
        """Whether its place can be trusted."""
        return self.place is not None and not any(finding.refused for finding in self.findings)


@dataclass(frozen=True, eq=False)
class Calibration:
    """What was found of all units."""

    units: tuple[UnitCalibration, ...]
    """In the order of the data."""
    findings: tuple[Finding, ...] = ()
    """What is to be known of the joints' data."""
    orientation_floor: float = 0.0
    """Standard deviation, about each axis, of the angle between an IMU's axes and its range finder's [rad]; no IMU can
    tell it."""
