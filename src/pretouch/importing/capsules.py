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
from pretouch.importing.chain import Arm
from pretouch.importing.sampling import directions
from pretouch.importing.tree import Shape
from pretouch.robot.body import from_axes
from pretouch.robot.postures import spread
from pretouch.types import BoolArray, FloatArray, IntArray

MOST = 3
"""Capsules for one link at most, unless more are asked for."""
_MOST_GIVEN = 6
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
        return np.linalg.norm(from_axes(points, self.a, self.b)[1], axis=2) - self.radius

    def __call__(self, points: FloatArray) -> FloatArray:
        """Distances (P,) of points (P, 3) to the nearest capsule, negative inside [m]."""
        return self.each(points).min(axis=1)


@dataclass(frozen=True, eq=False)
class LinkBody:
    """The capsules of one link."""

    name: str
    """Of the link."""
    rods: Rods
    """Link frame."""
    fitted: bool
    """Whether they stand for other shapes; otherwise the file has them so."""
    sticks_out: float
    """How far the surface sticks out of the capsules at most [m], at its vertices and `_SAMPLES` points between."""
    stands_over: float
    """How far the capsules stand over the surface at most, from places about it [m]."""


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


def bodies_of(arm: Arm, most: int = MOST, cover: bool = False) -> tuple[tuple[LinkBody, ...], tuple[str, ...]]:
    """Return the capsules of all links that have a surface, and a sentence for each thing that was assumed.

    Args:
        arm: the arm.
        most: capsules for one link at most.
        cover: whether fitted capsules are enlarged until no surface sticks out of them.
    """
    links = arm.robot.links
    # every mesh is read before the first link is fitted: what is wrong with one is said at once
    surfaces = {i: _checked(link.name, link.surface()) for i, link in enumerate(links) if link.shapes}
    jointed = {i for i, link in enumerate(links) if any(joint in arm.joints for joint in link.joints)}
    if not any(jointed.intersection(arm.robot.ancestors(i)) for i in surfaces):
        raise RobotModelError(
            f"No moving link of {arm.robot.name} has any geometry: give the links <collision> or <visual> shapes."
        )
    visual = [links[i].name for i in surfaces if not links[i].collision]
    bare = [links[i].name for i in sorted(jointed - set(surfaces))]
    remarks = []
    if visual:
        remarks.append(f"Without collision geometry, so fitted to the visual geometry: {', '.join(visual)}.")
    if bare:
        remarks.append(f"Without any geometry, so without a capsule: {', '.join(bare)}.")
    bodies = [
        link_body(links[i].name, outside_of(surface), given_by(links[i].shapes), most, cover)
        for i, surface in surfaces.items()
    ]
    return tuple(bodies), tuple(remarks)


def _checked(link: str, surface: Trimesh) -> Trimesh:
    """Return a link's surface; one of no possible size is a RobotModelError."""
    size = float(surface.extents.max())
    if size > _LARGEST:
        raise RobotModelError(
            f"The link {link} is {size:.4g} m long: if its meshes are in millimetres, give them the scale"
            ' "0.001 0.001 0.001" in the file.'
        )
    return surface


def link_body(name: str, outside: Outside, given: Rods | None, most: int = MOST, cover: bool = False) -> LinkBody:
    """Return a link's own capsules if there are any, otherwise fitted ones."""
    rods = given or fitted(outside, most)
    if cover and given is None:
        rods = covering(rods, outside.on)
    over = (outside.height - rods(outside.around)).max(initial=0.0)
    return LinkBody(name, rods, given is None, max(0.0, float(rods(outside.on).max())), float(over))


def given_by(shapes: tuple[Shape, ...]) -> Rods | None:
    """Return a link's own capsules and balls, if it has nothing else."""
    kinds = {mujoco.mjtGeom.mjGEOM_SPHERE: 0.0, mujoco.mjtGeom.mjGEOM_CAPSULE: 1.0}
    if len(shapes) > _MOST_GIVEN or not all(shape.kind in kinds for shape in shapes):
        return None
    half = [max(kinds[shape.kind] * shape.size[1], _SHORTEST) * shape.T[:3, 2] for shape in shapes]
    middle = [shape.T[:3, 3] for shape in shapes]
    return Rods(np.subtract(middle, half), np.add(middle, half), np.array([shape.size[0] for shape in shapes]))


def outside_of(surface: Trimesh) -> Outside:
    """Spread points over a surface and about it; of the same surface they are the same."""
    samples, face = sample_surface(surface, _SAMPLES, seed=0)
    u = spread(_AROUND, 3)
    height = _NEAREST * (min(_FARTHEST, max(float(surface.scale), 0.04)) / _NEAREST) ** u[:, :1]
    around = samples[:_AROUND] + height * directions(u[:, 1:])
    around = around[~_inside(around, samples[:_WINDING], surface.face_normals[face[:_WINDING]], float(surface.area))]
    distance, nearest = cKDTree(samples).query(around)
    on = np.vstack([samples, surface.vertices[surface.referenced_vertices]]).view(np.ndarray)
    return Outside(on, around, distance, samples[nearest])


def _inside(places: FloatArray, points: FloatArray, normals: FloatArray, area: float) -> BoolArray:
    """Whether a surface is wound round places (Q, 3), by points (N, 3) of it and their normals (Barill et al. 2018).

    A shell that is open at its ends is wound round what it holds all the same.
    """
    share = area / len(points) / (4 * np.pi)
    above = np.einsum("ni,ni->n", points, normals) - places @ normals.T
    away = np.maximum(cdist(places, points), 1e-6)
    return np.asarray(np.abs(share * (above / (away * away * away)).sum(axis=1)) > 0.5)


