"""The vendor's surfaces of an arm, made coarse enough for a page; from the extra `meshes`, if it is installed."""

from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import numpy as np
import trimesh
from trimesh import Trimesh

from pretouch.extras import MESHES
from pretouch.page.expectation import joined
from pretouch.robot.model import RobotModel

_PACKAGE = "example-robot-data"

CELL_M = 0.006
"""Size of the cells whose vertices are merged into one [m]."""

_EDGE_M = 0.015
"""Longest edge [m]: flat faces of a few large triangles could not be coloured in between."""

_FINGER_HEIGHT_M = 0.0584
"""Height of a finger's frame over the hand's (the vendor's URDF)."""


def vendor_surfaces(model: RobotModel) -> tuple[dict[int, Trimesh], str]:
    """Surfaces by link index, link frame, and a sentence: none and why, or all and ''."""
    if model.description.name != "panda":
        return {}, f"The arm is drawn by its capsules, because there are no surfaces for {model.description.name}."
    folder = _folder()
    if folder is None or MESHES.missing():
        return {}, f"The arm is drawn by its capsules; for the vendor's surfaces run {MESHES.command}"

    links = {i: link for i, link in enumerate(model.links) if _has_one(link)}
    return {i: _surface(folder, link) for i, link in links.items()}, ""


def _surface(folder: Path, link: str) -> Trimesh:
    mesh = coarse(_read(folder / f"{link.removeprefix('panda_')}.dae"))
    if link != "panda_hand":
        return mesh
    finger = _read(folder / "finger.dae").apply_translation((0, 0, _FINGER_HEIGHT_M))
    other = finger.copy().apply_transform(np.diag([-1.0, -1.0, 1.0, 1.0]))
    return joined([mesh, coarse(finger), coarse(other)])


def _read(file: Path) -> Trimesh:
    return trimesh.load_scene(file).to_mesh().subdivide_to_size(_EDGE_M)


def coarse(mesh: Trimesh, cell: float = CELL_M) -> Trimesh:
    """Merge the vertices in each cell [m] into their mean, and drop the triangles that vanish."""
    _, place, count = np.unique(np.rint(mesh.vertices / cell), axis=0, return_inverse=True, return_counts=True)
    total = np.zeros((len(count), 3))
    np.add.at(total, place.ravel(), mesh.vertices)
    merged = Trimesh(total / count[:, None], place.ravel()[mesh.faces], process=False)
    corners = np.sort(merged.faces, axis=1)
    merged.update_faces((np.diff(corners, axis=1) > 0).all(axis=1) & merged.unique_faces())
    merged.remove_unreferenced_vertices()
    return merged


def _has_one(link: str) -> bool:
    return link == "panda_hand" or (link.startswith("panda_link") and link != "panda_link8")


def _folder() -> Path | None:
    """Where the package keeps the surfaces; it is no Python package, only files."""
    try:
        listed = files(_PACKAGE) or []
    except PackageNotFoundError:
        return None
    found = [f for f in listed if f.name == "link0.dae" and "panda_description/meshes/visual" in f.as_posix()]
    return Path(str(found[0].locate())).parent if found else None
