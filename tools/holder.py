"""Write the printable holder of a sensor unit: a tray for board, battery and strap, and a lid for both sensors.

    python -m tools.holder build/holder

Both parts are sums and differences of boxes, so their exact mesh needs no geometry kernel.
"""

import argparse
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path

import numpy as np
import trimesh

Box = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
"""Start and end along x, y and z [mm]."""


@dataclass(frozen=True)
class Holder:
    """Sizes [mm] of tray and lid, both printed without supports."""

    length: float = 66.0
    """Inner length, along the strap's slots; the corner posts leave 54 mm for a board."""
    width: float = 34.0
    """Inner width: a cell of 500 mAh is 30 to 32 mm wide."""
    height: float = 16.0
    """Inner height above the floor, for cell, foam and board on top of each other."""
    wall: float = 2.0
    """Thickness of walls, floor and lid."""
    strap: float = 25.0
    """Width of the hook-and-loop strap that ties the holder to the link."""
    screw: float = 2.2
    """Width of a slot for an M2 screw."""
    pilot: float = 1.7
    """Width of a square hole in which an M2 screw cuts its thread."""

    def __post_init__(self) -> None:
        """Raise SystemExit for sizes that cannot be printed or assembled."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0.5 <= value <= 200.0:
                raise SystemExit(f"--{field.name} is {value:g} mm: give 0.5 to 200.")
        if self.length < self.strap + 4.0 * self.wall or self.width < 30.0 or self.pilot >= self.screw:
            raise SystemExit("The tray is too small for strap and sensors, or the pilot hole is wider than the screw.")

    def tray(self) -> trimesh.Trimesh:
        """Return the tray: the floor is on the link, the strap passes through two flanges."""
        x, y, w = self.length / 2, self.width / 2, self.wall
        flange, top = y + w + 8.0, w + self.height
        body: list[Box] = [((-x - w, x + w), (-flange, flange), (0, w)), ((-x - w, x + w), (-y - w, y + w), (0, top))]
        away: list[Box] = [((-x, x), (-y, y), (w, top))]
        away += [
            ((-self.strap / 2 - 0.5, self.strap / 2 + 0.5), tuple(sorted((s * (y + w + 2), s * (y + w + 6)))), (0, w))
            for s in (-1, 1)
        ]
        away.append(((x, x + w), (-6.0, 6.0), (top - 9.0, top)))  # USB, and the wires to the sensors
        posts: list[Box] = []
        for sx, sy in product((-1, 1), repeat=2):
            posts.append((_side(sx, x - 6.0, x), _side(sy, y - 6.0, y), (w, top)))
            away.append((_about(sx * (x - 3.0), self.pilot), _about(sy * (y - 3.0), self.pilot), (top - 8.0, top)))
        return solid(body, away[:1], posts, away[1:])

    def lid(self) -> trimesh.Trimesh:
        """Return the lid: both sensors are screwed on top, so that nothing covers the range finder."""
        x, y, w = self.length / 2, self.width / 2, self.wall
        away: list[Box] = [((-4.0, 4.0), (-2.5, 2.5), (0, w))]  # wires
        for sx, sy in product((-1, 1), repeat=2):
            away.append((_about(sx * (x - 3.0), self.screw), _about(sy * (y - 3.0), self.screw), (0, w)))
            # slots for boards whose holes are 7 to 19 mm apart
            away.append((_about(sx * (x / 2 + 1.0), self.screw), _side(sy, 3.5, 9.5), (0, w)))
        return solid([((-x - w, x + w), (-y - w, y + w), (0, w))], away)


def _about(middle: float, width: float) -> tuple[float, float]:
    return middle - width / 2, middle + width / 2


def _side(sign: int, near: float, far: float) -> tuple[float, float]:
    return (near, far) if sign > 0 else (-far, -near)


def solid(*steps: list[Box]) -> trimesh.Trimesh:
    """Return the watertight mesh of boxes that are added and subtracted in turn, with outward normals."""
    boxes = np.array([box for step in steps for box in step], dtype=float)
    edges = [np.unique(boxes[:, axis]) for axis in range(3)]
    full = np.zeros([len(edge) + 1 for edge in edges], dtype=bool)  # cells between edges, and empty ones around
    for order, step in enumerate(steps):
        for box in step:
            low, high = ([int(np.searchsorted(e, side[k])) for e, side in zip(edges, box, strict=True)] for k in (0, 1))
            full[tuple(slice(a + 1, b + 1) for a, b in zip(low, high, strict=True))] = order % 2 == 0
    quads = []
    for axis in range(3):
        step_up = np.diff(full.astype(int), axis=axis)
        for sign in (-1, 1):
            for cell in np.argwhere(step_up == sign):
                quads.append(_quad(cell, axis, edges, sign))
    corners = np.array(quads).reshape(-1, 3)
    first = 4 * np.arange(len(quads))
    faces = np.vstack([np.stack([first, first + k, first + k + 1], axis=1) for k in (1, 2)])
    return trimesh.Trimesh(corners, faces, process=True)


def _quad(cell: np.ndarray, axis: int, edges: list[np.ndarray], sign: int) -> list[list[float]]:
    """Return the corners of a cell's upper face along an axis, counterclockwise from outside."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    loop = [(0, 0), (1, 0), (1, 1), (0, 1)]
    corners = []
    for a, b in loop if sign < 0 else reversed(loop):
        corner = [0.0, 0.0, 0.0]
        corner[axis] = edges[axis][cell[axis]]
        corner[one] = edges[one][cell[one] - 1 + a]
        corner[two] = edges[two][cell[two] - 1 + b]
        corners.append(corner)
    return corners


def main() -> None:
    """Write tray.stl and lid.stl into a folder."""
    parser = argparse.ArgumentParser(description="Write the printable holder of a sensor unit, tray.stl and lid.stl.")
    parser.add_argument("folder", type=Path)
    for field in fields(Holder):
        parser.add_argument(f"--{field.name}", type=float, default=field.default, help=f"[mm], {field.default:g}")
    arguments = vars(parser.parse_args())
    folder, holder = arguments.pop("folder"), Holder(**arguments)
    folder.mkdir(parents=True, exist_ok=True)
    for name, part in (("tray", holder.tray()), ("lid", holder.lid())):
        part.export(folder / f"{name}.stl")
        size = " x ".join(f"{side:g}" for side in part.extents)
        print(f"{folder / name}.stl: {size} mm, {part.volume / 1000:.1f} cm3")


if __name__ == "__main__":
    main()
