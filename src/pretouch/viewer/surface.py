"""The surface of a body made of capsules, as one smooth mesh with vertices dense enough to be coloured."""

from dataclasses import dataclass

import numpy as np

from pretouch.robot.body import Capsules
from pretouch.types import FloatArray, IntArray

CELL_M = 0.009
"""Distance between the vertices of a surface, about [m]."""

BLEND_M = 0.024
"""Length over which capsules that meet run into each other [m]; at most a quarter of it fills a crease of two."""

_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]


@dataclass(frozen=True)
class Mesh:
    """V vertices and F triangles, counter-clockwise seen from outside."""

    vertices: FloatArray
    """(V, 3) [m]."""
    faces: IntArray
    """(F, 3) indices of vertices."""
    normals: FloatArray
    """(V, 3) unit vectors, outwards."""


def signed_distance(points: FloatArray, capsules: Capsules, blend: float = BLEND_M) -> FloatArray:
    """Distance (P,) [m] of points (P, 3) from the union of capsules, blended over a length [m] where they meet.

    It is negative inside.
    """
    total: FloatArray | None = None
    for a, b, radius in zip(capsules.a, capsules.b, capsules.radius, strict=True):
        axis = b - a
        along = np.clip((points - a) @ axis / max(float(axis @ axis), 1e-12), 0.0, 1.0)
        distance = np.linalg.norm(points - a - along[:, None] * axis, axis=1) - radius
        if total is None:
            total = distance
        else:
            near = np.maximum(blend - np.abs(total - distance), 0.0)
            total = np.minimum(total, distance) - near**2 / (4 * blend)
    return np.full(len(points), np.inf) if total is None else total


def surface_of(capsules: Capsules, cell: float = CELL_M, blend: float = BLEND_M) -> Mesh:
    """Mesh the union of capsules (at least one) by surface nets on a grid of `cell` [m], drawn onto the surface."""
    reach = capsules.radius[:, None] + 2 * cell
    low = np.minimum(capsules.a - reach, capsules.b - reach).min(axis=0)
    high = np.maximum(capsules.a + reach, capsules.b + reach).max(axis=0)
    shape = tuple(np.ceil((high - low) / cell).astype(int) + 1)
    grid = low + cell * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    field = signed_distance(grid, capsules, blend).reshape(shape)
    places, vertices = _crossed_cells(field)
    points = low + cell * vertices
    for _ in range(3):
        slope = _gradient(points, capsules, blend)
        points = points - signed_distance(points, capsules, blend)[:, None] * slope
    faces = _faces(field, places)
    return Mesh(points, faces, _gradient(points, capsules, blend))


def _crossed_cells(field: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find the cells the surface passes: their place in a list (cells of the grid; -1: none), and a vertex in each."""
    size = tuple(n - 1 for n in field.shape)
    corners = np.stack([field[i : i + size[0], j : j + size[1], k : k + size[2]] for i, j, k in _CORNERS], axis=-1)
    inside = corners < 0
    crossed = inside.any(axis=-1) & ~inside.all(axis=-1)
    places = np.full(size, -1, dtype=np.int64)
    places[crossed] = np.arange(int(crossed.sum()))
    values = corners[crossed]
    total, count = np.zeros((len(values), 3)), np.zeros((len(values), 1))
    for a, b in _EDGES:
        cut = (values[:, a] < 0) != (values[:, b] < 0)
        share = values[cut, a] / (values[cut, a] - values[cut, b])
        total[cut] += _CORNERS[a] + share[:, None] * (_CORNERS[b] - _CORNERS[a])
        count[cut] += 1
    return places, np.argwhere(crossed) + total / count


def _faces(field: FloatArray, places: IntArray) -> IntArray:
    """Two triangles (F, 3) across each edge of the grid that the surface cuts, between the four cells round it."""
    found = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        first = np.take(field, np.arange(field.shape[axis] - 1), axis)
        second = np.take(field, np.arange(1, field.shape[axis]), axis)
        for leaving, cut in ((True, (first < 0) & (second >= 0)), (False, (first >= 0) & (second < 0))):
            at = np.argwhere(cut)
            back_u, back_v = np.eye(3, dtype=np.int64)[u], np.eye(3, dtype=np.int64)[v]
            round_edge = [at - back_u - back_v, at - back_v, at, at - back_u]
            a, b, c, d = (places[tuple(cell.T)] for cell in (round_edge if leaving else round_edge[::-1]))
            found += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    return np.concatenate(found)


def _gradient(points: FloatArray, capsules: Capsules, blend: float, step: float = 1e-4) -> FloatArray:
    """Unit gradients (P, 3) of the signed distance, by central differences."""
    slope = np.stack(
        [
            signed_distance(points + step * e, capsules, blend) - signed_distance(points - step * e, capsules, blend)
            for e in np.eye(3)
        ],
        axis=1,
    )
    return slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)
