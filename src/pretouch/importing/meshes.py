"""Mesh files: where those are that a URDF names, and their triangles, read by trimesh."""

import warnings
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import trimesh

from pretouch.errors import RobotModelError
from pretouch.extras import MESHES

SUFFIXES = (".stl", ".obj", ".dae")


def find_mesh(uri: str, file: Path, folders: tuple[Path, ...]) -> Path:
    """Return the mesh file that a URDF names: relative to it, by absolute path, or in a ROS package.

    The package `p` of package://p/rest is looked for as the folder `p` in `folders`, or one of them, then in the folder
    of the URDF and in each above it. A mesh that is not found is a RobotModelError.
    """
    scheme, _, name = unquote(uri).replace("\\", "/").rpartition("://")
    near = file.resolve().parent
    places = [near / (name.removeprefix("localhost") if scheme == "file" else name)]
    way_out = f"put it at {places[0]}, where the URDF says"
    if scheme in ("package", "model"):
        package, _, rest = name.partition("/")
        around = [*folders, near, *near.parents]
        places = [folder / name for folder in around] + [folder / rest for folder in around if folder.name == package]
        way_out = f"give --package-path the folder that holds the package {package}"
    for place in places:
        with suppress(OSError, ValueError):  # a name may be too long, or none
            if place.is_file():
                return place
    raise RobotModelError(f"The mesh {uri} was not found: {way_out}.")


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
    if not len(mesh.faces) or not np.isfinite(mesh.triangles).all() or not np.any(mesh.triangles_cross):
        raise RobotModelError(
            f"The mesh {path} holds no triangle with an area and finite corners, or is truncated: give a complete file."
        )
    return mesh


def _check_obj(data: bytes) -> None:
    """Refuse corners counted backwards or from 0: trimesh 5.2 takes them for other ones."""
    faces = (line.split()[1:] for line in data.splitlines() if line.startswith(b"f "))
    if any(int(corner.split(b"/")[0]) < 1 for face in faces for corner in face):
        raise ValueError("its faces do not count their corners from 1 onwards: save it anew by another program")
