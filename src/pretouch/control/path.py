"""Paths for the end-effector, driven by a phase: the arc length travelled, never the time."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pretouch.errors import PathError
from pretouch.params import TaskParams
from pretouch.types import FloatArray
from pretouch.values import value


class Path(Protocol):
    """A curve in the base frame, parametrised by arc length [m]."""

    @property
    def length(self) -> float:
        """Length of one pass [m]."""
        ...

    @property
    def closed(self) -> bool:
        """Whether the end is the start, so that it is run again and again."""
        ...

    def point(self, phase: float) -> FloatArray:
        """Return the position (3,) [m] at an arc length [m]."""
        ...

    def tangent(self, phase: float) -> FloatArray:
        """Return the unit tangent (3,) at an arc length [m], zero at the end of an open path."""
        ...


_LARGEST = 1000.0
"""Largest number that describes a path [m, rad]: any larger one is a mistake."""

_SHORTEST = 1e-6
"""Shortest radius or segment [m]."""

_PLACES = 400
"""Places of a path that are looked at for where to join it."""


@dataclass(frozen=True)
class Circle:
    """A circle in the base frame's y-z plane, counter-clockwise seen from +x (paper, IV-A)."""

    center: tuple[float, float, float] = (0.5, 0.0, 0.25)
    """[m]"""
    radius: float = 0.25
    """[m]"""
    start_angle: float = 0.0
    """Where it begins, from +y towards +z [rad]."""

    def __post_init__(self) -> None:
        if not np.all(np.abs([*self.center, self.start_angle]) <= _LARGEST):
            raise PathError(
                f"The circle has center {self.center} m and start angle {self.start_angle} rad: give finite numbers,"
                f" none beyond {_LARGEST:g}."
            )
        if not _SHORTEST <= self.radius <= _LARGEST:
            raise PathError(
                f"The circle has the radius {self.radius} m: it must be from {_SHORTEST:g} to {_LARGEST:g}."
            )

    @property
    def length(self) -> float:
        """Circumference [m]."""
        return 2 * np.pi * self.radius

    @property
    def closed(self) -> bool:
        """Whether it is run again and again: always."""
        return True

    def point(self, phase: float) -> FloatArray:
        """Return the position (3,) [m] at an arc length [m]."""
        angle = self.start_angle + phase / self.radius
        x, y, z = self.center
        return np.array((x, y + self.radius * math.cos(angle), z + self.radius * math.sin(angle)))

    def tangent(self, phase: float) -> FloatArray:
        """Return the unit tangent (3,) at an arc length [m]."""
        angle = self.start_angle + phase / self.radius
        return np.array((0.0, -math.sin(angle), math.cos(angle)))


class WayPoints:
    """Straight segments through given points; a line is the path through two."""

    def __init__(self, points: FloatArray, closed: bool = False) -> None:
        """Take W >= 2 points (W, 3) [m], base frame; `closed` leads from the last back to the first."""
        points = np.asarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2 or not np.all(np.abs(points) <= _LARGEST):
            raise PathError(
                f"The way-points are {points.tolist()}: give at least two finite points (x, y, z), none beyond"
                f" {_LARGEST:g} m."
            )
        corners = np.vstack([points, points[:1]]) if closed else points
        steps = np.diff(corners, axis=0)
        lengths = np.sqrt((steps**2).sum(axis=1))
        if np.any(lengths < _SHORTEST):
            i = int(np.argmin(lengths))
            raise PathError(f"The way-points {i} and {i + 1} coincide at {corners[i].tolist()}: leave one out.")
        self.closed = closed
        self._corners: list[list[float]] = corners.tolist()
        self._directions: list[list[float]] = (steps / lengths[:, None]).tolist()
        self._starts: list[float] = [0.0, *np.cumsum(lengths).tolist()]
        self.length = self._starts[-1]

    @property
    def points(self) -> FloatArray:
        """The given points (W, 3) [m]."""
        return np.array(self._corners[: len(self._corners) - self.closed])

    def _locate(self, phase: float) -> tuple[int, float]:
        # at the end of an open path no segment begins: the last one holds it
        s = phase % self.length if self.closed else min(max(phase, 0.0), self.length)
        i = min(bisect_right(self._starts, s), len(self._directions)) - 1
        return i, s - self._starts[i]

    def point(self, phase: float) -> FloatArray:
        """Return the position (3,) [m] at an arc length [m]."""
        i, along = self._locate(phase)
        (x, y, z), (u, v, w) = self._corners[i], self._directions[i]
        return np.array((x + along * u, y + along * v, z + along * w))

    def tangent(self, phase: float) -> FloatArray:
        """Return the unit tangent (3,) at an arc length [m], zero at the end of an open path."""
        if not self.closed and phase >= self.length:
            return np.zeros(3)
        return np.array(self._directions[self._locate(phase)[0]])


