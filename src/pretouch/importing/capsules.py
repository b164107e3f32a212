"""A few capsules in place of each link's surface: those whose distances are nearest to the surface's own."""

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from trimesh import Trimesh
from trimesh.sample import sample_surface

from pretouch.errors import RobotModelError
from pretouch.importing.chain import ArmChain
from pretouch.importing.tree import Shape
from pretouch.robot.body import from_axes
from pretouch.robot.postures import spread
from pretouch.types import BoolArray, FloatArray

MOST = 3
"""Capsules for one link at most, unless more are asked for."""
_MOST_OWN = 6
"""A link whose shapes are as many balls and capsules at most keeps them as they are."""
_LARGEST = 5.0
"""Size of a link beyond which it is taken for one in millimetres [m]."""
_SAMPLES, _AROUND, _FITTED = 20_000, 2000, 700
"""Points on a surface, places around it that are tried, and how many of either are fitted to."""
_WINDING = 3000
"""Points by which places outside are told from those inside."""
_NEAREST, _FARTHEST = 0.004, 0.2
"""Heights of these places above where they start from [m]: as far as distances matter."""
_TOO_SHORT = 1.5
"""How much worse it is that the surface sticks out of the capsules than that they stand over it."""
_GOOD = 0.003
"""Error of 95 % of the distances with which no more capsules are tried [m]."""
_WORTH = 0.9
"""One more capsule has to bring the error down to this part."""
_SHORTEST = 1e-4
"""Half the length of a capsule's axis, at least [m]: the file format has no balls."""


def distances(rods: FloatArray, points: FloatArray) -> FloatArray:
    """Distances (P, K) of points (P, 3) to each of the capsules (K, 7), negative inside [m].

    A row holds both ends of a capsule's axis and its radius [m], in the frame of a link, here as everywhere below.
    """
    return np.linalg.norm(from_axes(points, rods[:, :3], rods[:, 3:6])[1], axis=2) - rods[:, 6]


def _distance(rods: FloatArray, points: FloatArray) -> FloatArray:
    """Distances (P,) of points (P, 3) to the nearest capsule, negative inside [m]."""
    return distances(rods, points).min(axis=1)


@dataclass(frozen=True, eq=False)
class LinkBody:
    """The capsules of one link."""

    name: str
    """Name of the link."""
    rods: FloatArray
    """(K, 7), see `distances`."""
    sticks_out: float
    """Greatest distance of the surface outside of the capsules [m], at its vertices and `_SAMPLES` points between."""
    stands_over: float
    """Greatest distance of the capsules beyond the surface, from places about it [m]."""


@dataclass(frozen=True, eq=False)
class Outside:
    """A surface, and places outside it."""

    on: FloatArray
    """(P, 3) points on it, as many on each area, then its vertices [m]."""
    around: FloatArray
    """(Q, 3) places about it [m]."""
    height: FloatArray
    """(Q,) distance of each from it [m]."""
    nearest: FloatArray
    """(Q, 3) point of the surface nearest to each: no motors or the like within a shell [m]."""


def bodies_of(arm: ArmChain, most: int = MOST, cover: bool = False) -> tuple[LinkBody, ...]:
    """Return the capsules of all links that have a surface, at most `most` for a link.

    `cover` enlarges fitted capsules until no surface sticks out of them.
    """
    robot = arm.robot
    # every mesh is read before the first link is fitted: what is wrong with one is said at once
    surfaces = {link: link.surface() for link in robot.links if link.shapes}
    if not any(link.shapes and any(map(arm.moves, robot.ancestors(i))) for i, link in enumerate(robot.links)):
        raise RobotModelError(
            f"No moving link of {robot.name} has any geometry: give the links <collision> or <visual> shapes."
        )
    for link, surface in surfaces.items():
        if (size := float(np.abs([surface.extents, *surface.bounds]).max())) > _LARGEST:
            raise RobotModelError(
                f"The link {link.name} is {size:.4g} m long: if its meshes are in millimetres, give them the scale"
                ' "0.001 0.001 0.001" in the file.'
            )
    if visual := [link.name for link in surfaces if link.visual]:
        robot.remarks.append(f"Without collision geometry, so fitted to the visual geometry: {', '.join(visual)}.")
    if bare := [link.name for i, link in enumerate(robot.links) if arm.moves(i) and not link.shapes]:
        robot.remarks.append(f"Without any geometry, so without a capsule: {', '.join(bare)}.")
    return tuple(
        link_body(link.name, outside_of(surface), own_capsules(link.shapes), most, cover)
        for link, surface in surfaces.items()
    )


