"""Time of a message by this machine's monotonic clock, and a check that it is new.

ROS has another clock than ours, which can be set, be simulated, or be another machine's. So a message counts from when
it was received, unless the clocks are said to be the same. Whether it is new, its header says: a driver that lost
its arm and repeats itself must not pass for one that is well.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import time as wall_clock

from pretouch_ros2.params import seconds

_TOGETHER_S = 0.5
"""Writers that were heard within this time publish at once [s]."""
_WRITERS = 8
"""Writers that are remembered: those that were heard last."""
_NOT_NEWER_MOST, _NOT_NEWER_S = 10, 0.5
"""Messages in a row that may be no newer, and for how long [s], before a person is told: a repeater is no fault."""


@dataclass
class _Writer:
    """Stamps of one writer."""

    last_received: float
    """Arrival of its last message [s]."""
    newest: float
    """Its newest stamp [s]."""


class SourceStamps:
    """The stamps of one source, whose messages each have a header."""

    def __init__(self, shared_clock: bool = False, now: Callable[[], float] = wall_clock) -> None:
        """Take whether the stamps are of this machine's time of day; and that [s]."""
        self._shared, self._now = shared_clock, now
        self._writers: dict[int, _Writer] = {}
        self._not_newer, self._newer_at, self._heard_at = 0, 0.0, 0.0
        self.behind: float | None = None
        """Least delay of stamps against this machine's time of day at their arrival [s]; None: there are no stamps."""

    def instant(self, header: object, received: float, writer: int) -> float | None:
        """Return when a message was measured [s], or None if it is not to be used.

        Args:
            header: std_msgs/Header; one without a stamp counts as new.
            received: by the monotonic clock [s].
            writer: who wrote it; another one may begin anew.
        """
        at = header.stamp  # type: ignore[attr-defined]
        stamp = seconds(at.sec, at.nanosec)
        entry = self._known(writer, received)
        self._heard_at = received
        if stamp == 0:
            return received
        if stamp <= entry.newest:
            self._not_newer += 1
            return None
        entry.newest, self._not_newer, self._newer_at = stamp, 0, received
        behind = self._now() - stamp
        self.behind = behind if self.behind is None else min(behind, self.behind, key=abs)
        return received - max(behind, 0.0) if self._shared else received

    def not_newer(self, name: str) -> str:
        """Say that all that comes of a name is dropped by now, as a sentence, or ''."""
        sentence = (
            f"{name} is stamped no later than before, so it is not used: see whether its source repeats itself, or set"
            " its clock by NTP and start the run again."
        )
        lasts = self._heard_at - self._newer_at > _NOT_NEWER_S
        return sentence if lasts and self._not_newer > _NOT_NEWER_MOST else ""

    def together(self) -> bool:
        """True if several writers publish at once."""
        instants = sorted(each.last_received for each in tuple(self._writers.values()))
        return len(instants) > 1 and instants[-1] - instants[-2] < _TOGETHER_S

    def _known(self, writer: int, received: float) -> _Writer:
        entry = self._writers.pop(writer, None) or _Writer(received, 0.0)
        entry.last_received = received
        if len(self._writers) >= _WRITERS:
            del self._writers[next(iter(self._writers))]
        self._writers[writer] = entry  # the last of them is the one heard last
        return entry
