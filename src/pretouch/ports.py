"""What the loop needs from the outside world, as one or two methods each."""

from typing import Protocol

import numpy as np

from pretouch.types import FloatArray, RangeReadings, RobotState, SeenPoints, TouchReadings


class Robot(Protocol):
    """An arm that is commanded by joint velocities."""

    def read(self) -> RobotState:
        """Return the newest state."""
        ...

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point until the next command."""
        ...


class Arm(Robot, Protocol):
    """A robot that begins and ends to be moved. Its states are stamped by this machine's monotonic clock."""

    @property
    def name(self) -> str:
        """What sentences call it, as `Panda at 172.16.0.2`."""
        ...

    def unfit(self) -> tuple[str, ...]:
        """Say what the arm itself has against being moved, a sentence each; none if it can be."""
        ...

    def begin(self) -> None:
        """Take commands from here on, at rest. What forbids it is a RobotError."""
        ...

    def end(self) -> None:
        """Come to rest, whatever was commanded, and take no more commands. Nothing happens where it has not begun."""
        ...

    def report(self) -> str:
        """Say how the connection did, in lines; '' if there is nothing to say."""
        ...


class Skin(Protocol):
    """The sensor units on the arm."""

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit."""
        ...


class NoUnits:
    """The port `Skin` of an arm without units."""

    def read(self) -> RangeReadings:
        """Return the readings of none."""
        return RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def touch_of(skin: object) -> TouchReadings | None:
    """Return the newest touch reading of each unit by the method `touch`; None while none is known."""
    touch = getattr(skin, "touch", None)
    return None if touch is None else touch()


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
