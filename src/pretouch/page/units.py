"""Sensor units on the page: their places and cones, and the places that they saw occupied."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from viser import BatchedMeshHandle, SceneApi

from pretouch.explanation import SEEN_NOW_S, binding
from pretouch.page import palette
from pretouch.page.arm import SHADELESS, quaternions
from pretouch.page.frame import Frame
from pretouch.perception.obstacles import placed_sensors
from pretouch.robot.kinematics import Kinematics
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray, IntArray

_IDLE_M = 0.06
"""Length at which a cone is drawn that shows nothing [m]."""
_NEAR_M, _SHORTER = 0.3, 0.4
"""Length of a cone with a target that is near [m], and how much shorter it is with the target's distance."""
_FAINT, _CLEAR = 0.2, 0.7
_UNIT_M = (0.020, 0.014, 0.004)
_POINT_M = 0.012
"""Radius at which a place is drawn [m]: larger, the nearest hide the hand."""
_FADED_S = 12.0
"""Age from which a place has the palest colour [s]."""


class Units:
    """All units of a skin, each as a plate and a cone on its link, and what they have seen as points."""

    def __init__(self, scene: SceneApi, skin: Skin, links: Sequence[str], root: str = "") -> None:
        """Put the units under the nodes `ROOT/arm/LINK` of their links, named in order of their index."""
        self._scene, self._skin = scene, skin
        self._plates: list[tuple[IntArray, BatchedMeshHandle]] = []
        self._cones: list[tuple[IntArray, BatchedMeshHandle]] = []
        self._cones_shown = True
        plate = trimesh.creation.box(_UNIT_M)
        boards, poses = skin.first, np.array([unit.T_link_sensor for unit in skin.mounted])
        for link in np.unique(skin.link):
            node, here = f"{root}/arm/{links[link]}", np.flatnonzero(skin.link[boards] == link)
            plates = self._add(f"{node}/units", plate, poses[here], palette.UNIT, flat_shading=True)
            self._plates.append((here, plates))
            for kind in np.unique(skin.cones.kind[skin.link == link]):
                alike = np.flatnonzero((skin.link == link) & (skin.cones.kind == kind))
                # out to 1 m along z, without a lid
                profile = np.array([[0.0, 0.0], [skin.cones.edge[kind, 2], 1.0]])
                cones = self._add(
                    f"{node}/cones{kind or ''}",
                    trimesh.creation.revolve(profile, sections=28),
                    skin.T_link_sensor[alike],
                    palette.CONE,
                    batched_scales=np.full(len(alike), _IDLE_M),
                    batched_opacities=np.full(len(alike), _FAINT),
                    opacity=0.5,
                    side="double",
                )
                self._cones.append((alike, cones))
        self.points = scene.add_point_cloud(
            f"{root}/points", np.zeros((0, 3)), palette.SENSED, point_size=_POINT_M, point_shape="circle"
        )

    def _add(
        self, name: str, shape: trimesh.Trimesh, poses: FloatArray, colour: palette.Colour, **look: Any
    ) -> BatchedMeshHandle:
        """Add a shape at poses (N, 4, 4)."""
        colours = np.tile(palette.as_vertex(colour), (len(poses), 1))
        turns, places = quaternions(poses[:, :3, :3]), poses[:, :3, 3]
        return self._scene.add_batched_meshes_simple(
            name, shape.vertices, shape.faces, turns, places, batched_colors=colours, lod="off", **SHADELESS, **look
        )

    def show_cones(self, visible: bool) -> None:
        """Show or hide the fields of view."""
        self._cones_shown = visible

    def places(self, kin: Kinematics) -> FloatArray:
        """Return where the units are (N, 3) [m], base frame."""
        return placed_sensors(self._skin.arrays, kin)[0][self._skin.first]

    def draw(self, frame: Frame, kin: Kinematics, silent: BoolArray, perceiving: bool) -> None:
        """Show what the units see, and which of them (K,) are silent, and no cones unless it is `perceiving`."""
        reading, near = np.where(silent, np.nan, frame.step.range_distance), frame.step.obstacles
        if frame.places is None:
            points, age, unit = near.point, near.age, near.unit
        else:
            places, some = frame.places, slice(frame.places.number[0])
            points, age, unit = places.place[some], frame.step.stamp - places.stamp[some], places.unit[some]
        seeing = self._mask(unit[age <= SEEN_NOW_S]) & np.isfinite(reading)
        marks = [silent, self._mask(near.unit[frame.step.restricted[binding(frame.step)]]), seeing]
        cones = _coloured(marks, palette.CONE)
        # of zones, what any of them says
        plates = _coloured([np.logical_or.reduceat(mark, self._skin.first) for mark in marks], palette.UNIT)
        # a cone ends at what it shows, and from 0.2 m on before it, the shorter the farther; floor and arm show nothing
        far = np.maximum(_IDLE_M, _NEAR_M - _SHORTER * reading)
        lengths = np.where(seeing, np.round(np.minimum(reading, far), 2), _IDLE_M).astype(np.float32)
        opacities = np.where(seeing, _CLEAR, _FAINT).astype(np.float32)
        for boards, handle in self._plates:
            handle.batched_colors = plates[boards]
        for units, handle in self._cones:
            handle.batched_colors, handle.batched_scales = cones[units], lengths[units]
            handle.batched_opacities = opacities[units]
            handle.visible = self._cones_shown and perceiving
        self.points.points = points.astype(np.float16)
        self.points.colors = np.rint(palette.between(palette.REMEMBERED, age / _FADED_S)).astype(np.uint8)

    def _mask(self, units: IntArray) -> BoolArray:
        """Mask (K,) of those units among some; what other sources see is at no unit."""
        mask = np.zeros(len(self._skin), np.bool_)
        mask[units[(units >= 0) & (units < len(mask))]] = True
        return mask


def _coloured(marks: Sequence[BoolArray], plain: palette.Colour) -> NDArray[np.uint8]:
    """Colour of each that is silent, limits, sees something (3, N), or none of it."""
    colours = [palette.UNIT_SILENT, palette.LIMITING, palette.SEEING]
    return palette.as_vertex(np.select([mark[:, None] for mark in marks], colours, plain))
