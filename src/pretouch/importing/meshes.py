"""Mesh files: where those are that a URDF names, and their triangles, STL and COLLADA read by trimesh.

OBJ is read here: trimesh 5.2 takes the corner 0, and corners counted backwards before the last vertex, for other ones.
"""

import warnings
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh

from pretouch.errors import RobotModelError
from pretouch.extras import MESHES

_SCHEMES = ("package://", "model://")
SUFFIXES = (".stl", ".obj", ".dae")
_MOST_TRIANGLES = 1_000_000


class MeshFinder:
    """Finds mesh files: relative to the URDF, by absolute path, or in a ROS package.

    The package `p` of package://p/rest is looked for as the folder `p` in the folders given, in the folder of the
    file, and in each folder above it.
    """

    def __init__(self, file: Path, folders: tuple[Path, ...]) -> None:
        """Take the URDF, and folders that hold packages, or are packages themselves."""
        for folder in folders:
            if not folder.is_dir():
                raise RobotModelError(f"The package path {folder} is not a folder: give one that holds ROS packages.")
        self._near = file.resolve().parent
        self._folders = [*folders, self._near, *self._near.parents]

    def find(self, uri: str) -> Path:
        """Return the file that a URI names; RobotModelError if there is none."""
        if "\0" in uri or len(uri) > 4000:
            raise RobotModelError(f"The mesh name {uri[:100]!r} is not a file name: correct it.")
        scheme = next((s for s in _SCHEMES if uri.startswith(s)), None)
        try:
            found = self._in_package(uri.removeprefix(scheme)) if scheme else self._plain(uri)
        except OSError:  # a name too long, for one
            found = None
        if found is None:
            way_out = (
                f"give --package-path the folder that holds the package {uri.removeprefix(scheme).split('/')[0]}"
                if scheme
                else "put it where the URDF says"
            )
            raise RobotModelError(f"The mesh {uri} was not found: {way_out}.")
        return found

    def _plain(self, uri: str) -> Path | None:
        path = self._near / uri.removeprefix("file://")
        return path if path.is_file() else None

    def _in_package(self, name: str) -> Path | None:
        package, _, rest = name.partition("/")
        for folder in self._folders:
            for path in (folder / package / rest, folder / rest if folder.name == package else None):
                if path is not None and path.is_file():
                    return path
        return None


def read_mesh(path: Path) -> trimesh.Trimesh:
    """Read a mesh file, as its suffix says. What is wrong with it is a RobotModelError that names it.

    Vertices at one place are one. Nothing but the file itself is read: no materials or textures beside it.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RobotModelError(f"The mesh {path} has an unknown format: use {', '.join(SUFFIXES)}.")
    if suffix == ".dae":
        MESHES.need(f"The mesh {path}, a COLLADA file,")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RobotModelError(f"The mesh {path} cannot be read: {error.strerror}.") from error
    try:
        mesh = _obj(data) if suffix == ".obj" else _by_trimesh(data, suffix[1:])
    except Exception as error:  # whatever a library makes of a broken file
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise RobotModelError(f"The mesh {path} is damaged: {reason}.") from error
    _check(mesh, path)
    mesh.merge_vertices()
    return mesh


def _by_trimesh(data: bytes, kind: str) -> trimesh.Trimesh:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", "string or file could not be read")  # NumPy would leave the rest out
        scene = trimesh.load_scene(BytesIO(data), kind, process=False)
        return (scene.convert_units("meters") if scene.units else scene).to_mesh()


def _check(read: trimesh.Trimesh, path: Path) -> None:
    if not len(read.faces):
        raise RobotModelError(f"The mesh {path} holds no triangle, or is truncated: give a complete file.")
    if len(read.faces) > _MOST_TRIANGLES:
        raise RobotModelError(
            f"The mesh {path} has {len(read.faces)} triangles: make it coarser, {_MOST_TRIANGLES} at most."
        )
    if not np.all(np.isfinite(read.triangles)):
        raise RobotModelError(f"The mesh {path} is damaged: a coordinate is not finite.")
    if not np.any(read.triangles_cross):
        raise RobotModelError(
            f"The mesh {path} has no area, because its triangles are lines or points: give one with area."
        )


def _three(words: list[str], line: int) -> list[float]:
    """Return the coordinates of a corner."""
    try:
        x, y, z = (float(word) for word in words[:3])
    except ValueError:
        raise ValueError(f"line {line} does not hold three numbers") from None
    return [x, y, z]


def _obj(data: bytes) -> trimesh.Trimesh:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for k, line in enumerate(data.decode("utf-8", "replace").splitlines(), 1):
        word, *rest = line.split() or [""]
        if word == "v":
            vertices.append(_three(rest, k))
        elif word == "f":
            try:
                corners = [int(x.split("/")[0]) for x in rest]
            except ValueError:
                raise ValueError(f"line {k} does not number its corners") from None
            corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
            faces += [(corners[0], *pair) for pair in pairwise(corners[1:])]
    index = np.array(faces, dtype=np.int64).reshape(-1, 3)
    if len(index) and (index.min() < 0 or index.max() >= len(vertices)):
        raise ValueError("a triangle refers to a missing corner")
    return trimesh.Trimesh(np.array(vertices).reshape(-1, 3), index, process=False)