def link_body(name: str, outside: Outside, own: FloatArray | None, most: int = MOST, cover: bool = False) -> LinkBody:
    """Return a link's own capsules if there are any, otherwise fitted ones."""
    rods = fitted(outside, most) if own is None else own
    if cover and own is None:
        rods = covering(rods, outside.on)
    over = (outside.height - _distance(rods, outside.around)).max(initial=0.0)
    return LinkBody(name, rods, max(0.0, float(_distance(rods, outside.on).max())), float(over))


def own_capsules(shapes: tuple[Shape, ...]) -> FloatArray | None:
    """Return the capsules (K, 7) and balls of a link, if it has nothing else and few of them."""
    kinds = {mujoco.mjtGeom.mjGEOM_SPHERE: 0.0, mujoco.mjtGeom.mjGEOM_CAPSULE: 1.0}
    if len(shapes) > _MOST_OWN or not all(shape.kind in kinds for shape in shapes):
        return None
    half = [max(kinds[shape.kind] * shape.size[1], _SHORTEST) * shape.T[:3, 2] for shape in shapes]
    middle = [shape.T[:3, 3] for shape in shapes]
    return np.column_stack([np.subtract(middle, half), np.add(middle, half), [shape.size[0] for shape in shapes]])


def outside_of(surface: Trimesh) -> Outside:
    """Spread points over a surface and about it; of the same surface they are the same."""
    samples, face = sample_surface(surface, _SAMPLES, seed=0)
    u = spread(_AROUND, 3)
    height = _NEAREST * (min(_FARTHEST, max(float(surface.scale), 0.04)) / _NEAREST) ** u[:, :1]
    z, turn = 2 * u[:, 1] - 1, 2 * np.pi * u[:, 2]
    flat = np.sqrt(1 - z * z)
    around = samples[:_AROUND] + height * np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    around = around[~_inside(around, samples[:_WINDING], surface.face_normals[face[:_WINDING]], float(surface.area))]
    distance, nearest = cKDTree(samples).query(around)
    on = np.vstack([samples, surface.vertices[surface.referenced_vertices]]).view(np.ndarray)
    return Outside(on, around, distance, samples[nearest])


def _inside(places: FloatArray, points: FloatArray, normals: FloatArray, area: float) -> BoolArray:
    """Mask of the places (Q, 3) inside a surface, by points (N, 3) of it and their normals (Barill et al. 2018).

    A shell that is open at its ends is wound round what it holds all the same.
    """
    share = area / len(points) / (4 * np.pi)
    above = np.einsum("ni,ni->n", points, normals) - places @ normals.T
    away = np.maximum(cdist(places, points), 1e-6)
    return np.asarray(np.abs(share * (above / (away * away * away)).sum(axis=1)) > 0.5)


def fitted(outside: Outside, most: int = MOST) -> FloatArray:
    """Fit as few capsules (K, 7) as are worth it, `most` at most, to a surface; to the same one always the same."""
    near = outside.nearest[:_FITTED]
    points = np.vstack([near, outside.around[:_FITTED]])
    height = np.concatenate([np.zeros(len(near)), outside.height[:_FITTED]])
    best: FloatArray | None = None
    for count in range(1, most + 1):
        fits = [_refined(start, points, height) for start in _starts(near, count, best)]
        rods = min(fits, key=lambda rods: _cost(rods, points, height))
        if best is not None and _cost(rods, points, height) > _WORTH**2 * _cost(best, points, height):
            break
        best = rods
        if np.percentile(np.abs(_distance(best, points) - height), 95) < _GOOD:
            break
    assert best is not None  # noqa: S101  the loop runs at least once
    return best


