"""Joint states: those of our arm, in our order, out of whatever is published."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pretouch.types import FloatArray
from pretouch.values import value
from pretouch_ros2.stamps import SourceStamps

_NAMES_MOST = 1000
"""Joints of a message; one with more is nobody's whose joints are ours."""
_OTHERS_MOST = 64
"""Joints of others that are kept: whoever publishes ever other names must not fill the memory."""


@value
class JointReading:
    """Joints at one instant."""

    stamp: float
    """By this machine's monotonic clock [s]."""
    q: FloatArray
    """(n,) [rad]."""
    qd: FloatArray
    """(n,) [rad/s]."""


def places_of(ours: Sequence[str], names: Sequence[str]) -> list[int] | None:
    """Return where our joints stand among the names of a message; None unless it has all of them."""
    if len(names) > _NAMES_MOST:
        return None
    places = {name: i for i, name in enumerate(names)}
    return [places[name] for name in ours] if all(name in places for name in ours) else None


class Joints:
    """Takes in sensor_msgs/JointState: names in any order, with others beside them."""

    def __init__(self, names: Sequence[str], stamps: SourceStamps) -> None:
        self.names, self.stamps = tuple(names), stamps
        self.newest: JointReading | None = None
        """What was measured last."""
        self.others: set[str] = set()
        """Joints named in messages that do not have all of ours; some of them, where there are many."""
        self.differentiated = False
        """Whether the messages have no velocities, so that they are taken from the positions."""

    def take(self, message: Any, received: float, writer: int) -> None:
        """Take a message in; one without all of our joints is another device's."""
        places = places_of(self.names, message.name)
        if places is None:
            few = message.name[:_NAMES_MOST]
            self.others |= set(self.names).intersection(few) | set(few[: max(_OTHERS_MOST - len(self.others), 0)])
            return
        if len(message.position) != len(message.name):
            return
        stamp = self.stamps.instant(message.header, received, writer)
        if stamp is None:
            return
        q = np.array(message.position, dtype=np.float64)[places]
        complete = len(message.velocity) == len(message.position)
        qd = np.array(message.velocity, dtype=np.float64)[places] if complete else None
        self.differentiated = qd is None or not np.isfinite(qd).all()
        self.newest = JointReading(stamp, q, self._difference(stamp, q) if qd is None or self.differentiated else qd)

    @property
    def missing(self) -> tuple[str, ...]:
        """Our joints that no message has named."""
        return tuple(name for name in self.names if name not in self.others)

    def _difference(self, stamp: float, q: FloatArray) -> FloatArray:
        """Velocities (n,) [rad/s] since the last positions."""
        last = self.newest
        if last is None or not stamp > last.stamp:
            return np.zeros(len(q))
        return (q - last.q) / (stamp - last.stamp)
