"""Joint states: those of our arm, in our order, out of whatever is published."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pretouch.types import FloatArray
from pretouch.values import value
from pretouch_ros2.stamps import Stamps

_NAMES_MOST = 1000
"""Joints of a message; one with more is nobody's whose joints are ours."""
_REMEMBERED = 64
"""Orders of names, and joints of others, that are kept: whoever publishes ever other names must not fill the memory."""


@value
class Measured:
    """Joints at one instant."""

    stamp: float
    """By this machine's monotonic clock [s]."""
    q: FloatArray
    """(n,) [rad]."""
    qd: FloatArray
    """(n,) [rad/s]."""


class Joints:
    """Takes in sensor_msgs/JointState: names in any order, with others beside them."""

    def __init__(self, names: Sequence[str], stamps: Stamps) -> None:
        self.names, self.stamps = tuple(names), stamps
        self.newest: Measured | None = None
        """What was measured last."""
        self.others: set[str] = set()
        """Joints named in messages that do not have all of ours; some of them, where there are many."""
        self.differentiated = False
        """Whether the messages have no velocities, so that they are taken from the positions."""
        self._places: dict[tuple[str, ...], list[int] | None] = {}

    def take(self, message: Any, received: float, writer: int) -> None:
        """Take a message in; one without all of our joints is another device's."""
        if len(message.name) > _NAMES_MOST:
            return
        places = self._where(tuple(message.name), len(message.position))
        if places is None:
            return
        stamp = self.stamps.instant(message.header, received, writer)
        if stamp is None:
            return
        q = np.array(message.position, dtype=np.float64)[places]
        qd = None
        if len(message.velocity) == len(message.position):
            qd = np.array(message.velocity, dtype=np.float64)[places]
        self.differentiated = qd is None or not np.isfinite(qd).all()
        self.newest = Measured(stamp, q, self._difference(stamp, q) if qd is None or self.differentiated else qd)

    @property
    def missing(self) -> tuple[str, ...]:
        """Our joints that no message has named."""
        return tuple(name for name in self.names if name not in self.others)

    def _where(self, names: tuple[str, ...], positions: int) -> list[int] | None:
        if names not in self._places:
            if len(self._places) >= _REMEMBERED:
                self._places.clear()
            known = {name: i for i, name in enumerate(names)}
            complete = all(name in known for name in self.names)
            self._places[names] = [known[name] for name in self.names] if complete else None
        places = self._places[names]
        if places is None:
            ours = set(self.names).intersection(names)
            self.others |= ours | set(names[: max(_REMEMBERED - len(self.others), 0)])
        return places if places is not None and positions == len(names) else None

    def _difference(self, stamp: float, q: FloatArray) -> FloatArray:
        """Velocities (n,) [rad/s] since the last positions."""
        last = self.newest
        if last is None or not stamp > last.stamp:
            return np.zeros(len(q))
        return (q - last.q) / (stamp - last.stamp)