def covering(rods: FloatArray, points: FloatArray) -> FloatArray:
    """Raise the radii until each of some points (P, 3) is inside the capsule that it is nearest to."""
    each, wider = distances(rods, points), rods.copy()
    more = np.zeros(len(rods))
    np.maximum.at(more, each.argmin(axis=1), each.min(axis=1))
    wider[:, 6] += more
    return wider


def _weighted(error: FloatArray) -> FloatArray:
    return np.where(error > 0, _TOO_SHORT, 1.0) * error


def _cost(rods: FloatArray, points: FloatArray, height: FloatArray) -> float:
    return float((_weighted(_distance(rods, points) - height) ** 2).mean())


def _refined(start: FloatArray, points: FloatArray, height: FloatArray) -> FloatArray:
    """Move capsules to where the squared errors of their distances (P,) from points (P, 3) are least."""
    if len(points) < start.size:
        return start  # too few to move capsules by
    best = least_squares(
        lambda x: _weighted(_distance(_with_radii(x), points) - height),
        start.ravel(),
        lambda x: _slope(_with_radii(x), points, height),
        method="lm",
        max_nfev=60,
    )
    a, b, radius = np.split(_with_radii(best.x), [3, 6], axis=1)
    short = np.linalg.norm(b - a, axis=1, keepdims=True) < 2 * _SHORTEST
    step, middle = np.where(short, np.array([0.0, 0.0, _SHORTEST]), (b - a) / 2), (a + b) / 2
    return np.hstack([middle - step, middle + step, radius])


def _slope(rods: FloatArray, points: FloatArray, height: FloatArray) -> FloatArray:
    """Derivatives (P, 7 K) of the weighed errors: of each point's distance, by its nearest capsule only."""
    part, away = from_axes(points, rods[:, :3], rods[:, 3:6])
    length, radius = np.linalg.norm(away, axis=2), rods[:, 6]
    k, rows = (length - radius).argmin(axis=1), np.arange(len(points))
    part, away, each = part[rows, k, None], away[rows, k] / np.maximum(length[rows, k, None], 1e-9), length[rows, k]
    weight = np.where(each - radius[k] > height, _TOO_SHORT, 1.0)[:, None]
    table = np.zeros((len(points), len(rods), 7))
    table[rows, k] = weight * np.hstack([-(1 - part) * away, -part * away, -np.ones((len(points), 1))])
    return table.reshape(len(points), -1)


def _with_radii(x: FloatArray) -> FloatArray:
    """Return capsules (K, 7) of the unknowns (7 K,) of a fit, whose radii may be negative."""
    rods = x.reshape(-1, 7).copy()
    rods[:, 6] = np.maximum(np.abs(rods[:, 6]), 1e-3)
    return rods


def _starts(points: FloatArray, count: int, before: FloatArray | None) -> list[FloatArray]:
    """Return where to begin from with so many capsules: slices of the surface, and the best ones with one fewer."""
    axes = _axes(points)
    along = (points - points.mean(axis=0)) @ axes.T
    starts = []
    for values in along.T[: 1 if count == 1 else 3]:
        part = np.digitize(values, np.linspace(values.min(), values.max(), count + 1)[1:-1])
        starts.append(np.array([_through(points[part == k] if np.any(part == k) else points) for k in range(count)]))
    if before is not None:
        worst = points[np.argmax(_distance(before, points))] + np.array([[-0.005], [0.005]]) * axes[0]
        starts.append(np.vstack([before, [*worst.ravel(), before[:, 6].min() / 2]]))
    return starts


def _axes(points: FloatArray) -> FloatArray:
    """Principal axes (3, 3) of points (P, 3), the longest first, by row."""
    centred = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(centred.T @ centred)[1].T[::-1])


def _through(points: FloatArray) -> FloatArray:
    """Lay a capsule (7,) through points (P, 3), along their longest extent."""
    axes, middle = _axes(points), (points.min(axis=0) + points.max(axis=0)) / 2
    extent = (points - middle) @ axes.T
    radius = max(0.9 * float(np.linalg.norm(extent[:, 1:], axis=1).mean()), 2e-3)
    reach = max(float(np.abs(extent[:, 0]).max()) - radius, 1e-3) * axes[0]
    return np.concatenate([middle - reach, middle + reach, [radius]])
