"""What a page shows in space: the room, the arm, what it senses, does and detects, and a person's hand."""

import math
from typing import TYPE_CHECKING

import numpy as np

from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.page import palette
from pretouch.page.arm import Arm, capsule_surfaces, quaternions
from pretouch.page.asked import Asked, asked_in
from pretouch.page.expectation import expectation, in_levels
from pretouch.page.frame import Frame, World
from pretouch.page.person import Drag, PersonHand
from pretouch.page.trail import Trail, binding
from pretouch.page.units import Units
from pretouch.page.vendor import vendor_surfaces
from pretouch.robot.kinematics import Kinematics
from pretouch.types import ControlStep, FloatArray

if TYPE_CHECKING:
    from viser import ArrowsHandle, SceneNodeHandle, ViserServer

CAMERA_FROM, CAMERA_AT = (1.75, 0.95, 0.85), (0.3, 0.0, 0.27)
"""Where the page looks from at first and at what [m]: from the arm's front right."""
CAMERA_FOV = math.radians(42.0)
"""Vertical angle of what is seen [rad]."""

ARROW_M_PER_N, ARROW_MOST_M, ARROW_LEAST_N = 0.012, 0.45, 6.0
"""Length of a force arrow [m/N] and at most [m], and the force below which none is drawn [N]: noise is less."""

ARROW_S, ARROW_LEAST_M_S = 1.0, 0.01
"""Length of an arrow of a velocity [m per m/s], and the speed below which none is drawn [m/s]."""

PARTS = ("cones", "points", "pairs", "path", "trail", "forces")
"""What can be shown and hidden."""


class Scene:
    """Draws worlds and frames; `now` is the time of the machine [s], which bounds how much is sent."""

    def __init__(self, server: "ViserServer", world: World, root: str = "", offset: float = 0.0) -> None:
        """Draw a world under the node `root`, moved along y by an offset [m]; one without a root has the room."""
        self._server, self._world, self._root = server, world, root
        scene = server.scene
        if root:
            self._whole = scene.add_frame(root, show_axes=False, position=(0.0, offset, 0.0))
        else:
            scene.configure_default_lights(cast_shadow=False)
            scene.set_background_image(_sky())
            server.initial_camera.position, server.initial_camera.look_at = CAMERA_FROM, CAMERA_AT
            server.initial_camera.fov = CAMERA_FOV
            _floor(server, world)
        found, self.said = vendor_surfaces(world.model)
        """One sentence on what the arm is drawn by, where it is not the vendor's surfaces."""
        self._arm = Arm(scene, world.model, world.skin, found or capsule_surfaces(world.model), root)
        self.units = Units(scene, world.skin, world.model.links, root)
        self.trail = Trail(scene, root)
        draw_pedestal(server, world.floor_height, root)
        self._boxes: list[SceneNodeHandle] = []
        self._show_boxes(world)

        self.path = scene.add_line_segments(
            f"{root}/path", _segments(world), palette.PATH, thickness=5.0, thickness_units="screen"
        )
        self.pairs = scene.add_line_segments(
            f"{root}/pairs", np.zeros((1, 2, 3)), np.zeros((1, 2, 3), dtype=np.uint8), thickness=3.0,
            thickness_units="screen", visible=False,
        )  # fmt: skip
        self._shows_pairs = self._shows_forces = True
        self._ee = scene.add_frame(f"{root}/ee", show_axes=False)
        self._force = self._arrow(f"{root}/ee/force", palette.FORCE)
        self._asked = self._arrow(f"{root}/ee/asked", palette.ASKED, 0.004)
        self._allowed = self._arrow(f"{root}/ee/allowed", palette.RECOVERING, 0.008)
        self._goal = scene.add_frame(
            f"{root}/goal", axes_length=0.1, axes_radius=0.004, origin_radius=0.012, origin_color=palette.ASKED,
            visible=False,
        )  # fmt: skip
        self._touched = scene.add_frame(f"{root}/touched", show_axes=False)
        self._true_force = self._arrow(f"{root}/touched/true_force", palette.TRUE_FORCE)
        self._place = self._arrow(f"{root}/place", palette.PLACE)
        self._hand = None if world.hand_radius is None else PersonHand(server, world.hand_radius, root)

    def _arrow(self, name: str, colour: palette.Colour, radius: float = 0.007) -> "ArrowsHandle":
        return self._server.scene.add_arrows(
            name, np.zeros((1, 2, 3)), colour, shaft_radius=radius, head_radius=2.5 * radius, head_length=0.04,
            visible=False,
        )  # fmt: skip

    def on_hand(self, act: Drag) -> None:
        """Have a function told of each drag of the hand."""
        if self._hand:
            self._hand.on_drag(act)

    def remove(self) -> None:
        """Take a world that has a root out of the page."""
        self._whole.remove()

    def show(self, name: str, visible: bool) -> None:
        """Show or hide one of `PARTS`."""
        match name:
            case "cones":
                self.units.show_cones(visible)
            case "points":
                self.units.points.visible = visible
            case "trail":
                self.trail.show(visible)
            case "path":
                self.path.visible = visible
            case "pairs":
                self._shows_pairs = visible
            case "forces":
                self._shows_forces = visible

    def show_world(self, world: World) -> None:
        """Draw what has changed in a world: its path and boxes."""
        before, self._world = self._world, world
        if world.path is not before.path:
            self.path.points = _segments(world).astype(np.float32)
        if world.boxes is not before.boxes:
            self._show_boxes(world)

    def _show_boxes(self, world: World) -> None:
        while self._boxes:
            self._boxes.pop().remove()
        for i, box in enumerate(world.boxes):
            self._boxes.append(
                self._server.scene.add_box(
                    f"{self._root}/box/{i}", color=palette.BOARD, dimensions=tuple((2 * box.half_size).tolist()),
                    opacity=0.85, position=box.center, cast_shadow=False, receive_shadow=False,
                )
            )  # fmt: skip

    def draw(self, frame: Frame, now: float) -> Asked | None:
        """Draw one instant, and return what a commander asked in it."""
        step, world = frame.step, self._world
        kin = world.model.kinematics(step.q)
        self._arm.place(kin)
        self._arm.paint(
            in_levels(expectation(step.obstacles, len(world.skin), thresholds_of(world.profile.detect))), now
        )
        late = frame.late(world.profile.sight.silent_after_s)
        self.units.draw(step, kin, late, world.profile.perception is not None)
        self.trail.draw(now)
        self._draw_pairs(step)
        self._draw_forces(frame, kin)
        if self._hand:
            self._hand.draw(frame.hand, frame.hand_target)
        asked = asked_in(frame, world, kin)
        self._draw_asked(asked)
        return asked

    def _draw_asked(self, asked: Asked | None) -> None:
        goal = None if asked is None else asked.goal
        self._goal.visible = goal is not None
        if goal is not None:
            self._goal.position, self._goal.wxyz = goal[:3, 3], quaternions(goal[:3, :3])
        for handle, velocity in (
            (self._asked, None if asked is None else asked.velocity),
            (self._allowed, None if asked is None else asked.allowed),
        ):
            handle.visible = velocity is not None and float(np.linalg.norm(velocity)) >= ARROW_LEAST_M_S
            if handle.visible and velocity is not None:
                handle.points = np.array([[np.zeros(3), ARROW_S * velocity]], dtype=np.float32)

    def _draw_pairs(self, step: ControlStep) -> None:
        near = step.obstacles
        self.pairs.visible = self._shows_pairs and len(near.unit) > 0
        if len(near.unit):
            colours = np.tile(palette.as_vertex(palette.PAIR), (len(near.unit), 2, 1))
            colours[step.restricted[binding(step)]] = palette.as_vertex(palette.LIMITING)
            self.pairs.points = np.stack([near.body_point, near.point], axis=1).astype(np.float32)
            self.pairs.colors = colours

    def _draw_forces(self, frame: Frame, kin: Kinematics) -> None:
        ee = kin.position[self._world.model.ee]
        self._ee.position = ee
        self._touched.position = ee if frame.true_point is None else frame.true_point
        for handle, force in ((self._force, frame.step.force), (self._true_force, frame.true_force)):
            size = 0.0 if force is None else float(np.linalg.norm(force))
            handle.visible = self._shows_forces and size >= ARROW_LEAST_N
            if handle.visible and force is not None:
                tip = force * (min(ARROW_M_PER_N * size, ARROW_MOST_M) / size)
                handle.points = np.array([[np.zeros(3), tip]], dtype=np.float32)
        touched = frame.step.touched
        self._place.visible = self._shows_forces and len(touched.link) > 0
        if self._place.visible:
            force, size = touched.force[0], float(np.linalg.norm(touched.force[0]))
            shaft = force * (min(ARROW_M_PER_N * size, ARROW_MOST_M) / max(size, 1e-9))
            # it ends at the place, for a contact pushes
            self._place.points = np.array([[touched.point[0] - shaft, touched.point[0]]], dtype=np.float32)


