"""What the loop needs from the outside world, as one or two methods each."""

from typing import Protocol

from pretouch.types import FloatArray, ImuReadings, RangeReadings, RobotState


class Robot(Protocol):
    """An arm that is commanded by joint velocities."""

    def read(self) -> RobotState:
        """Return the newest state."""
        ...

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point until the next command."""
        ...


class Skin(Protocol):
    """The sensor units on the arm."""

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit."""
        ...


class ImuSkin(Skin, Protocol):
    """Sensor units that have IMUs too. A `Skin` without this method has none."""

    def imu(self) -> ImuReadings:
        """Return the IMU samples that came since the last call."""
        ...


class Clock(Protocol):
    """The one clock all stamps come from."""

    def tick(self) -> float:
        """Wait for the next control period and return its instant [s]."""
        ...
