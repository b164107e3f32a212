"""The arm of the page: its links, coloured where contact is expected, and the units on them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from pretouch.page import palette
from pretouch.page.expectation import LEVELS, on_surface, shares, surface_of
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, IntArray

if TYPE_CHECKING:
    from viser import GlbHandle, SceneApi

SETTLE_S = 0.2
"""Time a page is given to read a mesh before it is shown [s]; a link is sent at most once in it."""

_UNDER_M = 0.0015
"""How deep the plain surface lies under the coloured one [m]: a page too slow to read one in time shows the other."""


def quaternions(rotation: FloatArray) -> FloatArray:
    """Quaternions (..., 4) as (w, x, y, z) of rotations (..., 3, 3)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True), dtype=np.float64)


def capsule_surfaces(model: RobotModel) -> dict[int, trimesh.Trimesh]:
    """The surface of each link that has a body, by its index, link frame."""
    return {int(i): surface_of(model.capsules.of_links(np.array([i]))) for i in np.unique(model.capsules.link)}


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


@dataclass
class _Sent:
    levels: tuple[int, ...]
    time: float
    shown: bool


class PaintedLink:
    """A link whose colours change, without flicker: what is sent is hidden until the page has had time to read it."""

    def __init__(self, scene: "SceneApi", name: str, mesh: trimesh.Trimesh, share: FloatArray) -> None:
        self._mesh, self._share = mesh, share
        neutral = (0,) * share.shape[1]
        plain = self._painted(neutral)
        self._front: GlbHandle = scene.add_glb(f"{name}/front", plain, cast_shadow=False, receive_shadow=False)
        self._back: GlbHandle = scene.add_glb(
            f"{name}/back", plain, cast_shadow=False, receive_shadow=False, visible=False
        )
        self._sent = _Sent(neutral, -np.inf, shown=True)

    def _painted(self, levels: tuple[int, ...]) -> bytes:
        expected = np.array(levels, dtype=np.float64) / LEVELS
        return coloured(self._mesh, palette.expected(on_surface(self._share, expected)))

    def paint(self, levels: tuple[int, ...], now: float) -> int:
        """Colour by what the units expect, in `LEVELS`, at a time [s]; returns the bytes that were sent."""
        if now - self._sent.time < SETTLE_S:
            return 0
        if not self._sent.shown:
            self._front, self._back = self._back, self._front
            self._front.visible, self._back.visible = True, False
            self._sent.shown = True
        if levels == self._sent.levels:
            return 0
        data = self._painted(levels)
        self._back.glb_data = data
        self._sent = _Sent(levels, now, shown=False)
        return len(data)


class Arm:
    """The links of an arm and the units on them, to be moved and coloured."""

    def __init__(
        self, scene: "SceneApi", model: RobotModel, skin: Skin, surfaces: dict[int, trimesh.Trimesh], root: str = ""
    ) -> None:
        self._frames = {}
        self._painted: list[tuple[IntArray, PaintedLink]] = []
        for link, mesh in surfaces.items():
            name = f"{root}/arm/{model.links[link]}"
            self._frames[link] = scene.add_frame(name, show_axes=False)
            units, origin, beam = seen_from(model, skin, link)
            share = shares(mesh.vertices, mesh.vertex_normals, origin, beam)
            reached = share.any(axis=0)
            under = _UNDER_M if reached.any() else 0.0
            scene.add_mesh_simple(
                f"{name}/plain", mesh.vertices - under * mesh.vertex_normals, mesh.faces, color=palette.ARM,
                cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            if reached.any():
                self._painted.append((units[reached], PaintedLink(scene, name, mesh, share[:, reached])))

    def place(self, kin: Kinematics) -> None:
        """Move the links to where they are."""
        turns = quaternions(kin.rotation)
        for link, frame in self._frames.items():
            frame.position, frame.wxyz = kin.position[link], turns[link]

    def paint(self, levels: tuple[int, ...], now: float) -> int:
        """Colour the links by what each unit (K,) expects, in `LEVELS`, at a time [s]; returns the bytes sent."""
        return sum(link.paint(tuple(levels[u] for u in units), now) for units, link in self._painted)
