"""Scene of a page: the room, the arm, its readings, motion and contacts, and a person's hand."""

import math
from typing import Any

import numpy as np
from viser import ArrowsHandle, SceneNodeHandle, ViserServer

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.explanation import binding
from pretouch.page import palette
from pretouch.page.arm import SHADELESS, ArmBody, expectation, in_levels, quaternions
from pretouch.page.frame import DrivenMotion, Frame, World, driven_motion
from pretouch.page.person import Drag, PersonHand
from pretouch.page.surfaces import capsule_surfaces, vendor_surfaces
from pretouch.page.trail import Trail
from pretouch.page.units import Units
from pretouch.types import ControlStep, FloatArray

CAMERA_FROM, CAMERA_AT = (1.75, 0.95, 0.85), (0.3, 0.0, 0.27)
"""Where the page looks from at first and at what [m]: from the arm's front right."""
CAMERA_FOV = math.radians(42.0)
"""Vertical angle of what is seen [rad]."""
ARROW_M_PER_N, ARROW_MOST_M, ARROW_LEAST_N = 0.012, 0.45, 6.0
"""Length of a force arrow [m/N] and at most [m], and the force below which none is drawn [N]: noise is less."""
ARROW_LEAST_M_S = 0.01
"""Speed below which no arrow of a velocity is drawn, which is 1 m long for each m/s [m/s]."""
PARTS = ("cones", "points", "pairs", "path", "trail", "forces")
"""Parts that can be shown and hidden."""


class Scene:
    """Draws worlds and frames; `now` is the time of the machine [s], which bounds how much is sent."""

    def __init__(
        self, server: ViserServer, world: World, root: str = "", offset: float = 0.0, on_drag: Drag | None = None
    ) -> None:
        """Draw a world under the node `root`, moved along y by an offset [m]; one without a root has the room.

        `on_drag` is called at each drag of the hand.
        """
        self._world, self._root = world, root
        self._scene = scene = server.scene
        if root:
            self._whole = scene.add_frame(root, show_axes=False, position=(0.0, offset, 0.0))
        else:
            _draw_room(server, world.floor_height, world.model.gravity)
        surfaces, self.notice = vendor_surfaces(world.model)
        """Sentence on the surfaces of the arm, where they are not the vendor's."""
        self._arm = ArmBody(scene, world.model, world.skin, surfaces or capsule_surfaces(world.model), root)
        self.units = Units(scene, world.skin, world.model.links, root)
        self.trail = Trail(scene, root)
        if world.floor_height < -0.01:
            middle = (0.0, 0.0, world.floor_height / 2)
            scene.add_cylinder(
                f"{root}/pedestal", 0.1, -world.floor_height, color=palette.PEDESTAL, position=middle, **SHADELESS
            )
        scene.add_frame(f"{root}/base", axes_length=0.16, axes_radius=0.004, origin_radius=0.008)
        self._boxes: list[SceneNodeHandle] = []
        self._show_boxes(world)
        self.path = scene.add_line_segments(
            f"{root}/path", _dashes(world), palette.PATH, thickness=5.0, thickness_units="screen"
        )
        none = np.zeros((1, 2, 3))
        self.pairs = scene.add_line_segments(
            f"{root}/pairs", none, none.astype(np.uint8), thickness=3.0, thickness_units="screen", visible=False
        )
        self._shows_pairs = self._shows_forces = True
        self._ee = scene.add_frame(f"{root}/ee", show_axes=False)
        self._force = self._arrow(f"{root}/ee/force", palette.FORCE)
        self._requested = self._arrow(f"{root}/ee/asked", palette.ASKED, 0.004)
        self._allowed = self._arrow(f"{root}/ee/allowed", palette.RECOVERING, 0.008)
        goal: dict[str, Any] = {"axes_length": 0.1, "axes_radius": 0.004, "origin_radius": 0.012}
        self._goal = scene.add_frame(f"{root}/goal", origin_color=palette.ASKED, **goal, visible=False)
        self._touched = scene.add_frame(f"{root}/touched", show_axes=False)
        self._true_force = self._arrow(f"{root}/touched/true_force", palette.TRUE_FORCE)
        self._place = self._arrow(f"{root}/place", palette.PLACE)
        self._hand = None
        if world.hand_radius is not None:
            self._hand = PersonHand(scene, world.hand_radius, world.floor_height, root, on_drag)

    def _arrow(self, name: str, colour: palette.Colour, radius: float = 0.007) -> ArrowsHandle:
        shape: dict[str, Any] = {"shaft_radius": radius, "head_radius": 2.5 * radius, "head_length": 0.04}
        return self._scene.add_arrows(name, np.zeros((1, 2, 3)), colour, **shape, visible=False)

    def invite(self, sentence: str) -> None:
        """Write a sentence at the person's hand, or nothing."""
        if self._hand:
            self._hand.invite(sentence)

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
            self.path.points = _dashes(world).astype(np.float32)
        if world.boxes is not before.boxes:
            self._show_boxes(world)

    def _show_boxes(self, world: World) -> None:
        while self._boxes:
            self._boxes.pop().remove()
        for i, box in enumerate(world.boxes):
            name, size = f"{self._root}/box/{i}", tuple((2 * box.half_size).tolist())
            node = self._scene.add_box(
                name, palette.BOARD, dimensions=size, opacity=0.85, position=box.center, **SHADELESS
            )
            self._boxes.append(node)

    def draw(self, frame: Frame, now: float) -> DrivenMotion | None:
        """Draw one instant, and return the motion that a commander requested in it."""
        step, world = frame.step, self._world
        kin = world.model.kinematics(step.q)
        expected = expectation(step.obstacles, len(world.skin), MovingThresholds.of_kind(world.profile.detect))
        self._arm.place(kin)
        self._arm.paint(in_levels(expected), now)
        silent = frame.late(world.profile.sight.silent_after_s)
        self.units.draw(frame, kin, silent, world.profile.perception is not None)
        self.trail.draw(now)
        self._draw_pairs(step)
        self._draw_forces(frame, kin.position[world.model.ee])
        if self._hand:
            self._hand.draw(frame.hand, frame.hand_target, self.units.places(kin))
        motion = driven_motion(frame, world, kin)
        self._draw_motion(motion)
        return motion

    def _draw_motion(self, motion: DrivenMotion | None) -> None:
        goal = None if motion is None else motion.goal
        self._goal.visible = goal is not None
        if goal is not None:
            self._goal.position, self._goal.wxyz = goal[:3, 3], quaternions(goal[:3, :3])
        velocity, allowed = (None, None) if motion is None else motion.velocities
        _point(self._requested, velocity, ARROW_LEAST_M_S)
        _point(self._allowed, allowed, ARROW_LEAST_M_S)

    def _draw_pairs(self, step: ControlStep) -> None:
        near = step.obstacles
        self.pairs.visible = self._shows_pairs and len(near.unit) > 0
        if len(near.unit):
            colours = np.tile(palette.as_vertex(palette.PAIR), (len(near.unit), 2, 1))
            colours[step.restricted[binding(step)]] = palette.as_vertex(palette.LIMITING)
            self.pairs.points = np.stack([near.body_point, near.point], axis=1).astype(np.float32)
            self.pairs.colors = colours

    def _draw_forces(self, frame: Frame, ee: FloatArray) -> None:
        self._ee.position = ee
        self._touched.position = ee if frame.true_point is None else frame.true_point
        least = ARROW_LEAST_N * ARROW_M_PER_N if self._shows_forces else math.inf
        _point(self._force, _shaft(frame.step.force), least)
        _point(self._true_force, None if frame.true_force is None else _shaft(frame.true_force), least)
        touched = frame.step.touched
        self._place.visible = self._shows_forces and len(touched.link) > 0
        if self._place.visible:  # it ends at the place, for a contact pushes
            begin = touched.point[0] - _shaft(touched.force[0])
            self._place.points = np.array([[begin, touched.point[0]]], dtype=np.float32)