def fitted(outside: Outside, most: int = MOST) -> Rods:
    """Fit as few capsules as are worth it, `most` at most, to a surface. The same surface has the same capsules."""
    near = outside.nearest[:_FITTED]
    points = np.vstack([near, outside.around[:_FITTED]])
    wanted = np.concatenate([np.zeros(len(near)), outside.height[:_FITTED]])
    best: Rods | None = None
    for count in range(1, most + 1):
        starts = _starts(near, count, best)
        rods = min((_refined(start, points, wanted) for start in starts), key=lambda r: _cost(r, points, wanted))
        if best is not None and _cost(rods, points, wanted) > _WORTH**2 * _cost(best, points, wanted):
            break
        best = rods
        if np.percentile(np.abs(best(points) - wanted), 95) < _GOOD:
            break
    assert best is not None  # noqa: S101  the loop runs at least once
    return best


def covering(rods: Rods, points: FloatArray) -> Rods:
    """Raise the radii until each of some points (P, 3) is inside the capsule that it is nearest to."""
    each = rods.each(points)
    more = np.zeros(len(rods))
    np.maximum.at(more, each.argmin(axis=1), each.min(axis=1))
    return Rods(rods.a, rods.b, rods.radius + more)


def _weighted(error: FloatArray) -> FloatArray:
    return np.where(error > 0, _TOO_SHORT, 1.0) * error


def _cost(rods: Rods, points: FloatArray, wanted: FloatArray) -> float:
    return float((_weighted(rods(points) - wanted) ** 2).mean())


def _refined(start: Rods, points: FloatArray, wanted: FloatArray) -> Rods:
    """Move capsules to where the squared errors of their distances (P,) from points (P, 3) are least."""

    def error(x: FloatArray) -> FloatArray:
        return _weighted(_unpacked(x)(points) - wanted)

    def slope(x: FloatArray) -> FloatArray:
        return _slope(_unpacked(x), points, wanted)

    x = np.column_stack([start.a, start.b, start.radius]).ravel()
    if len(points) < len(x):
        return start  # too few to move capsules by
    rods = _unpacked(least_squares(error, x, slope, method="lm", max_nfev=60).x)
    along = rods.b - rods.a
    short = np.linalg.norm(along, axis=1) < 2 * _SHORTEST
    step, middle = np.where(short[:, None], np.array([0.0, 0.0, _SHORTEST]), along / 2), (rods.a + rods.b) / 2
    return Rods(middle - step, middle + step, rods.radius)


def _slope(rods: Rods, points: FloatArray, wanted: FloatArray) -> FloatArray:
    """Derivatives (P, 7 K) of the weighed errors: of each point's distance, by its nearest capsule only."""
    part, away = from_axes(points, rods.a, rods.b)
    length = np.linalg.norm(away, axis=2)
    k, rows = (length - rods.radius).argmin(axis=1), np.arange(len(points))
    part, away, each = part[rows, k, None], away[rows, k] / np.maximum(length[rows, k, None], 1e-9), length[rows, k]
    weight = np.where(each - rods.radius[k] > wanted, _TOO_SHORT, 1.0)[:, None]
    table = np.zeros((len(points), len(rods), 7))
    table[rows, k] = weight * np.hstack([-(1 - part) * away, -part * away, -np.ones((len(points), 1))])
    return table.reshape(len(points), -1)


def _unpacked(x: FloatArray) -> Rods:
    table = x.reshape(-1, 7)
    return Rods(table[:, :3], table[:, 3:6], np.maximum(np.abs(table[:, 6]), 1e-3))


def _starts(points: FloatArray, count: int, before: Rods | None) -> list[Rods]:
    """Return where to begin from with so many capsules: slices of the surface, and what was found with one fewer."""
    axes = _axes(points)
    centred = points - points.mean(axis=0)
    found = [_by_slice(points, _slices(centred @ axis, count)) for axis in axes[: 1 if count == 1 else 3]]
    if before is not None:
        worst = points[np.argmax(before(points))] + np.array([[-0.005], [0.005]]) * axes[0]
        radius = np.append(before.radius, before.radius.min() / 2)
        found.append(Rods(np.vstack([before.a, worst[:1]]), np.vstack([before.b, worst[1:]]), radius))
    return found


def _axes(points: FloatArray) -> FloatArray:
    """Principal axes (3, 3) of points (P, 3), the longest first, by row."""
    centred = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(centred.T @ centred)[1].T[::-1])


def _slices(values: FloatArray, count: int) -> IntArray:
    """Part (P,) of the range of some values (P,) that each lies in, of so many equal parts."""
    low, high = values.min(), values.max()
    return np.clip(((values - low) / max(high - low, 1e-12) * count).astype(np.int64), 0, count - 1)


def _by_slice(points: FloatArray, part: IntArray) -> Rods:
    """Lay one capsule through each slice of points (P, 3), along its longest extent."""
    a, b, radius = [], [], []
    for k in range(part.max() + 1):
        own = points[part == k] if np.any(part == k) else points
        axes, middle = _axes(own), (own.min(axis=0) + own.max(axis=0)) / 2
        extent = (own - middle) @ axes.T
        r = max(0.9 * float(np.linalg.norm(extent[:, 1:], axis=1).mean()), 2e-3)
        reach = max(float(np.abs(extent[:, 0]).max()) - r, 1e-3) * axes[0]
        a.append(middle - reach)
        b.append(middle + reach)
        radius.append(r)
    return Rods(np.array(a), np.array(b), np.array(radius))
