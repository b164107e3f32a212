"""The body of an arm as capsules, and how far they are off its surfaces."""

from dataclasses import dataclass

import numpy as np
from trimesh import Trimesh

from pretouch.errors import RobotModelError
from pretouch.importing.capsule_fit import MOST, Rods, covering, farthest_out, fitted, points_around
from pretouch.importing.chain import Arm
from pretouch.importing.solids import Rounded, Shape, surface_of
from pretouch.importing.surface_distance import SurfaceDistance
from pretouch.types import FloatArray

_MOST_GIVEN = 6
"""A link whose shapes are as many balls and capsules at most keeps them as they are."""
_CHECKED = 1500
"""Points around a link at which its distances are compared."""
_LARGEST = 5.0
"""Size of a link beyond which it is taken for one in millimetres [m]."""
NEAREST, FARTHEST = 0.002, 0.3
"""Heights above the surface of points at which distances are compared [m]."""


@dataclass(frozen=True)
class FitError:
    """Distance to capsules minus distance to surfaces, of points around them [m]; not a number without any point."""

    p5: float
    """5 % are below: the capsules stand over the surface there."""
    p95: float
    """5 % are above: the surface sticks out of the capsules there."""
    largest: float
    """Largest in size."""
    rms: float
    """Root of the mean square."""
    points: int
    """Number of points."""


@dataclass(frozen=True, eq=False)
class LinkBody:
    """The capsules of one link."""

    link: int
    """Its index."""
    rods: Rods
    """Link frame."""
    surface: SurfaceDistance
    """Of its shapes, link frame."""
    fitted: bool
    """Whether they stand for other shapes; otherwise the file has them so."""
    error: FitError
    """Of distances from points around this link to this link."""
    sticks_out: float
    """How far the surface sticks out of the capsules at most [m], up to 0.1 mm too much."""


def body_of(arm: Arm, most: int = MOST, cover: bool = False) -> tuple[tuple[LinkBody, ...], tuple[str, ...]]:
    """Return the capsules of all links that have a surface, and a sentence for each thing that was assumed.

    Args:
        arm: the arm.
        most: capsules for one link at most.
        cover: whether fitted capsules are enlarged until no surface sticks out of them.
    """
    remarks = []
    visual = [link.name for link in arm.source.links if link.visual and not link.collision]
    if visual:
        remarks.append(f"Without collision geometry, so fitted to the visual geometry: {', '.join(visual)}.")
    shapes = {i: link.collision or link.visual for i, link in enumerate(arm.source.links)}
    # every mesh is read before the first link is fitted: what is wrong with one is said at once
    surfaces = {i: _surface(arm.source.links[i].name, own) for i, own in shapes.items() if own}
    if not any(i in surfaces for i in _moving(arm)):
        raise RobotModelError(
            f"No moving link of {arm.source.name} has any geometry: give the links <collision> or <visual> shapes."
        )
    bodies = [_link_body(i, shapes[i], SurfaceDistance(surface), most, cover) for i, surface in surfaces.items()]
    bare = [arm.source.links[i].name for i in _moved(arm) if not (arm.source.links[i].collision or
                                                                  arm.source.links[i].visual)]  # fmt: skip
    if bare:
        remarks.append(f"Without any geometry, so without a capsule: {', '.join(bare)}.")
    return tuple(bodies), tuple(remarks)


def _moved(arm: Arm) -> list[int]:
    """Links that have a joint of the arm."""
    return [i for i, link in enumerate(arm.source.links) if link.joints]


def _moving(arm: Arm) -> list[int]:
    """Links that a joint of the arm moves, their own or one before them."""
    return [i for i in range(len(arm.source.links)) if any(arm.source.links[k].joints for k in arm.source.ancestors(i))]


def _surface(link: str, shapes: tuple[Shape, ...]) -> Trimesh:
    """Return the triangles of a link; one of no possible size is a RobotModelError."""
    surface = surface_of(shapes)
    size = float(surface.extents.max())
    if size > _LARGEST:
        raise RobotModelError(
            f"The link {link} is {size:.4g} m long: if its meshes are in millimetres, give them the scale"
            ' "0.001 0.001 0.001" in the file.'
        )
    return surface


def _link_body(index: int, shapes: tuple[Shape, ...], surface: SurfaceDistance, most: int, cover: bool) -> LinkBody:
    given = _given(shapes)
    rods = given or fitted(surface, most)
    if cover and given is None:
        rods = covering(rods, surface.parts)
    points = points_around(surface, 2 * _CHECKED, NEAREST, FARTHEST, skip=100_003)[:_CHECKED]
    error = fit_error(rods(points) - surface(points))
    return LinkBody(index, rods, surface, given is None, error, farthest_out(rods, surface.corners))


def fit_error(difference: FloatArray) -> FitError:
    """Sum up differences (P,) of distances [m]."""
    if not len(difference):
        return FitError(np.nan, np.nan, np.nan, np.nan, 0)
    p5, p95 = np.percentile(difference, [5, 95])
    largest = difference[np.abs(difference).argmax()]
    return FitError(float(p5), float(p95), float(largest), float(np.sqrt((difference**2).mean())), len(difference))


def _given(shapes: tuple[Shape, ...]) -> Rods | None:
    """Return a link's own capsules and balls, if it has nothing else."""
    if len(shapes) > _MOST_GIVEN or not all(isinstance(shape.solid, Rounded) for shape in shapes):
        return None
    a, b, radius = [], [], []
    for shape in shapes:
        if isinstance(shape.solid, Rounded):
            half = max(shape.solid.half, 1e-4) * shape.T_link_solid[:3, 2]
            a.append(shape.T_link_solid[:3, 3] - half)
            b.append(shape.T_link_solid[:3, 3] + half)
            radius.append(shape.solid.radius)
    return Rods(np.array(a), np.array(b), np.array(radius))


def whole_arm_error(arm: Arm, bodies: tuple[LinkBody, ...], q: FloatArray, around: FloatArray) -> FitError:
    """Compare the distance of the nearest surface of the whole arm in many postures.

    Args:
        arm: the arm.
        bodies: its links' capsules and surfaces.
        q: (S, n) postures [rad].
        around: (S, P, 3) places in the frame of the first link, from which the distances are taken; those inside the
            arm or farther from it than `FARTHEST` are left out [m].
    """
    differences = [_differences(arm, bodies, posture, points) for posture, points in zip(q, around, strict=True)]
    return fit_error(np.concatenate(differences))


def _differences(arm: Arm, bodies: tuple[LinkBody, ...], q: FloatArray, points: FloatArray) -> FloatArray:
    names = [joint.name for joint in arm.joints]
    poses = arm.source.poses(dict(zip(names, q.tolist(), strict=True)))
    capsules, surfaces = np.full(len(points), np.inf), np.full(len(points), np.inf)
    out = np.ones(len(points), dtype=np.bool_)
    for body in bodies:
        T = poses[body.link]
        own = (points - T[:3, 3]) @ T[:3, :3]
        capsules = np.minimum(capsules, body.rods(own))
        least = body.surface.box_distance(own)
        near = least < np.minimum(surfaces, FARTHEST)
        surfaces[near] = np.minimum(surfaces[near], body.surface(own[near]))
        within = least == 0
        out[within] &= body.surface.outside(own[within])
    kept = out & (surfaces < FARTHEST)
    return (capsules - surfaces)[kept]