def line(start: tuple[float, float, float], end: tuple[float, float, float]) -> WayPoints:
    """Return the straight line between two points [m]."""
    return WayPoints(np.array([start, end]))


@value
class PathState:
    """How far along the path the task is."""

    phase: float = 0.0
    """Arc length travelled [m]."""
    speed: float = 0.0
    """Speed allowed by now [m/s]; grows with limited acceleration from 0 at the start and after each pause."""


Vector = tuple[float, float, float]


def joined(path: Path, position: FloatArray) -> PathState:
    """Begin where the path comes nearest to a position (3,) [m], to within a two-hundredth of its length."""
    phases = np.linspace(0.0, path.length, _PLACES, endpoint=not path.closed)
    away = [float(((path.point(phase) - position) ** 2).sum()) for phase in phases]
    return PathState(float(phases[int(np.argmin(away))]))


@value
class Following:
    """The path at one phase, and how to follow it from where the end-effector is."""

    point: FloatArray
    """(3,) where on the path the end-effector should be [m]."""
    tangent: Vector
    """Unit tangent there."""
    velocity: Vector
    """Task velocity x_d [m/s]."""
    forward: float
    """Its speed along the path, before it is limited [m/s]."""

    def scaled(self, scale: float) -> FloatArray:
        """Task velocity (3,) [m/s] times a factor."""
        x, y, z = self.velocity
        return np.array((scale * x, scale * y, scale * z))


def follow(path: Path, state: PathState, position: FloatArray, params: TaskParams) -> Following:
    """Task velocity x_d: along the path, and towards it, no faster than the speed allowed by now.

    Off the path the forward part shrinks, to nothing at `off_path_m`: the arm first returns to where it left.
    `position` (3,) [m] is the end-effector origin.
    """
    # for three numbers, floats are faster than arrays
    point = np.array(path.point(state.phase), dtype=np.float64)  # a copy: a path may hand out the same array again
    tx, ty, tz = np.asarray(path.tangent(state.phase), dtype=np.float64).tolist()
    (px, py, pz), (x, y, z) = point.tolist(), position.tolist()
    ex, ey, ez = px - x, py - y, pz - z
    # feedforward along the path, feedback towards it
    forward = state.speed * max(0.0, 1.0 - math.hypot(ex, ey, ez) / params.off_path_m)
    gain = params.position_gain_1_s
    vx, vy, vz = forward * tx + gain * ex, forward * ty + gain * ey, forward * tz + gain * ez
    speed = math.hypot(vx, vy, vz)
    if speed > state.speed:
        limit = state.speed / speed  # as a whole: the direction stays
        vx, vy, vz = limit * vx, limit * vy, limit * vz
    return Following(point, (tx, ty, tz), (vx, vy, vz), forward)


def advance(path: Path, state: PathState, following: Following, velocity: FloatArray, params: TaskParams) -> PathState:
    """Move the phase on by one period of the task's forward speed, less what the arm falls short of it, never back.

    Slowing or blocking the arm so slows the phase. Motion back to the path is no progress along it, so an arm pushed
    ahead or back meets the path where it left. The speed allowed next grows by the task's acceleration.

    Args:
        path: the path.
        state: phase and speed so far.
        following: how it is followed from there.
        velocity: (3,) velocity commanded at the end-effector origin [m/s].
        params: speed, gains and period.
    """
    (tx, ty, tz), (ax, ay, az), (vx, vy, vz) = following.tangent, following.velocity, velocity.tolist()
    missing = (ax - vx) * tx + (ay - vy) * ty + (az - vz) * tz
    # `following.velocity` is that before eqs. 3-4: missing is what they, the rows and the joint box took from it
    phase = state.phase + max(0.0, following.forward - max(0.0, missing)) * params.control_period_s
    if not path.closed:
        phase = min(phase, path.length)
    return PathState(phase, min(params.speed_m_s, state.speed + params.acceleration_m_s2 * params.control_period_s))


def pause(state: PathState) -> PathState:
    """Stay at this phase, and start gently from it later."""
    return PathState(state.phase, 0.0)
