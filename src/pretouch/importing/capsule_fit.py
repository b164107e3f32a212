"""A few capsules in place of a surface: those whose distances are nearest to the surface's own."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pretouch.importing.sampling import directions, spread
from pretouch.importing.surface_distance import SurfaceDistance, halved
from pretouch.types import FloatArray, IntArray

MOST = 3
"""Capsules for one link at most, unless more are asked for."""
_POINTS = 1500
_NEAREST, _FARTHEST = 0.001, 0.2
"""Heights above the surface of the points that are fitted to [m]: as far as distances matter."""
_TOO_SHORT = 1.5
"""How much worse it is that the surface sticks out of the capsules than that they stand over it."""
_GOOD = 0.003
"""Error of 95 % of the distances with which no more capsules are tried [m]."""
_WORTH = 0.9
"""One more capsule has to bring the error down to this part."""
_STEPS = 60
_EXACT = 1e-4
"""Within this `farthest_out` is exact [m]."""
_SHORTEST = 1e-4
"""Half the length of a capsule's axis, at least [m]: the file format has no balls."""


@dataclass(frozen=True, eq=False)
class Rods:
    """K capsules in the frame of a link."""

    a: FloatArray
    """(K, 3) one end of each axis [m]."""
    b: FloatArray
    """(K, 3) the other end [m]."""
    radius: FloatArray
    """(K,) [m]."""

    def __len__(self) -> int:
        return len(self.radius)

    def each(self, points: FloatArray) -> FloatArray:
        """Distances (P, K) of points (P, 3) to each capsule, negative inside [m]."""
        along = self.b - self.a
        from_a = points[:, None] - self.a
        part = np.einsum("pki,ki->pk", from_a, along) / np.maximum(np.einsum("ki,ki->k", along, along), 1e-18)
        return np.linalg.norm(from_a - np.clip(part, 0.0, 1.0)[..., None] * along, axis=2) - self.radius

    def __call__(self, points: FloatArray) -> FloatArray:
        """Distances (P,) of points (P, 3) to the nearest capsule, negative inside [m]."""
        return self.each(points).min(axis=1)


def points_around(surface: SurfaceDistance, count: int, nearest: float, farthest: float, skip: int = 20) -> FloatArray:
    """Points (at most `count`, 3) outside a surface, as many near it as far from it, the same each time [m].

    Args:
        surface: what they lie around.
        count: number of points that are tried.
        nearest: smallest height above the place of the surface that a point starts from [m].
        farthest: largest such height [m].
        skip: other numbers give other points.
    """
    u = spread(count, 6, skip)
    share = np.cumsum(surface.area) / surface.area.sum()
    corners = surface.corners[np.minimum(np.searchsorted(share, u[:, 0]), len(share) - 1)]
    s, t = np.sqrt(u[:, 1, None]), u[:, 2, None]
    start = (1 - s) * corners[:, 0] + s * (1 - t) * corners[:, 1] + s * t * corners[:, 2]
    height = nearest * (farthest / nearest) ** u[:, 3]
    found = start + height[:, None] * directions(u[:, 4:6])
    return found[surface.outside(found)]


def fitted(surface: SurfaceDistance, most: int = MOST) -> Rods:
    """Fit as few capsules as are worth it, `most` at most, to a surface. The same surface has the same capsules."""
    points = points_around(surface, 2 * _POINTS, _NEAREST, min(_FARTHEST, max(surface.size, 10 * _NEAREST)))[:_POINTS]
    wanted = surface(points)
    best: Rods | None = None
    for count in range(1, most + 1):
        found = min((_refined(start, points, wanted) for start in _starts(surface, count, best, points, wanted)),
                    key=lambda rods: _cost(rods, points, wanted))  # fmt: skip
        if best is not None and _cost(found, points, wanted) > _WORTH**2 * _cost(best, points, wanted):
            break
        best = found
        if np.percentile(np.abs(best(points) - wanted), 95) < _GOOD:
            break
    assert best is not None  # noqa: S101  the loop runs at least once
    return best


def farthest_out(rods: Rods, corners: FloatArray) -> float:
    """How far triangles (F, 3, 3) stick out of capsules at most [m], at most 0.1 mm more than they do; 0 if nowhere.

    The distance to one capsule is largest at a corner, so that only triangles between capsules need be divided.
    """
    most = max(0.0, float(rods(corners.reshape(-1, 3)).max()))
    waiting = corners
    while len(waiting := waiting[_ceiling(rods, waiting).min(axis=1) > most + _EXACT]):
        waiting = halved(waiting)
        most = max(most, float(rods(waiting.reshape(-1, 3)).max()))
    return most + _EXACT if most > 0 else 0.0


def covering(rods: Rods, corners: FloatArray) -> Rods:
    """Raise the radii until each of some triangles (F, 3, 3) is inside one of the capsules."""
    ceiling = _ceiling(rods, corners)
    nearest = ceiling.argmin(axis=1)
    more = np.zeros(len(rods))
    np.maximum.at(more, nearest, ceiling[np.arange(len(corners)), nearest])
    return Rods(rods.a, rods.b, rods.radius + more)


