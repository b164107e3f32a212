"""Paths of the end-effector by their phase, the arc length travelled, never by time; and eqs. 3 and 4."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Annotated, NamedTuple, Protocol

import numpy as np

from pretouch.compiled import kernel
from pretouch.errors import PathError
from pretouch.params import TaskParams
from pretouch.records import Cell, IntCell
from pretouch.types import FloatArray


class Path(Protocol):
    """A curve in the base frame, parametrised by arc length [m]."""

    @property
    def length(self) -> float:
        """Length of one pass [m]."""
        ...

    @property
    def closed(self) -> bool:
        """True if the end is the start, so that the path repeats."""
        ...

    def point(self, phase: float) -> FloatArray:
        """Return the position (3,) [m] at an arc length [m]."""
        ...

    def tangent(self, phase: float) -> FloatArray:
        """Return the unit tangent (3,) at an arc length [m], zero at the end of an open path."""
        ...


_LARGEST = 1000.0
"""Largest number of a path [m, rad]: a larger one is a mistake."""

_SHORTEST = 1e-6
"""Shortest radius or segment [m]."""

_PLACES = 400
"""Points of a path among which the nearest is chosen to join it."""


@dataclass(frozen=True)
class Circle:
    """A circle in the base frame's y-z plane, counter-clockwise seen from +x (paper, IV-A)."""

    center: tuple[float, float, float] = (0.5, 0.0, 0.25)
    """[m]"""
    radius: float = 0.25
    """[m]"""
    start_angle: float = 0.0
    """Angle of the start, from +y towards +z [rad]."""

    def __post_init__(self) -> None:
        if not (np.all(np.abs([*self.center, self.start_angle]) <= _LARGEST) and _SHORTEST <= self.radius <= _LARGEST):
            raise PathError(
                f"The circle has center {self.center} m, radius {self.radius} m and start angle {self.start_angle} rad:"
                f" give finite numbers, none beyond {_LARGEST:g}, and a radius of at least {_SHORTEST:g}."
            )

    @property
    def length(self) -> float:
        """Circumference [m]."""
        return 2 * np.pi * self.radius

    @property
    def closed(self) -> bool:
        """True: the circle repeats."""
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
    """Straight segments through points; a line is the path through two."""

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
        """Way-points (W, 3) [m]."""
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
    """Return the phase nearest to a position (3,) [m], to within a two-hundredth of the path's length."""
    phases = np.linspace(0.0, path.length, _PLACES, endpoint=not path.closed)
    away = [float(((path.point(phase) - position) ** 2).sum()) for phase in phases]
    return float(phases[int(np.argmin(away))])


class OnPath(NamedTuple):
    """The path at the phase of a step."""

    phase: Cell
    """Arc length travelled along the path [m]."""
    point: Annotated[FloatArray, 3]
    """(3,) desired position of the end-effector [m]."""
    tangent: Annotated[FloatArray, 3]
    """(3,) unit tangent there."""
    velocity: Annotated[FloatArray, 3]
    """(3,) task velocity x_d, before any reduction [m/s]."""
    forward: Cell
    """Its speed along the path, before it is limited [m/s]."""
    scale: Cell
    """Factor on the velocity, of eqs. 3 and 4."""


class PathPace(NamedTuple):
    """Phase on the path, and the speed that is allowed along it."""

    scale: Cell
    """Factor of eq. 4 when it last fell or stayed."""
    cycles: IntCell
    """Cycles since then."""
    phase: Cell
    """Arc length travelled [m]."""
    speed: Cell
    """Speed allowed along the path [m/s]."""


@kernel
def follow(path: OnPath, speed: float, here: FloatArray, p: TaskParams) -> None:
    """Write the task velocity x_d: along the path, and towards it, no faster than `speed` [m/s].

    Off the path the forward part shrinks, to zero at `off_path_m`: the arm first returns to the point where it left.
    `here` (3,) is the end-effector origin [m].
    """
    velocity, square, size = path.velocity, 0.0, 0.0
    for i in range(3):
        square += (path.point[i] - here[i]) ** 2
    path.forward[0] = speed * max(0.0, 1.0 - math.sqrt(square) / p.off_path_m)
    for i in range(3):  # feedforward along the path, feedback towards it
        velocity[i] = path.forward[0] * path.tangent[i] + p.position_gain_1_s * (path.point[i] - here[i])
        size += velocity[i] ** 2
    size = math.sqrt(size)
    if size > speed:
        for i in range(3):
            velocity[i] *= speed / size  # as a whole: the direction stays


@kernel
def advance(phase: float, path: OnPath, commanded: FloatArray, period: float) -> float:
    """Advance the phase [m] by one period [s] of the forward speed, less the arm's deficit, never back.

    So a slowed or blocked arm slows the phase. Motion back to the path is no progress along it: an arm that was pushed
    ahead or back returns to the point where it left. `commanded` (3,) is the velocity of the end-effector origin [m/s].
    """
    missing = 0.0  # the reduction by eqs. 3-4, the rows and the joint box
    for i in range(3):
        missing += (path.velocity[i] - commanded[i]) * path.tangent[i]
    return phase + max(0.0, path.forward[0] - max(0.0, missing)) * period


@kernel
def speed_scale(distance: float, d_max: float) -> float:
    """Factor d_lowest / d_max on the end-effector velocity, eq. 3 of the paper; 1 beyond d_max.

    `distance` [m] is from the end-effector origin to the nearest obstacle, infinite if there is none.
    """
    # in any direction of motion: eq. 3 slows a retreat too (docs/explanation/paper.md, slow-down while retreating)
    return min(1.0, distance / d_max)


@kernel
def reduce_speed(pace: PathPace, fresh: float, l_max: int) -> float:
    """Run one cycle of eqs. 3 and 4: update `pace`, and return the factor on the end-effector velocity.

    After a loss the factor s + (1 - s) l_obs / l_max of eq. 4 of the paper returns to full speed in l_max cycles. The
    fresh factor, by eq. 3 or by a silent unit, applies at once where it is smaller, and rises no faster than that. So
    the speed never jumps up, whether the nearest obstacle vanishes, reappears farther away, or leaves another one in
    view.
    """
    scale, cycles = pace.scale[0], pace.cycles[0] + 1
    faded = scale + (1.0 - scale) * min(1.0, cycles / l_max)
    if fresh <= faded:
        pace.scale[0], pace.cycles[0] = fresh, 0
        return fresh
    # the factor at the loss stays, and the cycles count on: eq. 4 is linear in them and ends at 1 after l_max
    pace.cycles[0] = cycles
    return faded
