"""A person's hand on a page: a fist that is seen, grabbed and dragged.

The simulated hand is a ball. The fist is drawn into that ball, so that what is seen is what touches and what the units
see. The cuff is drawn only: it is short, and always on the side away from the arm.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh
from viser import LabelHandle, SceneApi

from pretouch.page import palette
from pretouch.page.arm import SHADELESS
from pretouch.page.surfaces import surface_of
from pretouch.robot.body import Capsules
from pretouch.types import FloatArray

Drag = Callable[[FloatArray, FloatArray], None]
"""Receives from where a person looks, and to what place in view the hand is dragged, both (3,) [m]."""

BALL_M = 0.05
"""Radius of the ball that the fist is made for [m]."""
GRIP = 1.7
"""Radius within which the hand is grabbed, as a multiple of the ball's: a finger on a screen is not exact."""

_FINGERS = ((-0.0255, 0.0115), (-0.0088, 0.0125), (0.0088, 0.0125), (0.0255, 0.0115))
"""Place across the fist, and radius of each finger [m]."""
_AROUND = 14
"""Vertices round a finger."""
_SIDE_M = 0.08
"""Distance from the plane y = 0 from which on the forearm lies along y [m]."""
_APART_M = 0.015
"""Distance between hand and target from which the target is shown [m]."""


def fist(radius: float) -> trimesh.Trimesh:
    """A closed hand in a ball of a radius [m] round the origin: knuckles to +x, its back to +z, the thumb at +y."""
    segments = [
        ((-0.012, -0.010, 0.003), (-0.012, 0.010, 0.003), 0.034),  # palm
        ((-0.022, 0.031, -0.004), (0.008, 0.033, -0.020), 0.0115),  # thumb
        ((0.008, 0.033, -0.020), (0.025, 0.014, -0.028), 0.0105),
    ]
    for y, radius_of_it in _FINGERS:
        bent = 1.0 - (y / 0.06) ** 2
        knuckle, joint, tip = (0.020 * bent, y, 0.025), (0.034 * bent, y, -0.004), (0.014, y, -0.028)
        segments += [(knuckle, joint, radius_of_it), (joint, tip, radius_of_it)]
        segments.append(((-0.024, 0.7 * y, 0.022), knuckle, radius_of_it))
    return surface_of(_capsules(segments), _AROUND).apply_scale(radius / BALL_M)


def cuff(radius: float) -> trimesh.Trimesh:
    """The end of a sleeve behind the fist of a radius [m], along -x."""
    return surface_of(_capsules([((-0.062, 0.0, 0.0), (-0.105, 0.0, 0.0), 0.030)])).apply_scale(radius / BALL_M)


def _capsules(segments: list[tuple[tuple[float, float, float], tuple[float, float, float], float]]) -> Capsules:
    a, b, radii = zip(*segments, strict=True)
    return Capsules(np.zeros(len(radii), np.int64), np.array(a), np.array(b), np.array(radii))


class PersonHand:
    """A fist where the simulated hand is, and a faint one where it is to be while that is elsewhere."""

    def __init__(
        self, scene: SceneApi, radius: float, floor: float, root: str = "", on_drag: Drag | None = None
    ) -> None:
        """Add it under a node, with a shadow on the floor at a height [m].

        `on_drag` is called from the page's own thread. A drag of it never moves the camera.
        """
        self._scene, self._root, self._floor = scene, root, floor
        look: dict[str, Any] = {"color": palette.FOLLOWING, "opacity": 0.3, "visible": False}
        self._shadow = scene.add_cylinder(f"{root}/shadow", radius, 0.002, **look, **SHADELESS)
        self._gap = scene.add_line_segments(
            f"{root}/gap",
            np.zeros((1, 2, 3)),
            palette.FOLLOWING,
            thickness=1.5,
            thickness_units="screen",
            visible=False,
        )
        self._invitation: LabelHandle | None = None
        self._hand = scene.add_frame(f"{root}/hand", show_axes=False)
        self._target = scene.add_frame(f"{root}/hand_target", show_axes=False, visible=False)
        for part, mesh, colour in (("fist", fist(radius), palette.HAND), ("cuff", cuff(radius), palette.CUFF)):
            for name, opacity in ((f"{root}/hand/{part}", None), (f"{root}/hand_target/{part}", 0.3)):
                scene.add_mesh_simple(name, mesh.vertices, mesh.faces, color=colour, opacity=opacity, **SHADELESS)
        # barely there, and as lines, so that it hides nothing behind it
        look = {"color": palette.HAND, "opacity": 0.01, "wireframe": True, "subdivisions": 2}
        grip = scene.add_icosphere(f"{root}/hand/grip", GRIP * radius, **look, **SHADELESS)
        self._position = self._offset = np.zeros(3)
        if on_drag:

            @grip.on_drag
            async def _(event: Any) -> None:
                if event.phase == "start":
                    self._offset = self._position - np.array(event.start_position)
                on_drag(np.array(event.client.camera.position), np.array(event.end_position) + self._offset)

    def invite(self, sentence: str) -> None:
        """Write a sentence beside the hand, or nothing."""
        if self._invitation:
            self._invitation.remove()
        name = f"{self._root}/hand/invitation"
        self._invitation = self._scene.add_label(name, sentence, position=(0.0, 0.0, -0.1)) if sentence else None

    def draw(self, hand: FloatArray | None, target: FloatArray | None, units: FloatArray) -> None:
        """Show hand and target (3,) [m]; None and what is not finite are not shown.

        The hand's shadow, and a line to the nearest of the units (N, 3) [m], show how far away it is.
        """
        hand = hand if hand is not None and np.isfinite(hand).all() else None
        self._shadow.visible, self._gap.visible = hand is not None, hand is not None and len(units) > 0
        if hand is not None:
            self._shadow.position = np.array([hand[0], hand[1], self._floor])
        if hand is not None and len(units):
            nearest = units[np.linalg.norm(units - hand, axis=1).argmin()]
            self._gap.points = np.array([[hand, nearest]], dtype=np.float32)
        near = hand is None or target is None or np.linalg.norm(target - hand) <= _APART_M
        for node, place in ((self._hand, hand), (self._target, None if near else target)):
            node.visible = place is not None
            if place is not None:
                node.position, node.wxyz = place, _turn(place)
        self._position = self._position if hand is None else hand


def _turn(place: FloatArray) -> FloatArray:
    """Quaternion (w, x, y, z) that has the fist point towards the arm: along y from the side, along -x in front."""
    yaw = math.pi + math.pi / 2 * float(np.clip(place[1] / _SIDE_M, -1.0, 1.0))
    return np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)])
