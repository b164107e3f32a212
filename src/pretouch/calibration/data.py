"""What a calibration is made from."""

from dataclasses import dataclass

import numpy as np

from pretouch.traces import ImuTrace, JointTrace


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
