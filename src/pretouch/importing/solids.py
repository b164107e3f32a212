"""Shapes of links, and the triangles of their surfaces."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pretouch.importing.meshes import Surface, read_mesh
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

    solid: Block | Cylinder | Rounded | Ellipsoid | MeshFile | Surface
    T_link_solid: FloatArray
    """(4, 4)"""


def surface_of(shapes: tuple[Shape, ...]) -> Surface:
    """Return the triangles of all shapes of a link, link frame."""
    vertices, faces, count = [], [], 0
    for shape in shapes:
        one = _triangles(shape.solid)
        vertices.append(one.vertices @ shape.T_link_solid[:3, :3].T + shape.T_link_solid[:3, 3])
        faces.append(one.faces + count)
        count += len(one.vertices)
    return Surface(np.concatenate(vertices), np.concatenate(faces))


def _triangles(solid: Block | Cylinder | Rounded | Ellipsoid | MeshFile | Surface) -> Surface:
    match solid:
        case Surface():
            return solid
        case MeshFile(find, scale):
            read = read_mesh(find())
            # a mirrored mesh is turned inside out, or its triangles would face inwards
            faces = read.faces if np.prod(scale) > 0 else read.faces[:, ::-1]
            return Surface(read.vertices * np.array(scale), faces)
        case Block(half):
            profile = np.array([[0.0, -1.0], [np.sqrt(2), -1.0], [np.sqrt(2), 1.0], [0.0, 1.0]])
            return _revolved(profile, 4, np.pi / 4, np.array(half))
        case Cylinder(radius, half):
            profile = np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]])
            return _revolved(profile, _TURN)
        case Rounded(radius, half):
            angle = np.linspace(-np.pi / 2, np.pi / 2, _TURN // 2 + 2)
            height = radius * np.sin(angle) + np.where(angle > 0, half, -half)
            return _revolved(np.column_stack([radius * np.cos(angle), height]), _TURN)
        case Ellipsoid(half):
            angle = np.linspace(-np.pi / 2, np.pi / 2, _TURN // 2 + 1)
            return _revolved(np.column_stack([np.cos(angle), np.sin(angle)]), _TURN, 0.0, np.array(half))


def _revolved(profile: FloatArray, turns: int, first: float = 0.0, scale: FloatArray | float = 1.0) -> Surface:
    """Turn a profile (P, 2) of radius and height, from the lower end of the axis to the upper, about z."""
    angle = first + 2 * np.pi * np.arange(turns) / turns
    radius, height = profile[:, 0, None], np.repeat(profile[:, 1, None], turns, axis=1)
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(len(profile) - 1), np.arange(turns), indexing="ij")
    a, b = row * turns + column, row * turns + (column + 1) % turns
    c, d = b + turns, a + turns
    faces = np.concatenate([np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)])
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return Surface(vertices * scale, faces[area > 0].astype(np.int64))
