"""The body of an arm as capsules fixed to its links, and points on its surface, where it may be touched."""

from typing import Annotated, NamedTuple

import mujoco
import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.errors import RobotModelError
from pretouch.robot.kinematics import Kinematics
from pretouch.types import BoolArray, FloatArray, IntArray


class Capsules(NamedTuple):
    """C capsules: the points within `radius` of the segment from `a` to `b`; on links, or placed in the base frame."""

    link: Annotated[IntArray, "C"]
    """(C,) index of the link each is fixed to."""
    a: Annotated[FloatArray, "C", 3]
    """(C, 3) one end of the axis, link frame or base frame [m]."""
    b: Annotated[FloatArray, "C", 3]
    """(C, 3) other end of the axis [m]."""
    radius: Annotated[FloatArray, "C"]
    """(C,) [m]."""

    def of_links(self, links: IntArray) -> "Capsules":
        """Return the capsules on some links, in order."""
        keep = np.isin(self.link, links)
        return Capsules(self.link[keep], self.a[keep], self.b[keep], self.radius[keep])


def no_capsules() -> Capsules:
    """Return no capsules."""
    return Capsules(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


@compiled
def placed(capsules: Capsules, kin: Kinematics) -> Capsules:
    """Return capsules of an arm in a posture, placed in the base frame."""
    a, b = np.empty((len(capsules.link), 3)), np.empty((len(capsules.link), 3))
    for c in range(len(a)):
        k = capsules.link[c]
        for i in range(3):
            a[c, i] = b[c, i] = kin.position[k, i]
            for j in range(3):
                a[c, i] += kin.rotation[k, i, j] * capsules.a[c, j]
                b[c, i] += kin.rotation[k, i, j] * capsules.b[c, j]
    return Capsules(capsules.link, a, b, capsules.radius)


def capsules_of(model: mujoco.MjModel) -> Capsules:
    """Read the capsule geoms of an MJCF model; a link's index is its MuJoCo body id."""
    other = [model.geom(g).name for g in range(model.ngeom) if model.geom_type[g] != mujoco.mjtGeom.mjGEOM_CAPSULE]
    if other:
        raise RobotModelError(f"The geoms {', '.join(other)} are not capsules: describe the body by capsules only.")
    half = np.zeros((model.ngeom, 3))
    for g in range(model.ngeom):
        axis = np.zeros(3)
        mujoco.mju_rotVecQuat(axis, np.array([0.0, 0.0, 1.0]), model.geom_quat[g])
        half[g] = axis * model.geom_size[g, 1]
    return Capsules(
        link=model.geom_bodyid.astype(np.int64),
        a=model.geom_pos - half,
        b=model.geom_pos + half,
        radius=model.geom_size[:, 0].copy(),
    )


def from_axes(points: FloatArray, a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the nearest places of points (P, 3) on axes a to b (C, 3), 0 to 1 (P, C), and the offsets (P, C, 3) [m].

    `to_axis` is the same for compiled code.
    """
    axis, rel = b - a, points[:, None] - a
    part = np.clip((rel * axis).sum(axis=2) / np.maximum((axis**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return part, rel - part[:, :, None] * axis


@kernel
def to_axis(point: FloatArray, k: int, a: FloatArray, b: FloatArray, c: int) -> tuple[float, float]:
    """Return the place on the segment from a[c] to b[c] closest to point[k], from 0 to 1, and the distance [m]."""
    ux, uy, uz = b[c, 0] - a[c, 0], b[c, 1] - a[c, 1], b[c, 2] - a[c, 2]
    x, y, z = point[k, 0] - a[c, 0], point[k, 1] - a[c, 1], point[k, 2] - a[c, 2]
    length2 = ux * ux + uy * uy + uz * uz
    # the foot of the perpendicular, brought into the segment; a ball has no axis
    along = 0.0 if length2 == 0 else min(1.0, max(0.0, (x * ux + y * uy + z * uz) / length2))
    x, y, z = x - along * ux, y - along * uy, z - along * uz
    return along, np.sqrt(x * x + y * y + z * z)


SPACING_M = 0.025
"""Approximate distance between neighbouring points [m]; places are interpolated between them."""
_MOST_CAPSULES, _MOST_AREA = 200, 50.0
"""Capsules that joints move, and their area [m^2]: a Panda has 18 and 0.9 m^2. Time grows with the product of both."""


@kernel
def gap_to(points: FloatArray, m: int, capsules: Capsules, without: int = -1) -> float:
    """Return the distance [m] of point m from the nearest placed capsule that is not on a link; negative inside."""
    least = np.inf
    for c in range(len(capsules.radius)):
        if capsules.link[c] != without:
            least = min(least, to_axis(points, m, capsules.a, capsules.b, c)[1] - capsules.radius[c])
    return least


class Surface(NamedTuple):
    """N points on the outside of the capsules that joints move, those of a rigid body one after the other."""

    link: IntArray
    """(N,) index of the link each is fixed to."""
    point: FloatArray
    """(N, 3) link frame [m]."""
    normal: FloatArray
    """(N, 3) outward unit normals, link frame."""
    area: FloatArray
    """(N,) surface area of each [m^2]."""
    body: IntArray
    """(N,) rigid body of each, from 0 at the base: links that the same joints move are one body."""
    first: IntArray
    """(B + 1,) index of the first point of each rigid body, and N."""


def bodies_of(moved_by: BoolArray) -> IntArray:
    """Return the rigid body (L,) of each link, from the joints (L, n) that move it; -1 for links that none moves."""
    patterns = [tuple(row) for row in moved_by.tolist()]
    bodies = {pattern: i for i, pattern in enumerate(dict.fromkeys(filter(any, patterns)))}
    return np.array([bodies.get(pattern, -1) for pattern in patterns], dtype=np.int64)


def surface_of(body: Capsules, moved_by: BoolArray, kin: Kinematics, spacing: float = SPACING_M) -> Surface:
    """Return points, `spacing` [m] apart, over C capsules, without those inside another capsule of the same rigid body.

    `moved_by` (L, n) masks the joints that move a link; any posture does. A body far larger than any arm's is a
    RobotModelError.
    """
    size = 2 * np.pi * float((body.radius * (np.linalg.norm(body.b - body.a, axis=1) + 2 * body.radius)).sum())
    if len(body.radius) > _MOST_CAPSULES or not size <= _MOST_AREA:
        raise RobotModelError(
            f"The joints move {len(body.radius)} capsules of {size:.3g} m^2: describe the body by at most"
            f" {_MOST_CAPSULES} of {_MOST_AREA:g} m^2 in metres."
        )
    rigid = bodies_of(moved_by)
    _, a, b, _ = placed(body, kin)
    parts: list[tuple[IntArray, FloatArray, FloatArray, FloatArray]] = []
    for c in np.argsort(rigid[body.link], kind="stable"):
        point, normal, area = _on_capsule(a[c], b[c], float(body.radius[c]), spacing)
        others = (rigid[body.link] == rigid[body.link[c]]) & (np.arange(len(a)) != c)
        away = np.linalg.norm(from_axes(point, a[others], b[others])[1], axis=2)
        free = (away > body.radius[others]).all(axis=1)
        link = int(body.link[c])
        R = kin.rotation[link]
        local = (point[free] - kin.position[link]) @ R
        parts.append((np.full(int(free.sum()), link), local, normal[free] @ R, area[free]))
    links, points, normals, areas = (np.concatenate(group) for group in zip(*parts, strict=True))
    count = rigid[links]
    first = np.searchsorted(count, np.arange(int(rigid.max()) + 2))
    return Surface(links.astype(np.int64), points, normals, areas, count, first.astype(np.int64))


def _on_capsule(
    a: FloatArray, b: FloatArray, radius: float, spacing: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points (P, 3), normals (P, 3) and areas (P,) on the capsule from a to b (3,): rings, and its two poles."""
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length if length > 0 else np.array([0.0, 0.0, 1.0])
    aside = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    aside /= np.linalg.norm(aside)
    other = np.cross(along, aside)
    # rings: the cylinder's, then those of the caps by their angle from the equator
    rings = max(1, round(length / spacing))
    places = [((k + 0.5) / rings * length, 0.0, length / rings) for k in range(rings)]
    steps = max(1, round(radius * np.pi / 2 / spacing))
    for k in range(steps):
        low, high = k / steps * np.pi / 2, (k + 1) / steps * np.pi / 2
        width = radius * (np.sin(high) - np.sin(low))
        places += [(length, (low + high) / 2, width), (0.0, -(low + high) / 2, width)]
    points, normals, areas = [], [], []
    for number, (at, tilt, width) in enumerate(places):
        count = max(3, round(2 * np.pi * radius * np.cos(tilt) / spacing))
        turn = 2 * np.pi * (np.arange(count) + 0.5 * (number % 2)) / count
        normal = np.cos(tilt) * (np.outer(np.cos(turn), aside) + np.outer(np.sin(turn), other)) + np.sin(tilt) * along
        normals.append(normal)
        points.append(a + at * along + radius * normal)
        areas.append(np.full(count, 2 * np.pi * radius * width / count))
    return np.concatenate(points), np.concatenate(normals), np.concatenate(areas)