def _shaft(force: FloatArray) -> FloatArray:
    """The arrow of a force (3,) [N] as a vector (3,) [m]."""
    size = float(np.linalg.norm(force))
    return force * (min(ARROW_M_PER_N * size, ARROW_MOST_M) / max(size, 1e-9))


def _point(arrow: ArrowsHandle, vector: FloatArray | None, least: float) -> None:
    """Have an arrow show a vector (3,) from where it begins, or nothing of one that is shorter than `least`."""
    arrow.visible = vector is not None and float(np.linalg.norm(vector)) >= least
    if arrow.visible:
        arrow.points = np.array([[np.zeros(3), vector]], dtype=np.float32)


def _dashes(world: World, count: int = 80) -> FloatArray:
    """The desired path as dashes (count, 2, 3) [m]."""
    points = np.array([world.path.point(s) for s in np.linspace(0.0, world.path.length, 2 * count)])
    return points.reshape(count, 2, 3)


def _draw_room(server: ViserServer, floor_height: float, gravity: FloatArray) -> None:
    """Draw floor and sky, down where gravity (3,) points, and set the visitors' camera."""
    server.initial_camera.position, server.initial_camera.look_at = CAMERA_FROM, CAMERA_AT
    server.initial_camera.fov = CAMERA_FOV
    scene = server.scene
    scene.set_up_direction(-gravity)
    scene.configure_default_lights(cast_shadow=False)
    share = np.linspace(0.0, 1.0, 128)[:, None, None]
    top, bottom = np.array([236, 240, 245]), np.array([252, 252, 253])
    scene.set_background_image(np.broadcast_to(top + share * (bottom - top), (128, 2, 3)).astype(np.uint8))
    scene.add_grid(
        "/floor",
        width=4.0,
        height=4.0,
        position=(0.0, 0.0, floor_height),
        cell_size=0.1,
        section_size=0.5,
        cell_color=(222, 226, 231),
        section_color=(196, 203, 212),
        plane_color=(246, 247, 249),
        plane_opacity=1.0,
        shadow_opacity=0.0,
        fade_distance=6.0,
    )
