"""Shapes of links, and the triangles of their surfaces."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from trimesh import Trimesh, creation
from trimesh.util import append_faces

from pretouch.importing.meshes import read_mesh
from pretouch.types import FloatArray

_TURN = 48
"""Corners of a circle: its polygon is less than 0.3 % of the radius off."""


@dataclass(frozen=True)
class Block:
    """A box about its frame's origin."""

    half: tuple[float, float, float]
    """[m]"""


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along z about its frame's origin."""

    radius: float
    half: float
    """Half its length [m]."""


@dataclass(frozen=True)
class Rounded:
    """A capsule along z about its frame's origin; a ball if it has no length."""

    radius: float
    half: float
    """Half the length of its axis [m]."""


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid about its frame's origin."""

    half: tuple[float, float, float]
    """Its half axes [m]."""


@dataclass(frozen=True)
class MeshFile:
    """A mesh that is found and read when it is needed."""

    find: Callable[[], Path]
    scale: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Shape:
    """A solid at a place on its link."""

    solid: Block | Cylinder | Rounded | Ellipsoid | MeshFile | Trimesh
    T_link_solid: FloatArray
    """(4, 4)"""


def surface_of(shapes: tuple[Shape, ...]) -> Trimesh:
    """Return the triangles of all shapes of a link, link frame."""
    placed = [_triangles(shape.solid).copy().apply_transform(shape.T_link_solid) for shape in shapes]
    return Trimesh(*append_faces([one.vertices for one in placed], [one.faces for one in placed]), process=False)


def _triangles(solid: Block | Cylinder | Rounded | Ellipsoid | MeshFile | Trimesh) -> Trimesh:
    # round solids are made of radius 1 [m], since trimesh leaves out triangles below a fixed area
    match solid:
        case Trimesh():
            return solid
        case MeshFile(find, scale):
            return read_mesh(find()).apply_scale(scale)
        case Block(half):
            return creation.box(2 * np.array(half))
        case Cylinder(radius, half):
            return creation.cylinder(1.0, 2 * half / radius, _TURN).apply_scale(radius)
        case Rounded(radius, half):
            return creation.capsule(2 * half / radius, 1.0, (_TURN // 2, _TURN)).apply_scale(radius)
        case Ellipsoid(half):
            return creation.uv_sphere(1.0, (_TURN // 2, _TURN // 2)).apply_scale(half)
