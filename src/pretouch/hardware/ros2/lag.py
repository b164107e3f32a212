"""Whether an arm is where its controller was sent, told from how far it usually is behind."""

import numpy as np

from pretouch.hardware.ros2.trajectory import Reference
from pretouch.types import FloatArray

_MEMORY = 0.995
"""Weight of what was seen a turn earlier."""
_UNKNOWN_RAD2_S2 = 0.5
"""Sum of squared velocities from which a lag begins to be known [rad^2/s^2]."""
_MOST_S = 0.1
"""Largest lag that is reckoned with [s]."""


class Lag:
    """The time an arm is behind its commands, and its offset at rest, as learnt from its states."""

    def __init__(self, qdd_max: FloatArray) -> None:
        """Take the acceleration limits (n,) [rad/s^2]."""
        self._qdd_max, self._offset = qdd_max, np.zeros_like(qdd_max)
        self._moved = self._behind = 0.0

    @property
    def seconds(self) -> float:
        """The lag [s]."""
        return min(max(self._behind / (self._moved + _UNKNOWN_RAD2_S2), 0.0), _MOST_S)

    def rest(self, reference: Reference, instant: float, q: FloatArray) -> None:
        """Take the offset (n,) [rad] of an arm at rest as its usual one."""
        self._offset = reference.motion_at(instant)[0] - q

    def stray(self, reference: Reference, instant: float, q: FloatArray) -> FloatArray:
        """Return how far (n,) [rad] the arm is from where it usually would be, less what is unknown of its lag."""
        lag = self.seconds
        usual, _ = reference.motion_at(instant - lag)
        wanted, qd = reference.motion_at(instant)
        unknown = _MOST_S * np.abs(qd) * _UNKNOWN_RAD2_S2 / (self._moved + _UNKNOWN_RAD2_S2)
        # a lag may be a delay, or that of a filter: they differ by this where the velocity changes
        found = np.abs(usual - self._offset - q) - unknown - self._qdd_max * lag**2 / 2
        self._behind = _MEMORY * self._behind + float((wanted - self._offset - q) @ qd)
        self._moved = _MEMORY * self._moved + float(qd @ qd)
        return np.maximum(found, 0.0)
