"""Ports: interfaces of one or two methods between the loop and the arm, its units, other sensors and the clock."""

from typing import Protocol

import numpy as np

from pretouch.types import FloatArray, RangeReadings, RobotState, SeenPoints, TouchReadings


class Robot(Protocol):
    """An arm that is commanded by joint velocities."""

    def read(self) -> RobotState:
        """Return the newest state."""
        ...

    def command(self, qd: FloatArray) -> None:
        """Set the joint velocities (n,) [rad/s] until the next command."""
        ...


class Arm(Robot, Protocol):
    """A robot whose motion is started and ended. Its states have stamps of this machine's monotonic clock."""

    @property
    def name(self) -> str:
        """Name in sentences, as `Panda at 172.16.0.2`."""
        ...

    def unfit(self) -> tuple[str, ...]:
        """Return the arm's own reasons not to move, a sentence each; none if it can."""
        ...

    def begin(self) -> None:
        """Accept commands from now on, at rest. Raises RobotError where that is not possible."""
        ...

    def end(self) -> None:
        """Come to rest, whatever was commanded, and accept no more commands. Does nothing before `begin`."""
        ...

    def report(self) -> str:
        """Return lines on the quality of the connection; '' for none."""
        ...


class SkinPort(Protocol):
    """The sensor units on the arm."""

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit."""
        ...


class NoUnits:
    """The port of an arm without units."""

    def read(self) -> RangeReadings:
        """Return no readings."""
        return RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def touch_of(skin: object) -> TouchReadings | None:
    """Return the newest touch reading of each unit, by the method `touch` of a port; None before the first."""
    touch = getattr(skin, "touch", None)
    return None if touch is None else touch()


class Points(Protocol):
    """An outside source of points, such as a camera."""

    def read(self) -> SeenPoints:
        """Return the newest set at once; the same set again while there is no newer one."""
        ...


class Clock(Protocol):
    """The only clock: the source of all stamps."""

    def tick(self) -> float:
        """Wait for the next control period and return its instant [s]."""
        ...