def _segments(world: World, dashes: int = 80) -> FloatArray:
    """The desired path as dashes (dashes, 2, 3) [m]."""
    points = np.array([world.path.point(s) for s in np.linspace(0.0, world.path.length, 2 * dashes)])
    return points.reshape(dashes, 2, 3)


def _floor(server: "ViserServer", world: World) -> None:
    server.scene.add_grid(
        "/floor", 4.0, 4.0, position=(0.0, 0.0, world.floor_height), cell_size=0.1, section_size=0.5,
        cell_color=(222, 226, 231), section_color=(196, 203, 212), plane_color=(246, 247, 249), plane_opacity=1.0,
        shadow_opacity=0.0, fade_distance=6.0,
    )  # fmt: skip


def draw_pedestal(server: "ViserServer", floor: float, root: str) -> None:
    """Draw pedestal and base frame of an arm over a floor at a height [m]."""
    scene, low = server.scene, floor
    if low < -0.01:
        scene.add_cylinder(
            f"{root}/pedestal", 0.1, -low, color=palette.PEDESTAL, position=(0.0, 0.0, low / 2), cast_shadow=False,
            receive_shadow=False,
        )  # fmt: skip
    scene.add_frame(f"{root}/base", axes_length=0.16, axes_radius=0.004, origin_radius=0.008)


def _sky(height: int = 128) -> FloatArray:
    """A light gradient (height, 2, 3) behind everything."""
    share = np.linspace(0.0, 1.0, height)[:, None, None]
    top, bottom = np.array([236, 240, 245]), np.array([252, 252, 253])
    return np.broadcast_to(top + share * (bottom - top), (height, 2, 3)).astype(np.uint8)
