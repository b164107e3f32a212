"""Sensor units on the page: their places, cones and sensed points."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from viser import BatchedMeshHandle, SceneApi

from pretouch.explanation import binding
from pretouch.page import palette
from pretouch.page.arm import SHADELESS, quaternions
from pretouch.perception.obstacles import locate, placed_sensors, points_of_units
from pretouch.robot.kinematics import Kinematics
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, ControlStep, FloatArray, IntArray

_IDLE_M = 0.06
"""Length at which a cone is drawn that shows nothing [m]."""
_FAINT, _CLEAR = 0.2, 0.7
_UNIT_M = (0.020, 0.014, 0.004)
_POINT_M = 0.014
_GONE = 1e-6
"""Scale of what is not to be seen: the number of instances stays, so that the page keeps its buffers."""


class Units:
    """All units of a skin, each as a plate and a cone on its link, and a sphere where it senses something."""

    def __init__(self, scene: SceneApi, skin: Skin, links: Sequence[str], root: str = "") -> None:
        """Put the units under the nodes `ROOT/arm/LINK` of their links, named in order of their index."""
        self._scene, self._skin = scene, skin
        self._plates: list[tuple[IntArray, BatchedMeshHandle]] = []
        self._cones: list[tuple[IntArray, BatchedMeshHandle]] = []
        plate, ball = trimesh.creation.box(_UNIT_M), trimesh.creation.icosphere(subdivisions=2)
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
        nowhere = np.tile(np.eye(4), (len(skin), 1, 1))
        hidden = np.full(len(skin), _GONE)
        self.points = self._add(f"{root}/points", ball, nowhere, palette.SENSED, batched_scales=hidden)

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
        for _, cones in self._cones:
            cones.visible = visible

    def draw(self, step: ControlStep, kin: Kinematics, silent: BoolArray, perceiving: bool) -> None:
        """Show what the units see, and which of them (K,) are silent.

        A controller that is not `perceiving` has no obstacles: then every reading is a sensed point.
        """
        marks = [silent, *reversed(self._glowing(step))]
        cones = _coloured(marks, palette.CONE)
        # of zones, what any of them says
        plates = _coloured([np.logical_or.reduceat(mark, self._skin.first) for mark in marks], palette.UNIT)
        reading = np.where(silent, np.nan, step.range_distance)
        if perceiving:
            points = points_of_units(step.obstacles, len(reading))
        else:
            points = locate(*placed_sensors(self._skin.arrays, kin)[:2], reading)
        sensing = np.isfinite(points[:, 0])
        # a unit that sees the floor, or the arm itself, senses nothing
        lengths = np.where(sensing, np.round(reading, 2), _IDLE_M).astype(np.float32)
        opacities = np.where(sensing, _CLEAR, _FAINT).astype(np.float32)
        for boards, handle in self._plates:
            handle.batched_colors = plates[boards]
        for units, handle in self._cones:
            handle.batched_colors, handle.batched_scales = cones[units], lengths[units]
            handle.batched_opacities = opacities[units]
        self.points.batched_positions = np.nan_to_num(points).astype(np.float32)
        self.points.batched_scales = np.where(sensing, _POINT_M, _GONE).astype(np.float32)

    def _glowing(self, step: ControlStep) -> tuple[BoolArray, BoolArray]:
        """Masks of the units (K,) that see an obstacle, and of those whose obstacles restrict the arm."""
        unit, count = step.obstacles.unit, len(self._skin)  # what other sources see is at no unit
        seeing, limiting = np.zeros((2, count), np.bool_)
        seeing[unit[unit < count]] = True
        limits = unit[step.restricted[binding(step)]]
        limiting[limits[limits < count]] = True
        return seeing, limiting


def _coloured(marks: Sequence[BoolArray], plain: palette.Colour) -> NDArray[np.uint8]:
    """Colour of each that is silent, limits, sees something (3, N), or none of it."""
    colours = [palette.UNIT_SILENT, palette.LIMITING, palette.SEEING]
    return palette.as_vertex(np.select([mark[:, None] for mark in marks], colours, plain))
