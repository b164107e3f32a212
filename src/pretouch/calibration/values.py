"""What a calibration is made from, what is assumed, and what it says."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import FloatArray


@dataclass(frozen=True, eq=False)
class UnitData:
    """What one unit's IMU measured while the arm moved, on a clock of its own."""

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
    """What was measured while the arm moved."""

    joints: JointTrace
    units: tuple[UnitData, ...]


@dataclass(frozen=True)
class CalibrationParams(Checked):
    """What is assumed of sensors and clocks, and what is asked of an answer. Figures without a source are ours."""

    cutoff_hz: Positive = 12.0
    """Joint positions and IMU data pass the same zero-phase low-pass [Hz]: well above a calibration motion, well below
    the sensors' own bandwidths, so that both sides are filtered alike."""
    rate_hz: Positive = 25.0
    """Instants a second at which both sides are compared [Hz]: about twice the cutoff, more would be no news."""
    longest_gap_s: Positive = 0.05
    """Between samples further apart than this [s] nothing is interpolated."""
    clock_error_s: Annotated[float, Check(low=0.0)] = 0.5
    """Most a unit's clock differs from the arm's [s]; the right offset is searched for in this range."""
    acceleration_bias: Positive = 0.4
    """Standard deviation of the accelerometer's constant error, before anything is measured [m/s^2]: 40 mg (LSM6DS3
    data sheet, zero-g level offset)."""
    angular_velocity_bias: Positive = 0.17
    """The same of the gyroscope [rad/s]: 10 degrees/s (LSM6DS3 data sheet, zero-rate level)."""
    scale_error: Positive = 0.01
    """The same of each axis' scale: 1 % (LSM6DS3 data sheet, over temperature)."""
    gravity: Positive = 9.80665
    """Standard gravity, before anything is measured [m/s^2]."""
    gravity_error: Positive = 0.02
    """Its standard deviation [m/s^2]: from 9.780 at the equator to 9.832 at the poles."""
    lean_deg: Positive = 1.0
    """Standard deviation of the angle by which the arm's base is off level, towards either side [degrees]."""
    delay_difference_s: Positive = 0.0005
    """The same of the delay by which the accelerometer's filter lags behind the gyroscope's [s]."""
    tolerated_acceleration: Positive = 0.2
    """Difference from the model that is never an outlier [m/s^2]."""
    tolerated_angular_velocity: Positive = 0.03
    """Difference from the model that is never an outlier [rad/s]."""
    outlier_factor: Positive = 6.0
    """Beyond this many times the median difference, and what is tolerated, an instant is left out."""
    block_s: Positive = 1.0
    """Errors within this time are taken as wholly dependent on each other [s]: the answer's covariance comes from what
    blocks of this length say."""
    position_sigma_m: Positive = 0.01
    """An answer with a larger standard deviation of its position, in any direction, is refused [m]."""
    orientation_sigma_deg: Positive = 2.0
    """An answer with a larger standard deviation of its orientation, about any axis, is refused [degrees]."""
    board_misalignment_deg: NonNegative = 0.29
    """Standard deviation of the angle between the IMU's axes and the range finder's [degrees], which no IMU can tell;
    added to what a skin file says of an orientation. Up to half a degree either way: how well a board is glued on."""
    unusable: Fraction = 0.3
    """A unit of whose instants a larger share is left out is refused."""
    shortest_s: Positive = 15.0
    """Time of usable data below which nothing is tried [s]: fewer blocks do not tell how sure an answer is."""
    least_swing_rad: Positive = 0.05
    """A joint that moves by less has not moved: the links on its two sides cannot be distinguished [rad]."""
    likeness: Fraction = 0.9
    """How much of a gyroscope's and a link's turning must be the same for the unit to sit on that link."""

    @property
    def orientation_limit(self) -> float:
        """Largest standard deviation of an accepted orientation [rad]."""
        return float(np.deg2rad(self.orientation_sigma_deg))


@dataclass(frozen=True, eq=False)
class Observability:
    """How well each direction is known. All directions are in the link frame, the best known first."""

    position_directions: FloatArray
    """(3, 3) unit vectors in rows."""
    position_sigma: FloatArray
    """(3,) standard deviation of the position along each [m]."""
    orientation_axes: FloatArray
    """(3, 3) unit vectors in rows."""
    orientation_sigma: FloatArray
    """(3,) standard deviation of the orientation about each [rad]."""
    unknown: tuple[str, ...]
    """What is not known as well as it has to be, in words; empty if all is."""
    known: tuple[str, ...]
    """What is known nevertheless, in words; empty if all is."""


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
