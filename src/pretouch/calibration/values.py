"""Data, assumptions and result of a calibration."""

from dataclasses import dataclass

import numpy as np

from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import FloatArray

# What is assumed of sensors and clocks, and what is asked of an answer. Figures without a source are ours.
CUTOFF_HZ = 12.0
"""Joint positions and IMU data pass the same zero-phase low-pass [Hz]: well above a calibration motion, well below
the sensors' own bandwidths, so that both sides are filtered alike."""
RATE_HZ = 25.0
"""Instants a second at which both sides are compared [Hz]: about twice the cutoff, more would be no news."""
LONGEST_GAP_S = 0.05
"""Between samples further apart than this [s] nothing is interpolated."""
CLOCK_ERROR_S = 0.5
"""Most a unit's clock differs from the arm's [s]; the right offset is searched for in this range."""
SCALE_ERROR = 0.01
"""Standard deviation of the error of each axis' scale, before anything is measured: 1 % (LSM6DS3 data sheet, over
temperature)."""
GRAVITY = 9.80665
"""Standard gravity, before anything is measured [m/s^2]."""
TOLERATED_ACCELERATION = 0.2
"""Difference from the model that is never an outlier [m/s^2]."""
TOLERATED_ANGULAR_VELOCITY = 0.03
"""Difference from the model that is never an outlier [rad/s]."""
UNUSABLE = 0.3
"""A unit of whose instants a larger share is left out is refused."""
SHORTEST_S = 15.0
"""Time of usable data below which nothing is tried [s]: fewer blocks do not tell how sure an answer is."""
LEAST_SWING_RAD = 0.05
"""A joint that moves by less has not moved: the links on its two sides cannot be distinguished [rad]."""


@dataclass(frozen=True, eq=False)
class UnitData:
    """Measurements of one unit's IMU while the arm moved, on a clock of its own."""

    id: str
    imu: ImuTrace
    link: str | None = None
    """The link it sits on, as the user says; None: it is to be found."""
    acceleration_max: float = np.inf
    """Full scale of the accelerometer [m/s^2]: a value there is cut off."""
    angular_velocity_max: float = np.inf
    """Full scale of the gyroscope [rad/s]."""


@dataclass(frozen=True, eq=False)
class CalibrationData:
    """Measurements while the arm moved."""

    joints: JointTrace
    units: tuple[UnitData, ...]


@dataclass(frozen=True)
class Remark:
    """Something that is to be known of a unit's data, or of the joints'."""

    kind: str
    """A word for programs, such as `slipped`."""
    sentence: str
    """Problem and remedy."""
    refused: bool
    """True if the unit's place cannot be trusted for it."""


@dataclass(frozen=True, eq=False)
class Place:
    """Pose of a unit, with the errors of its IMU."""

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
    """Delay of the unit's stamps [s]; it includes the sensor's own delay of about 1 ms."""
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
    """Result for one unit."""

    id: str
    place: Place | None
    """Estimated place; None where there is no estimate."""
    findings: tuple[Remark, ...] = ()

    @property
    def accepted(self) -> bool:
        """True if its place can be trusted."""
        return self.place is not None and not any(finding.refused for finding in self.findings)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result for all units."""

    units: tuple[UnitCalibration, ...]
    """Results in the order of the data."""
    findings: tuple[Remark, ...] = ()
    """Findings on the joints' data."""
