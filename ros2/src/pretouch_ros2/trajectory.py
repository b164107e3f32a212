"""Joint velocity commands as short trajectories that end at rest, so that an arm that gets no other one stops.

A trajectory goes from where the one before had brought the arm to the commanded velocity within a period, keeps it for
a while, and brakes each joint as hard as it may, all with velocities that are linear in between. Cubic splines through
these points are exactly that.

It can be sent in two ways. With its past (`Reference.passed`), whoever follows it by a clock that is the same goes on
as if there were no messages, as long as each comes before it begins. By its way-points alone, the first of which lies
at the end of that while, he gets there by a spline from where he is, and a message that came early or late bends that.

A controller that holds each command for a period and brakes in such steps ends exactly where these ramps do, if it
takes positions for ahead of the ramp by half a period: `Reference.at` gives those, and joint limits rest on them.
"""

import math
from collections import deque
from collections.abc import Iterator
from itertools import islice

import numpy as np

from pretouch.types import FloatArray
from pretouch.values import value

_REMEMBERED = 32
"""Trajectories kept: a state that is late is of one before the last."""
_FINEST_S = 1e-6
"""Shortest time between two points [s]: they must differ."""
_NEAREST_S = 1e-4
"""Shortest time between two points that are passed [s]: so little bends nothing."""


@value
class StoppingTrajectory:
    """Positions and velocities at instants, the latter linear in between; at rest before and behind."""

    time: FloatArray
    """(m,) since its begin, the first 0 [s]."""
    q: FloatArray
    """(m, n) [rad]."""
    qd: FloatArray
    """(m, n) [rad/s], the last 0."""
    first: int = 1
    """Index of the instant of the first way-point."""

    def points(self) -> Iterator["TrajectoryPoint"]:
        """Yield all points, the first at its begin."""
        for time, q, qd in zip(self.time.tolist(), self.q, self.qd, strict=True):
            yield TrajectoryPoint(time, q, qd)

    def way_points(self) -> Iterator["TrajectoryPoint"]:
        """Yield the points from where the velocity was kept for a while on."""
        yield from islice(self.points(), self.first, None)

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities (n,) at a time since the begin [s]."""
        i = int(np.searchsorted(self.time, time, side="right")) - 1
        if i < 0 or i >= len(self.time) - 1:
            place = 0 if i < 0 else -1
            return self.q[place], self.qd[place]
        step = time - self.time[i]
        slope = (self.qd[i + 1] - self.qd[i]) / (self.time[i + 1] - self.time[i])
        return self.q[i] + (self.qd[i] + slope * step / 2) * step, self.qd[i] + slope * step


def stopping_trajectory(
    q: FloatArray, qd: FloatArray, velocity: FloatArray, qdd_max: FloatArray, period: float, hold: float
) -> StoppingTrajectory:
    """Go from q and qd (n,) to velocities (n,) [rad/s], hold them, and brake, within `qdd_max` (n,) [rad/s^2].

    The change of velocity takes `period` [s], unless the limits need longer; braking begins at `hold` [s], or when the
    change is complete.
    """
    ramp = max(period, float((np.abs(velocity - qd) / qdd_max).max()))
    brake = max(ramp, hold)
    stops = np.unique(np.ceil(np.abs(velocity) / qdd_max / _FINEST_S) * _FINEST_S)
    holds = brake - ramp > _FINEST_S
    time = np.concatenate([[0.0, ramp], [brake] if holds else [], brake + stops[stops > 0]])
    speed = np.maximum(np.abs(velocity) - qdd_max * np.maximum(time[1:, None] - brake, 0.0), 0.0) * np.sign(velocity)
    speed[-1] = 0.0  # and no rounding error of it
    qd = np.vstack([qd, speed])
    steps = (qd[1:] + qd[:-1]) / 2 * np.diff(time)[:, None]
    return StoppingTrajectory(time, np.vstack([q, q + np.cumsum(steps, axis=0)]), qd, 2 if holds else 1)


@value
class TrajectoryPoint:
    """Target at a time relative to the begin of a trajectory."""

    time: float
    """[s]; negative: passed already."""
    q: FloatArray
    """(n,) [rad]."""
    qd: FloatArray
    """(n,) [rad/s]."""


@value
class _SentTrajectory:
    """A trajectory and what it was made of."""

    began: float
    trajectory: StoppingTrajectory
    velocity: FloatArray


class Reference:
    """State of the arm's motion generator, computed from the trajectories it was sent."""

    def __init__(self, qdd_max: FloatArray, period: float, hold: float) -> None:
        """Take the limits (n,) [rad/s^2], the control period and how long a velocity is held [s]."""
        self._qdd_max, self._period, self._hold = qdd_max, period, hold
        self._sent: deque[_SentTrajectory] = deque(maxlen=_REMEMBERED)

    @property
    def begun(self) -> bool:
        """True if anything was sent."""
        return bool(self._sent)

    @property
    def ends(self) -> float:
        """End of the last trajectory [s]; in the past if there is none."""
        return self._sent[-1].began + float(self._sent[-1].trajectory.time[-1]) if self._sent else -math.inf

    def begin(self, q: FloatArray, now: float, settle: float) -> StoppingTrajectory:
        """Begin, or begin anew, at rest at q (n,) [rad], to be reached within a time [s]."""
        still = np.zeros_like(q)
        trajectory = StoppingTrajectory(np.array([0.0, settle]), np.stack([q, q]), np.stack([still, still]))
        self._sent.clear()
        self._sent.append(_SentTrajectory(now, trajectory, still))
        return trajectory

    def command(self, velocity: FloatArray, now: float) -> StoppingTrajectory:
        """Go on to velocities (n,) [rad/s] from an instant on [s]."""
        q, qd = self.motion_at(now)
        self._sent.append(
            _SentTrajectory(
                now, stopping_trajectory(q, qd, velocity, self._qdd_max, self._period, self._hold), velocity.copy()
            )
        )
        return self._sent[-1].trajectory

    def passed(self, now: float, past: float) -> tuple[TrajectoryPoint, ...]:
        """Return the requested motion in a time [s] before an instant [s]: its begin, and each change since."""
        begins = [sent.began for sent in self._sent]
        places = [now - past]
        for sent, until in zip(self._sent, [*begins[1:], math.inf], strict=True):
            knots = sent.began + sent.trajectory.time
            places += knots[knots < min(until, now) - _NEAREST_S].tolist()
        points: list[TrajectoryPoint] = []
        for place in sorted(p for p in places if now - past <= p < now - _NEAREST_S):
            if not points or place - now > points[-1].time + _NEAREST_S:
                points.append(TrajectoryPoint(place - now, *self.motion_at(place)))
        return tuple(points)

    def motion_at(self, instant: float) -> tuple[FloatArray, FloatArray]:
        """Return positions [rad] and velocities [rad/s] (n,) that were requested at an instant [s]."""
        sent = self._active(instant)
        return sent.trajectory.at(instant - sent.began)

    def at(self, instant: float) -> tuple[FloatArray, FloatArray]:
        """Return the commanded positions and velocities (n,) at an instant [s], as of a set-point that is held."""
        sent = self._active(instant)
        q, qd = sent.trajectory.at(instant - sent.began)
        holds = instant - sent.began <= max(self._hold, float(sent.trajectory.time[1]))
        return q + qd * self._period / 2, sent.velocity if holds else qd

    def _active(self, instant: float) -> _SentTrajectory:
        for sent in reversed(self._sent):
            if sent.began <= instant:
                return sent
        return self._sent[0]
