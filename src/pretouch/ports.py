"""What the loop needs from the outside world, as one or two methods each."""

from typing import Protocol

from pretouch.types import FloatArray, RangeReadings, RobotState, SeenPoints


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


class Points(Protocol):
    """An outside source of points, such as a camera."""

    def read(self) -> SeenPoints:
        """Return the newest set; the same one again, and at once, while there is no newer one."""
        ...


class Clock(Protocol):
    """The one clock all stamps come from."""

    def tick(self) -> float:
        """Wait for the next control period and return its instant [s]."""
        ...
