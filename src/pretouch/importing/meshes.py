"""Mesh files: where those are that a URDF names, and their triangles, read by trimesh."""

import warnings
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import trimesh

from pretouch.errors import RobotModelError
from pretouch.extras import MESHES

SUFFIXES = (".stl", ".obj", ".dae")


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
        scheme, _, name = unquote(uri).replace("\\", "/").rpartition("://")
        if scheme in ("package", "model"):
            package, _, rest = name.partition("/")
            own = [folder / rest for folder in self._folders if folder.name == package]
            places = [folder / package / rest for folder in self._folders] + own
            way_out = f"give --package-path the folder that holds the package {package}"
        else:
            places = [self._near / (name.removeprefix("localhost") if scheme == "file" else name)]
            way_out = f"put it at {places[0]}, where the URDF says"
        place = next((place for place in places if _is_file(place)), None)
        if place is None:
            raise RobotModelError(f"The mesh {uri} was not found: {way_out}.")
        return place


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a zero
        return False


def read_mesh(path: Path) -> trimesh.Trimesh:
    """Read a mesh file, as its suffix says, in metres. What is wrong with it is a RobotModelError that names it.

    Nothing but the file itself is read: no materials or textures beside it.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RobotModelError(f"The mesh {path} has an unknown format: use {', '.join(SUFFIXES)}.")
    if suffix == ".dae":
        MESHES.need(f"The mesh {path}, a COLLADA file,")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "string or file could not be read")  # NumPy would leave the rest out
            data = path.read_bytes()
            if suffix == ".obj":
                _check_obj(data)
            scene = trimesh.load_scene(BytesIO(data), suffix[1:], process=False)
            mesh = (scene.convert_units("meters") if scene.units else scene).to_mesh()
    except Exception as error:  # whatever a library makes of a broken file
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise RobotModelError(f"The mesh {path} is damaged: {reason}.") from error
    if not len(mesh.faces):
        raise RobotModelError(f"The mesh {path} holds no triangle, or is truncated: give a complete file.")
    if not np.all(np.isfinite(mesh.triangles)):
        raise RobotModelError(f"The mesh {path} is damaged: a coordinate is not finite.")
    if not np.any(mesh.triangles_cross):
        raise RobotModelError(
            f"The mesh {path} has no area, because its triangles are lines or points: give one with area."
        )
    return mesh


def _check_obj(data: bytes) -> None:
    """Refuse corners counted backwards or from 0: trimesh 5.2 takes them for other ones."""
    faces = (line.split()[1:] for line in data.splitlines() if line.startswith(b"f "))
    if any(int(corner.split(b"/")[0]) < 1 for face in faces for corner in face):
        raise ValueError("its faces do not count their corners from 1 onwards: save it anew by another program")
