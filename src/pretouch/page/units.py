"""The sensor units of the page: where they sit, what their cones cover, and what they see."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from pretouch.page import palette
from pretouch.page.arm import quaternions
from pretouch.page.trail import binding
from pretouch.perception.obstacles import locate, placed_sensors, points_of_units
from pretouch.robot.kinematics import Kinematics
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, ControlStep, FloatArray, IntArray

if TYPE_CHECKING:
    from viser import BatchedMeshHandle, SceneApi

_IDLE_M = 0.06
"""Length at which a cone is drawn that shows nothing [m]."""
_FAINT, _CLEAR = 0.2, 0.7
_UNIT_M = (0.020, 0.014, 0.004)
_POINT_M = 0.014
_GONE = 1e-6
"""Scale of what is not to be seen: the number of instances stays, so that the page keeps its buffers."""


class Units:
    """All units of a skin, each as a plate and a cone on its link, and a sphere where it senses something."""

    def __init__(self, scene: "SceneApi", skin: Skin, links: Sequence[str], root: str = "") -> None:
        """Put the units under the nodes `ROOT/arm/LINK` of their links, named in order of their index."""
        self._skin, count = skin, len(skin)
        self._plates: list[tuple[IntArray, BatchedMeshHandle]] = []
        self._cones: list[tuple[IntArray, BatchedMeshHandle]] = []
        plate, ball = _parts(trimesh.creation.box(_UNIT_M)), _parts(trimesh.creation.icosphere(subdivisions=2))
        plain: dict[str, Any] = {"cast_shadow": False, "receive_shadow": False, "lod": "off"}
        for link in np.unique(skin.link):
            units, boards = np.flatnonzero(skin.link == link), np.flatnonzero(skin.link[skin.first] == link)
            place = _places(skin.T_link_sensor[units])
            node = f"{root}/arm/{links[link]}"
            plates = scene.add_batched_meshes_simple(
                f"{node}/units", *plate, *_places(np.array([skin.mounted[b].T_link_sensor for b in boards])),
                batched_colors=_all(palette.UNIT, boards), flat_shading=True, **plain,
            )  # fmt: skip
            self._plates.append((boards, plates))
            for kind in np.unique(skin.cones.kind[units]):
                alike = skin.cones.kind[units] == kind
                cones = scene.add_batched_meshes_simple(
                    f"{node}/cones{kind or ''}", *_cone(skin.cones.edge[kind, 2]), *(part[alike] for part in place),
                    batched_scales=np.full(alike.sum(), _IDLE_M), batched_colors=_all(palette.CONE, units[alike]),
                    batched_opacities=np.full(alike.sum(), _FAINT), opacity=0.5, side="double", **plain,
                )  # fmt: skip
                self._cones.append((units[alike], cones))
        self.points = scene.add_batched_meshes_simple(
            f"{root}/points", *ball, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), np.zeros((count, 3)),
            batched_scales=np.full(count, _GONE), batched_colors=_all(palette.SENSED, np.arange(count)), **plain,
        )  # fmt: skip

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
        points = self._sensed(step, kin, reading, perceiving)
        seen = np.isfinite(points[:, 0])
        # a unit that sees the floor, or the arm itself, senses nothing
        lengths = np.where(seen, np.round(reading, 2), _IDLE_M).astype(np.float32)
        opacities = np.where(seen, _CLEAR, _FAINT).astype(np.float32)
        for units, handle in self._plates:
            handle.batched_colors = plates[units]
        for units, handle in self._cones:
            handle.batched_colors, handle.batched_scales = cones[units], lengths[units]
            handle.batched_opacities = opacities[units]
        self.points.batched_positions = np.nan_to_num(points).astype(np.float32)
        self.points.batched_scales = np.where(seen, _POINT_M, _GONE).astype(np.float32)

    def _glowing(self, step: ControlStep) -> tuple[BoolArray, BoolArray]:
        """Which units (K,) see an obstacle, and whose obstacles keep the arm from what it would do."""
        seeing, limiting = np.zeros((2, len(self._skin)), np.bool_)
        unit = step.obstacles.unit
        own = unit < len(self._skin)  # what other sources see is at no unit
        seeing[unit[own]] = True
        held = unit[step.restricted[binding(step)]]
        limiting[held[held < len(self._skin)]] = True
        return seeing, limiting

    def _sensed(self, step: ControlStep, kin: Kinematics, reading: FloatArray, perceiving: bool) -> FloatArray:
        """Where each unit senses something (K, 3) [m], base frame; NaN where it does not."""
        if not perceiving:
            return locate(*placed_sensors(self._skin.arrays, kin)[:2], reading)
        return points_of_units(step.obstacles, len(reading))


def _coloured(marks: Sequence[BoolArray], plain: palette.Colour) -> NDArray[np.uint8]:
    """Colour of each that is silent, limits, sees something (3, N), or none of it."""
    colours = [palette.UNIT_SILENT, palette.LIMITING, palette.SEEING]
    return palette.as_vertex(np.select([mark[:, None] for mark in marks], colours, plain))


def _places(pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orientations and places of poses (N, 4, 4)."""
    return quaternions(pose[:, :3, :3]), pose[:, :3, 3]


def _all(colour: palette.Colour, units: IntArray) -> NDArray[np.uint8]:
    return np.tile(palette.as_vertex(colour), (len(units), 1))


def _cone(radius: float) -> tuple[FloatArray, IntArray]:
    """A field of view out to 1 m along z, of a radius [m] there, without a lid."""
    return _parts(trimesh.creation.revolve(np.array([[0.0, 0.0], [radius, 1.0]]), sections=28))


def _parts(shape: trimesh.Trimesh) -> tuple[FloatArray, IntArray]:
    return np.asarray(shape.vertices), np.asarray(shape.faces)
