"""The motion by which units are calibrated, as a value: postures to stand in, ways between them, and swings."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pretouch.types import FloatArray
from pretouch.values import value


@dataclass(frozen=True, eq=False)
class Swing:
    """Sines on all joints at once about a posture, F a joint, faded in and out so that it begins and ends at rest."""

    begin: float
    """[s]"""
    duration: float
    """[s]"""
    fade: float
    """Time it takes to fade in, and out [s]."""
    amplitude: FloatArray
    """(F, n) [rad]."""
    frequency: FloatArray
    """(F, n) [Hz]."""
    phase: FloatArray
    """(F, n) [rad]."""

    def states(self, time: FloatArray) -> FloatArray:
        """Deviation from the posture, its velocity and acceleration (3, T, n) at instants (T,) [s]."""
        since = time - self.begin
        rise, fall = _smooth_step(since / self.fade), _smooth_step((self.duration - since) / self.fade)
        # the fades do not overlap, so that either is constant while the other changes
        window, slope = rise[0] * fall[0], (rise[1] - fall[1]) / self.fade
        bend = (rise[2] + fall[2]) / self.fade**2
        rate = 2.0 * np.pi * self.frequency
        angle = rate * since[:, None, None] + self.phase
        x = (self.amplitude * np.sin(angle)).sum(axis=1)
        v = (self.amplitude * rate * np.cos(angle)).sum(axis=1)
        a = (-self.amplitude * rate**2 * np.sin(angle)).sum(axis=1)
        w, w1, w2 = window[:, None], slope[:, None], bend[:, None]
        return np.stack([w * x, w1 * x + w * v, w2 * x + 2.0 * w1 * v + w * a])


@value
class PlanSamples:
    """A plan at T instants."""

    time: FloatArray
    """(T,) since its beginning [s]."""
    q: FloatArray
    """(T, n) [rad]."""
    qd: FloatArray
    """(T, n) [rad/s]."""
    qdd: FloatArray
    """(T, n) [rad/s^2]."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion that begins and ends at rest in the same posture, unless it is the way to another plan's start.

    From one knot to the next the arm stands, or goes straight in joint space with the least jerk; swings are added to
    where it stands. Positions are twice differentiable by time throughout.
    """

    knots: FloatArray
    """(K,) increasing instants, the first is 0 [s]."""
    postures: FloatArray
    """(K, n) joint positions at the knots, without swings [rad]."""
    swings: tuple[Swing, ...] = ()
    """Each lies between two knots of one posture."""

    @property
    def start(self) -> FloatArray:
        """Posture (n,) it begins in [rad]."""
        return self.postures[0]

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.knots[-1])

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Joint positions [rad] and velocities [rad/s], (n,) each, at a time since the beginning [s].

        At rest before the beginning and after the end.
        """
        q, qd, _ = self._states(np.array([time]))
        return q[0], qd[0]

    def sampled(self, rate: float) -> PlanSamples:
        """Return it at equal intervals, about `rate` of them a second [Hz], beginning and end included."""
        time = np.linspace(0.0, self.duration, max(2, int(np.ceil(self.duration * rate)) + 1))
        return PlanSamples(time, *self._states(time))

    def save(self, path: Path, rate: float = 1000.0) -> None:
        """Write it as CSV for another program to play: time_s, q1_rad to qn_rad, qd1_rad_s to qdn_rad_s."""
        numbers = range(1, len(self.start) + 1)
        samples = self.sampled(rate)
        names = ["time_s", *(f"q{i}_rad" for i in numbers), *(f"qd{i}_rad_s" for i in numbers)]
        table = np.column_stack([samples.time, samples.q, samples.qd])
        np.savetxt(path, table, "%.9g", ",", header=",".join(names), comments="")

    def _states(self, time: FloatArray) -> FloatArray:
        """Joint positions, velocities and accelerations (3, T, n) at instants (T,) [s]."""
        # the first and the last span reach to the ends of time
        span = np.clip(np.searchsorted(self.knots, time, side="right") - 1, 0, len(self.knots) - 2)
        length, change = np.diff(self.knots)[span], np.diff(self.postures, axis=0)[span]
        way = _smooth_step((time - self.knots[span]) / length)
        states = np.stack([(way[i] / length**i)[:, None] * change for i in range(3)])
        states[0] += self.postures[span]
        for swing in self.swings:
            during = (time > swing.begin) & (time < swing.begin + swing.duration)
            if during.any():
                states[:, during] += swing.states(time[during])
        return states


def _smooth_step(part: FloatArray) -> FloatArray:
    """Return the least-jerk step from 0 to 1, at rest before 0 and after 1, and two derivatives (3, T)."""
    s = np.clip(part, 0.0, 1.0)
    return np.stack(
        [s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 30.0 * s**2 * (1.0 - s) ** 2, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)]
    )
