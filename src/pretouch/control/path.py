"""Paths for the end-effector, driven by a phase, the arc length travelled and never the time; and eqs. 3 and 4."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pretouch.compiled import kernel
from pretouch.errors import PathError
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


def segment(start: tuple[float, float, float], end: tuple[float, float, float]) -> WayPoints:
    """Return the straight line between two points [m]."""
    return WayPoints(np.array([start, end]))


def nearest_phase(path: Path, position: FloatArray) -> float:
    """Return where the path comes nearest to a position (3,) [m], to within a two-hundredth of its length."""
    phases = np.linspace(0.0, path.length, _PLACES, endpoint=not path.closed)
    away = [float(((path.point(phase) - position) ** 2).sum()) for phase in phases]
    return float(phases[int(np.argmin(away))])


@kernel
def follow(
    point: FloatArray, tangent: FloatArray, speed: float, here: FloatArray, off_path: float, gain: float,
    velocity: FloatArray,
) -> float:  # fmt: skip
    """Write the task velocity x_d (3,) [m/s]: along the path, and towards it, no faster than the speed allowed by now.

    Off the path the forward part shrinks, to nothing at `off_path` [m]: the arm first returns to where it left. Returns
    that part, before it is limited [m/s].

    Args:
        point: (3,) of the path, where the end-effector should be [m].
        tangent: (3,) unit tangent there.
        speed: allowed by now [m/s].
        here: (3,) end-effector origin [m].
        off_path: see above.
        gain: of the way back to the path [1/s].
        velocity: written to.
    """
    x, y, z = point[0] - here[0], point[1] - here[1], point[2] - here[2]
    forward = speed * max(0.0, 1.0 - math.sqrt(x * x + y * y + z * z) / off_path)
    for i in range(3):  # feedforward along the path, feedback towards it
        velocity[i] = forward * tangent[i] + gain * (point[i] - here[i])
    size = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
    if size > speed:
        for i in range(3):
            velocity[i] *= speed / size  # as a whole: the direction stays
    return forward


@kernel
def advance(
    phase: float, tangent: FloatArray, asked: FloatArray, forward: float, commanded: FloatArray, period: float
) -> float:
    """Move the phase [m] on by one period of the forward speed, less what the arm falls short of it, never back.

    Slowing or blocking the arm so slows the phase. Motion back to the path is no progress along it, so an arm pushed
    ahead or back meets the path where it left.

    Args:
        phase: arc length so far [m].
        tangent: (3,) unit tangent there.
        asked: (3,) task velocity x_d, before eqs. 3-4 [m/s].
        forward: its speed along the path, before it is limited [m/s].
        commanded: (3,) velocity commanded at the end-effector origin [m/s].
        period: of control [s].
    """
    missing = 0.0  # what eqs. 3-4, the rows and the joint box took from it
    for i in range(3):
        missing += (asked[i] - commanded[i]) * tangent[i]
    return phase + max(0.0, forward - max(0.0, missing)) * period


@kernel
def speed_scale(distance: float, d_max: float) -> float:
    """Factor d_lowest / d_max on the end-effector velocity, eq. 3 of the paper; 1 beyond d_max.

    `distance` [m] is from the end-effector origin to the nearest obstacle, infinite if there is none.
    """
    # whichever way the arm moves: eq. 3 slows a retreat as well (docs/explanation/paper.md, slow-down while retreating)
    return min(1.0, distance / d_max)


@kernel
def faded_scale(scale: float, l_obs: int, l_max: int) -> float:
    """Factor s + (1 - s) l_obs / l_max of eq. 4 of the paper: back to full speed in l_max cycles after a loss."""
    return scale + (1.0 - scale) * min(1.0, l_obs / l_max)


@kernel
def reduce_speed(scale: float, cycles: int, fresh: float, l_max: int) -> tuple[float, float, int]:
    """One cycle of eqs. 3 and 4: the factor on the end-effector velocity, and the scale and cycles to remember.

    The fresh factor holds at once where it is the smaller one, and rises no faster than eq. 4 lets it: whether the
    nearest obstacle vanished, was seen again farther away, or left another one in view, the speed never jumps up.

    Args:
        scale: factor when it last fell or kept pace.
        cycles: l_obs since then.
        fresh: factor of eq. 3 for what is seen now, or less where a unit is silent; 1 for nothing.
        l_max: cycles until full speed is restored.
    """
    faded = faded_scale(scale, cycles + 1, l_max)
    if fresh <= faded:
        return fresh, fresh, 0
    # the factor at the loss stays, and the cycles count on: eq. 4 is linear in them and ends at 1 after l_max
    return faded, scale, cycles + 1
