"""The arm of the page: its links, coloured where contact is expected (paper, Fig. 1).

The formula is ours, the paper gives none. A unit whose obstacle is at distance d from the body expects contact by e =
(d_max - d) / (d_max - d_min), clipped to [0, 1], as eq. 11 grades it. A vertex at distance r from a unit, whose normal
makes the angle phi with the unit's beam, takes the share w = (1 - (r / L)^2)^2 (1 + cos phi) / 2 of it, 0 from r = L
on, and what several units expect adds up as 1 - prod(1 - e w).
"""

from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from viser import SceneApi

from pretouch.contact.moving_thresholds import obstacle_force
from pretouch.page import palette
from pretouch.params import ThresholdParams
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, IntArray, Obstacles

SPREAD_M = 0.12
"""Distance L from a unit at which its reading colours the surface no more [m]."""
LEVELS = 24
"""Steps from nothing expected to all of it: a part whose units keep theirs is not sent again."""
SETTLE_S = 0.2
"""Time a page is given to read a mesh before it is shown [s]; a link is sent at most once in it."""
_UNDER_M = 0.0015
"""How deep the plain surface lies under the coloured one [m]: a page too slow to read one in time shows the other."""
SHADELESS: dict[str, Any] = {"cast_shadow": False, "receive_shadow": False}
"""Options of all objects in the scene: shadows would cost a phone more than they show."""


def quaternions(rotation: FloatArray) -> FloatArray:
    """Quaternions (..., 4) as (w, x, y, z) of rotations (..., 3, 3)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True), dtype=np.float64)


def expectation(obstacles: Obstacles, units: int, params: ThresholdParams) -> FloatArray:
    """Contact that each of the units (K,) expects, from 0 to 1; 0 for one that shows no obstacle."""
    expected = np.zeros(units)
    if len(obstacles.unit):
        graded = obstacle_force(obstacles.body_distance, 1.0, params.d_max_m, params.d_min_m)
        own = obstacles.unit < units  # what other sources see is at no unit
        np.maximum.at(expected, obstacles.unit[own], graded[own])
    return expected


def in_levels(expected: FloatArray) -> tuple[int, ...]:
    """Round to the nearest of `LEVELS` steps."""
    return tuple(np.rint(expected * LEVELS).astype(int).tolist())


def shares(vertices: FloatArray, normals: FloatArray, origin: FloatArray, beam: FloatArray) -> FloatArray:
    """Shares w (V, K) that vertices have in the expectations of units.

    `vertices` (V, 3) [m] with outward unit `normals` (V, 3); `origin` (K, 3) [m] and unit `beam` (K, 3), same frame.
    """
    apart = np.linalg.norm(vertices[:, None] - origin[None], axis=2)
    near = np.maximum(1.0 - (apart / SPREAD_M) ** 2, 0.0) ** 2
    return near * (1.0 + normals @ beam.T) / 2.0


def on_surface(share: FloatArray, expected: FloatArray) -> FloatArray:
    """Contact that is expected at each vertex (V,), from shares (V, K) and the units' expectations (K,)."""
    return 1.0 - np.prod(1.0 - share * expected, axis=1)


def seen_from(model: RobotModel, skin: Skin, link: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """The units that move as one with a link: which (K',), their origins [m] and beams (K', 3) in its frame."""
    units = np.flatnonzero((model.moved_by[skin.link] == model.moved_by[link]).all(axis=1))
    kin = model.kinematics(model.q_mid)
    back = kin.rotation[link].T
    pose, turn = skin.T_link_sensor[units], kin.rotation[skin.link[units]]
    origin = kin.position[skin.link[units]] + np.einsum("kij,kj->ki", turn, pose[:, :3, 3])
    beam = np.einsum("kij,kj->ki", turn, pose[:, :3, 2])
    return units, (origin - kin.position[link]) @ back.T, beam @ back.T


def coloured(mesh: trimesh.Trimesh, colours: FloatArray) -> bytes:
    """Return a mesh with a colour at each vertex (V, 3), from 0 to 255 as a screen shows them, as binary glTF.

    It is the one format in which the page takes them.
    """
    painted = trimesh.visual.ColorVisuals(vertex_colors=palette.as_vertex(colours))
    shape = trimesh.Trimesh(
        mesh.vertices, mesh.faces, vertex_normals=mesh.vertex_normals, visual=painted, process=False
    )
    # without normals the page would draw each triangle flat
    data = trimesh.exchange.gltf.export_glb(trimesh.Scene(shape), include_normals=True, tree_postprocessor=_matt)
    return bytes(data)


def _matt(document: dict[str, Any]) -> None:
    """Give the one mesh of a glTF document a matt surface; without a material it would be of metal."""
    document["materials"] = [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.6}}]
    document["meshes"][0]["primitives"][0]["material"] = 0


class PaintedLink:
    """A link whose colours change, without flicker: what is sent is hidden until the page has had time to read it."""

    def __init__(self, scene: SceneApi, name: str, mesh: trimesh.Trimesh, share: FloatArray) -> None:
        self._mesh, self._share = mesh, share
        self._levels, self._sent, self._waits = (0,) * share.shape[1], -np.inf, False
        plain = self._painted()
        self._front = scene.add_glb(f"{name}/front", plain, **SHADELESS)
        self._back = scene.add_glb(f"{name}/back", plain, visible=False, **SHADELESS)

    def _painted(self) -> bytes:
        levels = np.array(self._levels, dtype=np.float64) / LEVELS
        return coloured(self._mesh, palette.between(palette.EXPECTED, on_surface(self._share, levels)))

    def paint(self, levels: tuple[int, ...], now: float) -> None:
        """Colour by what the units expect, in `LEVELS`, at a time [s]."""
        if now - self._sent < SETTLE_S:
            return
        if self._waits:
            self._front, self._back = self._back, self._front
            self._front.visible, self._back.visible, self._waits = True, False, False
        if levels != self._levels:
            self._levels, self._sent, self._waits = levels, now, True
            self._back.glb_data = self._painted()


class ArmBody:
    """The links of an arm, to be moved and coloured."""

    def __init__(
        self, scene: SceneApi, model: RobotModel, skin: Skin, surfaces: dict[int, trimesh.Trimesh], root: str = ""
    ) -> None:
        self._frames = {}
        self._painted: list[tuple[IntArray, PaintedLink]] = []
        for link, mesh in surfaces.items():
            name = f"{root}/arm/{model.links[link]}"
            self._frames[link] = scene.add_frame(name, show_axes=False)
            units, origin, beam = seen_from(model, skin, link)
            share = shares(mesh.vertices, mesh.vertex_normals, origin, beam)
            reached = share.any(axis=0)
            under = mesh.vertices - (_UNDER_M if reached.any() else 0.0) * mesh.vertex_normals
            scene.add_mesh_simple(f"{name}/plain", under, mesh.faces, color=palette.ARM, **SHADELESS)
            if reached.any():
                self._painted.append((units[reached], PaintedLink(scene, name, mesh, share[:, reached])))

    def place(self, kin: Kinematics) -> None:
        """Move the links to where they are."""
        turns = quaternions(kin.rotation)
        for link, frame in self._frames.items():
            frame.position, frame.wxyz = kin.position[link], turns[link]

    def paint(self, levels: tuple[int, ...], now: float) -> None:
        """Colour the links by what each unit (K,) expects, in `LEVELS`, at a time [s]."""
        for units, link in self._painted:
            link.paint(tuple(levels[u] for u in units), now)
