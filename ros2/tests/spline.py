"""What a joint_trajectory_controller asks its arm for, as ros2_controllers computes it in several releases.

All go by cubic Hermite splines through the points of the newest message. They differ in where they think they are as it
comes, which counts until its first point, and in the instant they sample, once each period P at t:

- humble (to 4.16): the last command is taken to be at t, and t is sampled: a message makes it stand for a period.
- 4.17 (to 4.20): the last command is taken to be at t, and t + P is sampled: consistent.
- 4.21 (on): the last command, which was sampled for t, is taken to be at t - P, and t + P is sampled: a message makes
  it go two steps at once.
"""

from itertools import pairwise
from typing import Any, Literal

import numpy as np

Release = Literal["humble", "4.17", "4.21"]
State = tuple[np.ndarray, np.ndarray]


def hermite(t0: float, start: State, t1: float, end: State, t: float) -> State:
    (q0, v0), (q1, v1), T, s = start, end, t1 - t0, t - t0
    if T <= 0:
        return end
    c, d = 3 * (q1 - q0) / T**2 - (2 * v0 + v1) / T, -2 * (q1 - q0) / T**3 + (v0 + v1) / T**2
    return q0 + v0 * s + c * s**2 + d * s**3, v0 + 2 * c * s + 3 * d * s**2


class Spline:
    """One controller: `take` messages, `update` each period."""

    def __init__(self, release: Release, period: float, names: list[str], q: np.ndarray) -> None:
        self.release, self.period, self.names = release, period, names
        self.commanded: State = (q.copy(), np.zeros_like(q))
        self._last: float | None = None
        self._begin: tuple[float, State] = (0.0, self.commanded)
        self._points: list[tuple[float, State]] = []
        self._new: tuple[float, list[tuple[float, State]]] | None = None

    def take(self, message: Any, day: float) -> None:
        """Take a message in; `day` is the time of day at the instant 0 of `update` [s]."""
        order = [message.joint_names.index(name) for name in self.names]
        after = [p.time_from_start.sec + p.time_from_start.nanosec / 1e9 for p in message.points]
        assert after[0] >= 0
        assert all(a < b for a, b in pairwise(after)), after
        assert not np.any(message.points[-1].velocities)
        points = [(t, (p.positions[order], p.velocities[order])) for t, p in zip(after, message.points, strict=True)]
        stamp = message.header.stamp
        self._new = (stamp.sec - day + stamp.nanosec / 1e9 if stamp.sec else np.nan, points)

    def restart(self, q: np.ndarray) -> None:
        """Be deactivated, and activated again with the arm at q."""
        self.commanded, self._points, self._last, self._new = (q.copy(), np.zeros_like(q)), [], None, None

    def update(self, now: float) -> np.ndarray:
        """Return the positions commanded at an instant [s]."""
        if self._new is not None:
            start, points = self._new
            start = now if np.isnan(start) else start
            if start + points[-1][0] >= now:  # or else it is rejected
                self._points = [(start + t, state) for t, state in points]
                thought = self._last if self.release == "4.21" and self._last is not None else now
                self._begin = thought, self.commanded
            self._new = None
        if self._points:
            self.commanded = self._sample(now if self.release == "humble" else now + self.period)
        self._last = now
        return self.commanded[0]

    def _sample(self, t: float) -> State:
        begin, state = self._begin
        if t < begin:
            return state
        if t < self._points[0][0]:
            return hermite(begin, state, *self._points[0], t)
        for (t0, start), (t1, end) in pairwise(self._points):
            if t0 <= t < t1:
                return hermite(t0, start, t1, end, t)
        return self._points[-1][1]