def _ceiling(rods: Rods, corners: FloatArray) -> FloatArray:
    """Largest distances (F, K) of triangles (F, 3, 3) from each capsule [m]: convex, so those of a corner."""
    return rods.each(corners.reshape(-1, 3)).reshape(len(corners), 3, -1).max(axis=1)


def _weights(error: FloatArray) -> FloatArray:
    return np.where(error > 0, _TOO_SHORT, 1.0)


def _cost(rods: Rods, points: FloatArray, wanted: FloatArray) -> float:
    """Mean squared error of the distances, those too long weighed more [m^2]."""
    error = rods(points) - wanted
    return float(((_weights(error) * error) ** 2).mean())


def _refined(start: Rods, points: FloatArray, wanted: FloatArray) -> Rods:
    """Move capsules to where the squared errors of their distances (P,) from points (P, 3) are least."""

    def error(x: FloatArray) -> FloatArray:
        found = _unpacked(x)(points) - wanted
        return _weights(found) * found

    def slope(x: FloatArray) -> FloatArray:
        return _slope(_unpacked(x), points, wanted)

    if len(points) < 7 * len(start):
        return start  # too few corners to move capsules by
    x = np.column_stack([start.a, start.b, start.radius]).ravel()
    result = least_squares(error, x, slope, method="lm", max_nfev=_STEPS)
    return _lengthened(_unpacked(result.x))


def _unpacked(x: FloatArray) -> Rods:
    table = x.reshape(-1, 7)
    return Rods(table[:, :3], table[:, 3:6], np.maximum(np.abs(table[:, 6]), 1e-3))


def _slope(rods: Rods, points: FloatArray, wanted: FloatArray) -> FloatArray:
    """Derivatives (P, 7 K) of the weighed errors: of each point's distance, by its nearest capsule only."""
    each = rods.each(points)
    k = each.argmin(axis=1)
    rows = np.arange(len(points))
    a, along = rods.a[k], (rods.b - rods.a)[k]
    part = np.einsum("pi,pi->p", points - a, along) / np.maximum(np.einsum("pi,pi->p", along, along), 1e-18)
    part = np.clip(part, 0.0, 1.0)[:, None]
    away = points - a - part * along
    away /= np.maximum(np.linalg.norm(away, axis=1), 1e-9)[:, None]
    weight = _weights(each[rows, k] - wanted)[:, None]
    table = np.zeros((len(points), len(rods), 7))
    table[rows, k] = weight * np.hstack([-(1 - part) * away, -part * away, -np.ones((len(points), 1))])
    return table.reshape(len(points), -1)


def _lengthened(rods: Rods) -> Rods:
    """Give capsules that have become balls an axis, and order what belongs to it so that fits repeat."""
    along = rods.b - rods.a
    length = np.linalg.norm(along, axis=1)
    short = length < 2 * _SHORTEST
    step = np.where(short[:, None], np.array([0.0, 0.0, _SHORTEST]), along / 2)
    middle = (rods.a + rods.b) / 2
    return Rods(middle - step, middle + step, rods.radius)


def _starts(
    surface: SurfaceDistance, count: int, before: Rods | None, points: FloatArray, wanted: FloatArray
) -> list[Rods]:
    """Return where to begin from with so many capsules: slices of the surface, and what was found with one fewer."""
    places = surface.points
    step = max(1, len(places) // 3000)
    places = places[::step]
    centred = places - places.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1].T[::-1]
    found = [_by_cluster(places, _slices(centred @ axis, count)) for axis in axes[: 1 if count == 1 else 3]]
    if before is not None:
        error = before(points) - wanted
        worst = points[np.argmax(error)]
        near = places[np.argmin(np.linalg.norm(places - worst, axis=1))]
        added = near + np.array([[-0.005], [0.005]]) * axes[0]
        found.append(
            Rods(
                np.vstack([before.a, added[:1]]),
                np.vstack([before.b, added[1:]]),
                np.append(before.radius, before.radius.min() / 2),
            )
        )
    return found


def _slices(values: FloatArray, count: int) -> IntArray:
    """Part (P,) of the range of some values (P,) that each lies in, of so many equal parts."""
    low, high = values.min(), values.max()
    return np.clip(((values - low) / max(high - low, 1e-12) * count).astype(np.int64), 0, count - 1)


def _by_cluster(places: FloatArray, cluster: IntArray) -> Rods:
    """Lay one capsule through each cluster of places (P, 3), along its longest extent."""
    a, b, radius = [], [], []
    for k in range(cluster.max() + 1):
        own = places[cluster == k] if np.any(cluster == k) else places
        middle = (own.min(axis=0) + own.max(axis=0)) / 2
        centred = own - own.mean(axis=0)
        axes = np.linalg.eigh(centred.T @ centred)[1].T[::-1]
        extent = (own - middle) @ axes.T
        half = np.abs(extent).max(axis=0)
        r = max(0.9 * float(np.linalg.norm(extent[:, 1:], axis=1).mean()), 2e-3)
        reach = max(half[0] - r, 1e-3) * axes[0]
        a.append(middle - reach)
        b.append(middle + reach)
        radius.append(r)
    return Rods(np.array(a), np.array(b), np.array(radius))
