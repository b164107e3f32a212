"""The vendor's surfaces of an arm, made coarse enough for a page; from the extra `meshes`, if it is installed."""

from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, files, version
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from pretouch.atomic_write import atomic_replacement
from pretouch.compiled import kept_in
from pretouch.extras import MESHES
from pretouch.robot.model import RobotModel
from pretouch.source_digest import source_digest
from pretouch.types import FloatArray, IntArray
from pretouch.viewer.surface import Mesh

_PACKAGE = "example-robot-data"

CELL_M = 0.006
"""Size of the cells whose vertices are merged into one [m]."""

_EDGE_M = 0.015
"""Longest edge [m]: flat faces of a few large triangles could not be coloured in between."""

_FINGER_HEIGHT_M = 0.0584
"""Height of a finger's frame over the hand's (the vendor's URDF)."""

_PARTS = ("vertices", "faces", "normals")


def vendor_surfaces(model: RobotModel) -> tuple[dict[int, Mesh], str]:
    """Surfaces by link index, link frame, and a sentence: none and why, or all and ''."""
    if model.description.name != "panda":
        return {}, f"The arm is drawn by its capsules, because there are no surfaces for {model.description.name}."
    folder = _folder()
    if folder is None or MESHES.missing():
        return {}, f"The arm is drawn by its capsules; for the vendor's surfaces run {MESHES.command}"

    links = {i: link for i, link in enumerate(model.links) if _has_one(link)}
    return dict(zip(links, _surfaces(folder, tuple(links.values())), strict=True)), ""


@cache
def _surfaces(folder: Path, links: tuple[str, ...]) -> tuple[Mesh, ...]:
    """Make the surfaces of links, which takes a second and a half, or take what was kept beside compiled functions."""
    name = f"surfaces-{version(_PACKAGE)}-{source_digest(coarse)[:12]}.npz"
    place = Path(kept_in(), "__pycache__", name) if kept_in() else None  # elsewhere it would count as a source
    if place is not None:
        with suppress(OSError, EOFError, ValueError, KeyError, BadZipFile), np.load(place) as kept:
            return tuple(Mesh(*(kept[f"{link}.{part}"] for part in _PARTS)) for link in links)
    meshes = tuple(_surface(folder, link) for link in links)
    if place is not None:
        parts = {f"{link}.{part}": getattr(m, part) for link, m in zip(links, meshes, strict=True) for part in _PARTS}
        with suppress(OSError):
            place.parent.mkdir(exist_ok=True)
            with atomic_replacement(place) as unfinished, unfinished.open("wb") as file:
                np.savez(file, **parts)
    return meshes


def _surface(folder: Path, link: str) -> Mesh:
    mesh = coarse(*_read(folder / f"{link.removeprefix('panda_')}.dae"))
    if link != "panda_hand":
        return mesh
    vertices, faces = _read(folder / "finger.dae")
    turns = np.eye(3), np.diag([-1.0, -1.0, 1.0])
    return _joined(mesh, *(coarse(vertices @ turn + (0, 0, _FINGER_HEIGHT_M), faces) for turn in turns))


def _read(file: Path) -> tuple[FloatArray, IntArray]:
    import trimesh  # takes a third of a second, and is not needed where surfaces are kept

    mesh = trimesh.load_scene(file).to_mesh()
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, max_edge=_EDGE_M)
    return np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)


def coarse(vertices: FloatArray, faces: IntArray, cell: float = CELL_M) -> Mesh:
    """Merge the vertices (V, 3) [m] in each cell [m] into their mean, and drop the triangles that vanish."""
    _, place, count = np.unique(np.rint(vertices / cell), axis=0, return_inverse=True, return_counts=True)
    total = np.zeros((len(count), 3))
    np.add.at(total, place.ravel(), vertices)
    merged = total / count[:, None]
    corners = place.ravel()[faces]
    whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    kept = corners[whole]
    _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    kept = kept[np.sort(first)]
    used, renumbered = np.unique(kept, return_inverse=True)
    corners = renumbered.reshape(-1, 3).astype(np.int64)
    from trimesh import Trimesh

    found = Trimesh(merged[used], corners, process=False)
    return Mesh(merged[used], corners, np.array(found.vertex_normals))


def _has_one(link: str) -> bool:
    return link == "panda_hand" or (link.startswith("panda_link") and link != "panda_link8")


def _joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
        np.concatenate([mesh.normals for mesh in meshes]),
    )


def _folder() -> Path | None:
    """Where the package keeps the surfaces; it is no Python package, only files."""
    try:
        listed = files(_PACKAGE) or []
    except PackageNotFoundError:
        return None
    found = [f for f in listed if f.name == "link0.dae" and "panda_description/meshes/visual" in f.as_posix()]
    return Path(str(found[0].locate())).parent if found else None
