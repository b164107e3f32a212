"""Surfaces that draw arm and hand: those of capsules, and those of the Panda's vendor.

The vendor's come with the package, coarse enough for a page.
"""

import math
from importlib.resources import files
from typing import cast

import numpy as np
import trimesh
from trimesh import Trimesh

from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

EDGE_M = 0.02
"""Distance of vertices along a capsule [m], at most: between them a colour runs evenly."""
AROUND = 18
"""Vertices round a capsule."""
UNIT_M = 1e-4
"""Unit of length in the file of the vendor's surfaces [m]."""
_VENDORS = files("pretouch.page") / "data" / "panda.npz"
"""The links of a Panda: vertices, whole numbers, and faces. `python -m tools.surfaces` makes it (NOTICE)."""


def capsule_surfaces(model: RobotModel) -> dict[int, Trimesh]:
    """The surface of each link that has a body, by its index, link frame."""
    return {int(i): surface_of(model.capsules.of_links(np.array([i]))) for i in np.unique(model.capsules.link)}


def surface_of(capsules: Capsules, around: int = AROUND) -> Trimesh:
    """Join the surfaces of capsules, at least one. Parts inside other capsules stay: they are not seen."""
    parts = zip(capsules.a, capsules.b, capsules.radius, strict=True)
    surfaces = [_surface(a, b, float(radius), around) for a, b, radius in parts]
    return cast("Trimesh", trimesh.util.concatenate(surfaces))


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
    with np.load(str(_VENDORS)) as arrays:
        links = {name.partition(":")[0] for name in arrays}
        return {
            model.link_index(link): Trimesh(UNIT_M * arrays[f"{link}:vertices"], arrays[f"{link}:faces"], process=False)
            for link in links
        }, ""
