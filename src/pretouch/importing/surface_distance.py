"""Exact distances from points to a surface of triangles, and whether a point is inside it."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree
from trimesh import Trimesh

from pretouch.types import BoolArray, FloatArray

_PARTS = 30
"""Triangles longer than this part of the surface's size are divided, so that few are near any point."""
_MOST_TRIANGLES = 200_000
_AT_ONCE = 50_000
"""Pairs of a point and a triangle that are looked at together: as many as stay in the processor's cache."""


class SurfaceDistance:
    """Distances to one surface. Nothing is approximated: the triangles left out are farther than another one."""

    def __init__(self, surface: Trimesh) -> None:
        real = surface.area_faces > 0
        self.corners: FloatArray = surface.triangles.view(np.ndarray)[real]
        """(F, 3, 3) of the triangles that have an area [m]."""
        self.area: FloatArray = surface.area_faces[real]
        """(F,) of these [m^2]."""
        self._low, self._high = surface.bounds
        self.size = float(surface.scale)
        """Diagonal of the box round the surface [m]."""
        self.parts: FloatArray = _divided(self.corners, max(self.size / _PARTS, 1e-6))
        """Corners (D, 3, 3) of the divided triangles [m]."""
        centre = self.parts.mean(axis=1)
        self._reach = float(np.linalg.norm(self.parts - centre[:, None], axis=2).max())
        self._tree = cKDTree(centre)
        self.points: FloatArray = np.concatenate([surface.vertices[surface.referenced_vertices], centre])
        """Points (P, 3) all over the surface: its vertices, and the centres of its divided triangles [m]."""
        self._hull = _hull_planes(surface.vertices[surface.referenced_vertices])

    def box_distance(self, points: FloatArray) -> FloatArray:
        """Distances (P,) of points (P, 3) to the box round the surface, 0 inside: none is nearer to the surface."""
        return np.linalg.norm(np.maximum(0.0, np.maximum(self._low - points, points - self._high)), axis=1)

    def __call__(self, points: FloatArray) -> FloatArray:
        """Distances (P,) of points (P, 3) [m], inside as outside without a sign."""
        nearest, _ = self._tree.query(points)
        found = np.empty(len(points))
        # what is nearer than the nearest centre has its own centre no farther than that and a triangle's reach
        candidates = self._tree.query_ball_point(points, nearest + self._reach + 1e-12)
        counts = np.array([len(c) for c in candidates])
        first = 0
        while first < len(points):
            last = first + max(1, int(np.searchsorted(np.cumsum(counts[first:]), _AT_ONCE)))
            part = slice(first, last)
            rows = np.repeat(points[part], counts[part], axis=0)
            triangles = self.parts[np.concatenate([np.asarray(c, dtype=np.int64) for c in candidates[part]])]
            each = triangle_distance(rows, triangles)
            found[part] = np.minimum.reduceat(each, np.concatenate([[0], np.cumsum(counts[part])[:-1]]))
            first = last
        return found

    def outside(self, points: FloatArray) -> BoolArray:
        """Whether points (P, 3) are outside: beyond the convex hull, or not wound round by the surface."""
        out: BoolArray = np.zeros(len(points), dtype=np.bool_)
        if self._hull is not None:
            out |= np.any(points @ self._hull[:, :3].T + self._hull[:, 3] > 1e-12, axis=1)
        doubtful = np.flatnonzero(~out)
        step = max(1, _AT_ONCE // len(self.corners))
        for first in range(0, len(doubtful), step):
            some = doubtful[first : first + step]
            out[some] = np.abs(_winding(points[some], self.corners)) < 0.5
        return out


def triangle_distance(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Distances (N,) of points (N, 3) to triangles (N, 3, 3), one each [m].

    trimesh.triangles.closest_point has tolerances in m^4, and is up to 0.9 mm off at triangles of half a millimetre.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(size, 1e-300)[:, None]
    height = _dot(points - a, normal)
    over = size > 0
    for one, next_one in ((a, b), (b, c), (c, a)):
        over &= _dot(np.cross(next_one - one, points - one), normal) >= 0
    edges = [_edge_distance(points, *pair) for pair in ((a, b), (b, c), (c, a))]
    return np.where(over, np.abs(height), np.minimum.reduce(edges))


def _edge_distance(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    along = b - a
    part = np.clip(_dot(points - a, along) / np.maximum(_dot(along, along), 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - a - part[:, None] * along, axis=1)


def _winding(points: FloatArray, corners: FloatArray) -> FloatArray:
    """How often a surface (F, 3, 3) is wound round points (P, 3): the sum of its solid angles over 4 pi."""
    # by coordinate: arrays of vectors would take several times as long
    a, b, c = ([corners[None, :, k, i] - points[:, i, None] for i in range(3)] for k in range(3))
    la, lb, lc = (np.sqrt(x * x + y * y + z * z) for x, y, z in (a, b, c))
    cross = [b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2] for i in range(3)]
    volume = _sum_of(a, cross)
    rest = la * lb * lc + _sum_of(a, b) * lc + _sum_of(b, c) * la + _sum_of(c, a) * lb
    return np.asarray(np.arctan2(volume, rest).sum(axis=1) / (2 * np.pi))


def _sum_of(a: list[FloatArray], b: list[FloatArray]) -> FloatArray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("...i,...i->...", a, b)


def _divided(corners: FloatArray, longest: float) -> FloatArray:
    """Divide triangles (F, 3, 3) across their longest edges until none is longer [m], or there are too many."""
    kept, waiting = [], corners
    total = len(corners)
    while len(waiting):
        edges = np.linalg.norm(waiting - np.roll(waiting, -1, axis=1), axis=2)
        long = edges.max(axis=1) > longest
        kept.append(waiting[~long])
        waiting = waiting[long]
        total += len(waiting)
        if not len(waiting) or total > _MOST_TRIANGLES:
            break
        waiting = halved(waiting)
    return np.concatenate([*kept, waiting])


def halved(corners: FloatArray) -> FloatArray:
    """Divide triangles (F, 3, 3) across their longest edges, (2 F, 3, 3)."""
    turn = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).argmax(axis=1)
    rows = np.arange(len(corners))
    a, b, c = (corners[rows, (turn + k) % 3] for k in range(3))
    middle = (a + b) / 2
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def _hull_planes(points: FloatArray) -> FloatArray | None:
    """Planes (H, 4) of the convex hull, positive outside; None if the points span no volume."""
    try:
        return np.asarray(ConvexHull(points).equations)
    except QhullError:
        return None
