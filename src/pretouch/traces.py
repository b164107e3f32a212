"""What was measured over some time: arrays by instant."""

from pretouch.types import FloatArray
from pretouch.values import value


@value
class ImuTrace:
    """What the IMU of one unit measured, by time. M samples, sensor frame."""

    stamp: FloatArray
    """(M,) [s]."""
    acceleration: FloatArray
    """(M, 3) proper acceleration: at rest, that against gravity [m/s^2]."""
    angular_velocity: FloatArray
    """(M, 3) [rad/s]."""


@value
class JointTrace:
    """Measured joint positions of an arm, by time. T samples of n joints."""

    stamp: FloatArray
    """(T,) [s]."""
    q: FloatArray
    """(T, n) [rad]."""
