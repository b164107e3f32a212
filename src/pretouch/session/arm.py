"""The port of an arm that a session can begin and end to move."""

from typing import Protocol

from pretouch.ports import Robot


class Arm(Robot, Protocol):
    """An arm, seen from the computer that is to move it. Its states are stamped by this machine's monotonic clock."""

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
