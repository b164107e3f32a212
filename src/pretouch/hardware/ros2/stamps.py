"""When a message was measured, by this machine's monotonic clock; and whether it is new.

ROS has another clock than ours, which can be set, be simulated, or be another machine's. So a message counts from when
it was received, unless the clocks are said to be the same. Whether it is new, its header says: a driver that lost
its arm and repeats itself must not pass for one that is well.
"""

from collections.abc import Callable
from time import time as wall_clock

from pretouch.hardware.ros2.params import seconds

SET_BACK_S = 1.0
"""A stamp older than the one before by this much is of a clock that was set back, and no late message [s]."""


class Stamps:
    """The stamps of one source, whose messages each have a header."""

    def __init__(self, shared_clock: bool = False, now: Callable[[], float] = wall_clock) -> None:
        """Take whether the stamps are of this machine's time of day; and that [s]."""
        self._shared, self._now = shared_clock, now
        self._newest, self._writer = 0.0, 0
        self.repeated = 0
        """Messages left out because their stamp was not new."""

    def instant(self, header: object, received: float, writer: int) -> float | None:
        """Return when a message was measured [s], or None if it is not to be used.

        Args:
            header: std_msgs/Header; one without a stamp counts as new.
            received: by the monotonic clock [s].
            writer: who wrote it; another one may begin anew.
        """
        at = header.stamp  # type: ignore[attr-defined]
        stamp = seconds(at.sec, at.nanosec)
        if stamp == 0:
            return received
        if writer == self._writer and self._newest - SET_BACK_S < stamp <= self._newest:
            self.repeated += 1
            return None
        self._newest, self._writer = stamp, writer
        return received - max(self._now() - stamp, 0.0) if self._shared else received
