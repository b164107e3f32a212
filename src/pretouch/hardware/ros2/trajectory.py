"""Joint velocity commands as short trajectories that end at rest, so that an arm that gets no other one stops.

A trajectory goes from where the one before had brought the arm to the commanded velocity within a period, keeps it for
a while, and brakes each joint as hard as it may, all with velocities that are linear in between. Its first way-point
lies at the end of that while: who follows it gets there by a cubic spline from where he is, and a message that came a
little early or late only bends that.

A controller that holds each command for a period and brakes in such steps ends exactly where these ramps do, if it
takes positions for ahead of the ramp by half a period: `Reference.at` gives those, and joint limits rest on them.
"""

import math
from collections import deque
from collections.abc import Iterator

import numpy as np

from pretouch.types import FloatArray
from pretouch.values import value

_REMEMBERED = 32
"""Trajectories kept: a state that is late is of one before the last."""
_FINEST_S = 1e-6
"""Shortest time between two points [s]: they must differ."""


@value
class Motion:
    """Positions and velocities at instants, the latter linear in between; at rest before and behind."""

    time: FloatArray
    """(m,) since its begin, the first 0 [s]."""
    q: FloatArray
    """(m, n) [rad]."""
    qd: FloatArray
    """(m, n) [rad/s], the last 0."""
    first: int = 1
    """Which of the instants is the first way-point."""

    def way_points(self) -> Iterator[tuple[float, FloatArray, FloatArray]]:
        """Yield times [s], positions and velocities (n,) from where the velocity was kept for a while on."""
        yield from zip(self.time[self.first :].tolist(), self.q[self.first :], self.qd[self.first :], strict=True)

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities (n,) at a time since the begin [s]."""
        i = int(np.searchsorted(self.time, time, side="right")) - 1
        if i < 0 or i >= len(self.time) - 1:
            place = 0 if i < 0 else -1
            return self.q[place], self.qd[place]
        step = time - self.time[i]
        slope = (self.qd[i + 1] - self.qd[i]) / (self.time[i + 1] - self.time[i])
        return self.q[i] + (self.qd[i] + slope * step / 2) * step, self.qd[i] + slope * step


def motion(
    q: FloatArray, qd: FloatArray, wanted: FloatArray, qdd_max: FloatArray, period: float, hold: float
) -> Motion:
    """Go from q and qd (n,) to wanted velocities (n,) [rad/s], hold them, and brake, within `qdd_max` (n,) [rad/s^2].

    Args:
        q: [rad].
        qd: [rad/s].
        wanted: [rad/s].
        qdd_max: limits.
        period: time for the change of velocity, unless the limits need a longer one [s].
        hold: when braking begins, unless the change takes longer [s].
    """
    ramp = max(period, float((np.abs(wanted - qd) / qdd_max).max()))
    brake = max(ramp, hold)
    stops = np.unique(np.ceil(np.abs(wanted) / qdd_max / _FINEST_S) * _FINEST_S)
    kept = brake - ramp > _FINEST_S
    time = np.concatenate([[0.0, ramp], [brake] if kept else [], brake + stops[stops > 0]])
    speed = np.maximum(np.abs(wanted) - qdd_max * np.maximum(time[1:, None] - brake, 0.0), 0.0) * np.sign(wanted)
    speed[-1] = 0.0  # and no rounding error of it
    qd = np.vstack([qd, speed])
    steps = (qd[1:] + qd[:-1]) / 2 * np.diff(time)[:, None]
    return Motion(time, np.vstack([q, q + np.cumsum(steps, axis=0)]), qd, 2 if kept else 1)


class Reference:
    """What the arm's motion generator is at, reckoned from the trajectories it was sent."""

    def __init__(self, qdd_max: FloatArray, period: float, hold: float) -> None:
        self._qdd_max, self._period, self._hold = qdd_max, period, hold
        self._sent: deque[tuple[float, Motion, FloatArray]] = deque(maxlen=_REMEMBERED)

    @property
    def begun(self) -> bool:
        """Whether anything was sent."""
        return bool(self._sent)

    @property
    def ends(self) -> float:
        """When the last trajectory ends [s]; in the past if there is none."""
        if not self._sent:
            return -math.inf
        began, course, _ = self._sent[-1]
        return began + float(course.time[-1])

    def begin(self, q: FloatArray, now: float, settle: float) -> Motion:
        """Begin at rest at q (n,) [rad], to be reached within a time [s]."""
        still = np.zeros_like(q)
        self._sent.append((now, Motion(np.array([0.0, settle]), np.stack([q, q]), np.stack([still, still])), still))
        return self._sent[-1][1]

    def command(self, wanted: FloatArray, now: float) -> Motion:
        """Go on to wanted velocities (n,) [rad/s] from an instant on [s]."""
        q, qd = self.motion_at(now)
        self._sent.append((now, motion(q, qd, wanted, self._qdd_max, self._period, self._hold), wanted.copy()))
        return self._sent[-1][1]

    def motion_at(self, instant: float) -> tuple[FloatArray, FloatArray]:
        """Return positions [rad] and velocities [rad/s] (n,) that were asked for at an instant [s]."""
        began, course, _ = self._active(instant)
        return course.at(instant - began)

    def at(self, instant: float) -> tuple[FloatArray, FloatArray]:
        """Return the commanded positions and velocities (n,) at an instant [s], as of a set-point that is held."""
        began, course, wanted = self._active(instant)
        q, qd = course.at(instant - began)
        kept = instant - began <= max(self._hold, float(course.time[1]))
        return q + qd * self._period / 2, wanted if kept else qd

    def _active(self, instant: float) -> tuple[float, Motion, FloatArray]:
        for sent in reversed(self._sent):
            if sent[0] <= instant:
                return sent
        return self._sent[0]
