"""Triangles from mesh files: STL and OBJ by themselves, COLLADA by trimesh."""

import warnings
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.types import FloatArray, IntArray

SUFFIXES = (".stl", ".obj", ".dae")
_LARGEST_FILE = 200_000_000
"""[bytes]"""
_MOST_TRIANGLES = 1_000_000
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles."""

    vertices: FloatArray
    """(V, 3) [m]."""
    faces: IntArray
    """(F, 3) indices of each triangle's corners, anticlockwise seen from outside."""

    @property
    def corners(self) -> FloatArray:
        """Corners (F, 3, 3) of the triangles [m]."""
        return self.vertices[self.faces]


def read_mesh(path: Path) -> Surface:
    """Read a mesh file, as its suffix says. What is wrong with it is a RobotModelError that names it."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RobotModelError(f"The mesh {path} is none that can be read: use {', '.join(SUFFIXES)}.")
    try:
        size = path.stat().st_size
        if not path.is_file() or size > _LARGEST_FILE:
            raise RobotModelError(
                f"The mesh {path} is no file of at most {_LARGEST_FILE // 10**6} MB: make it coarser."
            )
        read = _collada(path) if suffix == ".dae" else (_stl if suffix == ".stl" else _obj)(path.read_bytes())
    except OSError as error:
        raise RobotModelError(f"The mesh {path} cannot be read: {error.strerror}.") from error
    except (ValueError, IndexError, OverflowError) as error:
        raise RobotModelError(f"The mesh {path} is damaged: {error}.") from error
    _check(read, path)
    return read


def _check(read: Surface, path: Path) -> None:
    if not len(read.faces):
        raise RobotModelError(f"The mesh {path} holds no triangle: give one that does.")
    if len(read.faces) > _MOST_TRIANGLES:
        raise RobotModelError(
            f"The mesh {path} has {len(read.faces)} triangles: make it coarser, {_MOST_TRIANGLES} at most."
        )
    used = read.vertices[read.faces]
    if not np.all(np.isfinite(used)):
        raise RobotModelError(f"The mesh {path} is damaged: a coordinate is no finite number.")


def _stl(data: bytes) -> Surface:
    if len(data) >= _HEADER:
        count = int(np.frombuffer(data, "<u4", 1, 80)[0])
        if len(data) == _HEADER + count * _RECORD.itemsize:
            corners = np.frombuffer(data, _RECORD, count, _HEADER)["corners"].astype(np.float64)
            return _joined(corners)
    if not data.lstrip()[:5].lower() == b"solid":
        raise ValueError("its length is not what its number of triangles asks for")
    words = [line.split()[1:4] for line in data.decode("ascii", "replace").splitlines() if "vertex" in line]
    return _joined(np.array(words, dtype=np.float64).reshape(-1, 3, 3))


def _joined(corners: FloatArray) -> Surface:
    """Give corners (F, 3, 3) at the same place one vertex."""
    vertices, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Surface(vertices, index.reshape(-1, 3).astype(np.int64))


def _obj(data: bytes) -> Surface:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in data.decode("utf-8", "replace").splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            vertices.append([float(x) for x in rest[:3]])
        elif word == "f":
            corners = [int(x.split("/")[0]) for x in rest]
            corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
            faces += [(corners[0], *pair) for pair in pairwise(corners[1:])]
    index = np.array(faces, dtype=np.int64).reshape(-1, 3)
    if len(index) and (index.min() < 0 or index.max() >= len(vertices)):
        raise ValueError("a triangle has a corner that is not there")
    return Surface(np.array(vertices, dtype=np.float64).reshape(-1, 3), index)


def _collada(path: Path) -> Surface:
    if not (find_spec("trimesh") and find_spec("collada")):
        raise RobotModelError(
            f"The mesh {path} is a COLLADA file: pip install 'pretouch[viewer,meshes]' to read it, or give STL."
        )
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = trimesh.load_scene(path)
            mesh = (scene.convert_units("meters") if scene.units else scene).to_mesh()
            return Surface(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))
    except Exception as error:  # whatever a library makes of a broken file
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise RobotModelError(f"The mesh {path} is damaged: {reason}.") from error
