"""Surfaces that draw arm and hand: those of capsules, and those of the Panda's vendor.

The vendor's come from the extra `meshes`, if it is installed, and are made coarse enough for a page.
"""

import math
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import cast

import numpy as np
import trimesh
from trimesh import Trimesh

from pretouch.extras import MESHES
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

EDGE_M = 0.02
"""Distance of vertices along a capsule [m], at most: between them a colour runs evenly."""
AROUND = 18
"""Vertices round a capsule."""
CELL_M = 0.006
"""Size of the cells in which the vertices of the vendor's surfaces are merged into one [m]."""
_LONGEST_M = 0.015
"""Longest edge of the vendor's surfaces [m]: flat faces of a few large triangles could not be coloured in between."""
_FINGER_HEIGHT_M = 0.0584
"""Height of a finger's frame over the hand's (the vendor's URDF)."""


def capsule_surfaces(model: RobotModel) -> dict[int, Trimesh]:
    """The surface of each link that has a body, by its index, link frame."""
    return {int(i): surface_of(model.capsules.of_links(np.array([i]))) for i in np.unique(model.capsules.link)}


def surface_of(capsules: Capsules, around: int = AROUND) -> Trimesh:
    """Join the surfaces of capsules, at least one. Parts inside other capsules stay: they are not seen."""
    parts = zip(capsules.a, capsules.b, capsules.radius, strict=True)
    return _joined([_surface(a, b, float(radius), around) for a, b, radius in parts])


def _joined(meshes: Sequence[Trimesh]) -> Trimesh:
    return cast("Trimesh", trimesh.util.concatenate(meshes))


def _surface(a: FloatArray, b: FloatArray, radius: float, around: int) -> Trimesh:
    length = float(np.linalg.norm(b - a))
    T = np.eye(4) if length == 0.0 else trimesh.geometry.align_vectors((0, 0, 1), b - a)
    T[:3, 3] = a
    tilt = np.linspace(0.0, np.pi / 2, around // 4 + 1)[1:]
    across, up = radius * np.cos(tilt), radius * np.sin(tilt)
    across[-1] = 0.0  # the poles
    straight = np.linspace(0.0, length, math.ceil(length / EDGE_M) + 1) if length else np.zeros(1)
    profile = np.concatenate([across[::-1], np.full(len(straight), radius), across])
    height = np.concatenate([-up[::-1], straight, length + up])
    return trimesh.creation.revolve(np.column_stack([profile, height]), sections=around, transform=T)


def vendor_surfaces(model: RobotModel) -> tuple[dict[int, Trimesh], str]:
    """Surfaces by link index, link frame, and a sentence: none and why, or all and ''."""
    if model.description.name != "panda":
        return {}, f"The arm is drawn by its capsules, because there are no surfaces for {model.description.name}."
    folder = _vendor_folder()
    if folder is None or MESHES.missing():
        return {}, f"The arm is drawn by its capsules; for the vendor's surfaces run {MESHES.command}"
    links = [f"panda_link{i}" for i in range(8)] + ["panda_hand"]
    return {model.link_index(link): _vendor_surface(folder, link) for link in links}, ""


def _vendor_surface(folder: Path, link: str) -> Trimesh:
    mesh = coarse(_read(folder / f"{link.removeprefix('panda_')}.dae"))
    if link != "panda_hand":
        return mesh
    finger = _read(folder / "finger.dae").apply_translation((0, 0, _FINGER_HEIGHT_M))
    other = finger.copy().apply_transform(np.diag([-1.0, -1.0, 1.0, 1.0]))
    return _joined([mesh, coarse(finger), coarse(other)])


def _read(file: Path) -> Trimesh:
    return trimesh.load_scene(file).to_mesh().subdivide_to_size(_LONGEST_M)


def coarse(mesh: Trimesh, cell: float = CELL_M) -> Trimesh:
    """Merge the vertices in each cell [m] into their mean, and drop the triangles that vanish."""
    _, place, count = np.unique(np.rint(mesh.vertices / cell), axis=0, return_inverse=True, return_counts=True)
    total = np.zeros((len(count), 3))
    np.add.at(total, place.ravel(), mesh.vertices)
    merged = Trimesh(total / count[:, None], place.ravel()[mesh.faces], process=False)
    merged.update_faces(merged.nondegenerate_faces() & merged.unique_faces())
    merged.remove_unreferenced_vertices()
    return merged


def _vendor_folder() -> Path | None:
    """Folder of the surfaces' package; it has only files and is no Python package."""
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError:
        return None
    meshes = (f for f in listed if f.name == "link0.dae" and "panda_description/meshes/visual" in f.as_posix())
    first = next(meshes, None)
    return None if first is None else Path(str(first.locate())).parent
