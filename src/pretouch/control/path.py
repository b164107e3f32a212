"""Paths for the end-effector, driven by a phase: the arc length travelled, never the time."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pretouch.errors import PathError
from pretouch.params import TaskParams
from pretouch.types import FloatArray


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
        if not np.all(np.isfinite([*self.center, self.radius, self.start_angle])):
            raise PathError(f"The circle has center {self.center}, radius {self.radius} m: give finite numbers.")
        if self.radius <= 0:
            raise PathError(f"The circle has the radius {self.radius} m: it must be greater than 0.")

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
        return np.asarray(self.center) + self.radius * np.array([0.0, np.cos(angle), np.sin(angle)])

    def tangent(self, phase: float) -> FloatArray:
        """Return the unit tangent (3,) at an arc length [m]."""
        angle = self.start_angle + phase / self.radius
        return np.array([0.0, -np.sin(angle), np.cos(angle)])


class WayPoints:
    """Straight segments through given points; a line is the path through two."""

    def __init__(self, points: FloatArray, closed: bool = False) -> None:
        """Take W >= 2 points (W, 3) [m], base frame; `closed` leads from the last back to the first."""
        points = np.asarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2 or not np.all(np.isfinite(points)):
            raise PathError(f"The way-points are {points.tolist()}: give at least two finite points (x, y, z).")
        corners = np.vstack([points, points[:1]]) if closed else points
        steps = np.diff(corners, axis=0)
        lengths = np.sqrt((steps**2).sum(axis=1))
        if np.any(lengths < 1e-6):
            i = int(np.argmin(lengths))
            raise PathError(f"The way-points {i} and {i + 1} coincide at {corners[i].tolist()}: leave one out.")
        self.closed = closed
        self._corners = corners
        self._directions = steps / lengths[:, None]
        self._starts = np.concatenate([[0.0], np.cumsum(lengths)])
        self.length = float(self._starts[-1])

    def _locate(self, phase: float) -> tuple[int, float]:
        s = phase % self.length if self.closed else min(max(phase, 0.0), self.length)
        i = int(np.searchsorted(self._starts, s, side="right")) - 1
        i = min(i, len(self._directions) - 1)
        return i, s - self._starts[i]

    def point(self, phase: float) -> FloatArray:
        """Return the position (3,) [m] at an arc length [m]."""
        i, along = self._locate(phase)
        return np.asarray(self._corners[i] + along * self._directions[i])

    def tangent(self, phase: float) -> FloatArray:
        """Return the unit tangent (3,) at an arc length [m], zero at the end of an open path."""
        if not self.closed and phase >= self.length:
            return np.zeros(3)
        return np.asarray(self._directions[self._locate(phase)[0]])


def line(start: tuple[float, float, float], end: tuple[float, float, float]) -> WayPoints:
    """Return the straight line between two points [m]."""
    return WayPoints(np.array([start, end]))


@dataclass(frozen=True, slots=True)
class PathState:
    """How far along the path the task is."""

    phase: float = 0.0
    """Arc length travelled [m]."""
    speed: float = 0.0
    """Speed allowed by now [m/s]; grows with limited acceleration from 0 at the start and after each pause."""


def follow(path: Path, state: PathState, position: FloatArray, params: TaskParams) -> FloatArray:
    """Task velocity x_d (3,) [m/s]: along the path, and towards it, no faster than the speed allowed by now.

    Off the path the forward part shrinks, to nothing at `off_path_m`: the arm first returns to where it left.
    `position` (3,) [m] is the end-effector origin.
    """
    error = path.point(state.phase) - position
    velocity = _forward(error, state, params) * path.tangent(state.phase) + params.position_gain_1_s * error
    speed = float(np.sqrt(velocity @ velocity))
    return velocity if speed <= state.speed else velocity * (state.speed / speed)


def _forward(error: FloatArray, state: PathState, params: TaskParams) -> float:
    """Speed along the path [m/s] at a distance `error` (3,) [m] from it."""
    return state.speed * max(0.0, 1.0 - float(np.sqrt(error @ error)) / params.off_path_m)


def advance(path: Path, state: PathState, position: FloatArray, velocity: FloatArray, params: TaskParams) -> PathState:
    """Move the phase on by one period of the task's forward speed, less what the arm falls short of it, never back.

    Slowing or blocking the arm so slows the phase. The way back to the path is no way along it, so an arm pushed
    ahead or back meets the path where it left. The speed allowed next grows by the task's acceleration.

    Args:
        path: the path.
        state: phase and speed so far.
        position: (3,) end-effector origin [m].
        velocity: (3,) velocity commanded there [m/s].
        params: speed, gains and period.
    """
    missing = (follow(path, state, position, params) - velocity) @ path.tangent(state.phase)
    forward = _forward(path.point(state.phase) - position, state, params)
    phase = state.phase + max(0.0, forward - max(0.0, float(missing))) * params.control_period_s
    if not path.closed:
        phase = min(phase, path.length)
    return PathState(phase, min(params.speed_m_s, state.speed + params.acceleration_m_s2 * params.control_period_s))


def pause(state: PathState) -> PathState:
    """Stay at this phase, and start gently from it later."""
    return PathState(state.phase, 0.0)
