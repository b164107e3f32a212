"""The Panda's surfaces for the page, made coarse from those of the vendor's description.

    python -m tools.surfaces

It takes `make meshes`. The description is under the Apache License 2.0 (NOTICE).
"""

from importlib.metadata import files
from pathlib import Path

import numpy as np
import trimesh
from trimesh import Trimesh

from pretouch.page.surfaces import UNIT_M

CELL_M = 0.008
"""Size of the cells in which vertices are merged into one [m]."""
_LONGEST_M = 0.015
"""Longest edge [m]: flat faces of a few large triangles could not be coloured in between."""
_FINGER_HEIGHT_M = 0.0584
"""Height of a finger's frame over the hand's (the vendor's URDF)."""


def coarse(mesh: Trimesh, cell: float = CELL_M) -> Trimesh:
    """Merge the vertices in each cell [m] into their mean, and drop the triangles that vanish."""
    _, place, count = np.unique(np.rint(mesh.vertices / cell), axis=0, return_inverse=True, return_counts=True)
    total = np.zeros((len(count), 3))
    np.add.at(total, place.ravel(), mesh.vertices)
    merged = Trimesh(total / count[:, None], place.ravel()[mesh.faces], process=False)
    merged.update_faces(merged.nondegenerate_faces() & merged.unique_faces())
    merged.remove_unreferenced_vertices()
    return merged


def coarse_links(folder: Path) -> dict[str, Trimesh]:
    """Read the links' surfaces from the vendor's folder, the fingers with the hand, each in its link's frame."""

    def read(name: str) -> Trimesh:
        return trimesh.load_scene(folder / f"{name}.dae").to_mesh().subdivide_to_size(_LONGEST_M)

    finger = read("finger").apply_translation((0, 0, _FINGER_HEIGHT_M))
    other = finger.copy().apply_transform(np.diag([-1.0, -1.0, 1.0, 1.0]))
    links = {f"panda_link{i}": coarse(read(f"link{i}")) for i in range(8)}
    return links | {"panda_hand": trimesh.util.concatenate([coarse(read("hand")), coarse(finger), coarse(other)])}


def main() -> None:
    """Write the file that comes with the package."""
    listed = files("example-robot-data") or []
    first = next(f for f in listed if f.as_posix().endswith("panda_description/meshes/visual/link0.dae"))
    arrays = dict[str, np.ndarray]()
    for link, mesh in coarse_links(Path(str(first.locate())).parent).items():
        arrays[f"{link}:vertices"] = np.rint(mesh.vertices / UNIT_M).astype(np.int16)
        arrays[f"{link}:faces"] = mesh.faces.astype(np.uint16)
    place = Path("src/pretouch/page/data/panda.npz")
    place.parent.mkdir(exist_ok=True)
    np.savez_compressed(place, **arrays)


if __name__ == "__main__":
    main()
