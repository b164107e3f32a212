"""A person's hand that goes where a mouse points, no quicker and no stronger than a person's."""

import numpy as np

from pretouch.errors import ParameterError
from pretouch.perception.closest import closest_points
from pretouch.robot.model import RobotModel
from pretouch.sim.hand import HandGoal
from pretouch.sim.plant import Plant
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.types import FloatArray

HAND_SPEED_M_S = 0.8
"""Largest speed at which the hand is drawn along [m/s]. At 75 kN/m a hand of 0.6 kg so meets one capsule of an arm that
comes at 0.3 m/s with (0.8 + 0.3) sqrt(75 000 * 0.6) = 233 N; ISO/TS 15066 gives 280 N for a moment."""
HAND_FORCE_N = 60.0
"""Largest force the person moves the hand with [N], as in the experiments; ISO/TS 15066 gives 140 N for longer."""
GAP_M = 0.05
"""Room between the hand and everything else where it begins [m]."""
_LOWEST, _HIGHEST = np.array([-1.0, -1.2, -1.0]), np.array([1.4, 1.2, 1.4])
"""Corners of the space the hand is led through [m], base frame: what a Panda reaches, and half a metre round it."""
_SHELL_M = 0.02
_DIRECTIONS = 200
_DEPTHS, _LOOKS = (0.4, 1.6), 121
"""Shares of the distance from the eye between which a line of sight is looked along, and at how many points."""
_NEAR_M, _OWN_M, _STAY = 0.04, 0.35, 0.2
"""How quickly a point of it counts less for the depth with its distance from the arm and from the place [m], and what
the place's own depth counts."""


class Mouse:
    """The script of a hand that follows a pointer."""

    def __init__(self, target: FloatArray, scene: SceneSpec, hand: HandSpec, size: float = 1.0) -> None:
        """Begin with the pointer at a place (3,) [m]. Round an arm of `size` times a Panda's there is as much space."""
        space = max(1.0, size)
        self.lowest, self.highest = space * _LOWEST, space * _HIGHEST
        """Corners (3,) of the space the hand is led through [m], base frame."""
        self.lowest[2] = max(self.lowest[2], scene.floor_height + hand.radius)
        self.target = target
        """(3,) where the hand is to be [m], base frame; to be set by `move`."""
        self.move(target)

    def move(self, target: FloatArray) -> None:
        """Point to a place (3,) [m], or the nearest to it in the workspace; what is no place is a ParameterError."""
        self.target = np.clip(_place("The hand's target", target), self.lowest, self.highest)

    def point(self, eye: FloatArray, place: FloatArray, model: RobotModel, q: FloatArray) -> None:
        """Point to what a person sees at a place (3,) [m] from an `eye` (3,) [m], as `move` does; see `at_depth`."""
        seen = _place("The hand's target", place)
        self.move(at_depth(model, q, _place("The camera's position", eye), seen))

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Go straight there, whatever is in the way."""
        return HandGoal(self.target, HAND_FORCE_N)


def _place(what: str, given: FloatArray) -> FloatArray:
    place = np.asarray(given, dtype=np.float64)
    if place.shape != (3,) or not np.all(np.isfinite(place)):
        raise ParameterError(f"{what} is {np.asarray(given).tolist()}: give x, y and z in metres.")
    return place


def at_depth(model: RobotModel, q: FloatArray, eye: FloatArray, place: FloatArray) -> FloatArray:
    """Place (3,) [m] on the line of sight through another, at the arm's depth where that line passes the arm.

    A pointer has no depth: without this a hand dragged onto the arm in the picture may pass half a metre before it.
    Each point of the line counts for the depth by how near it is to the arm and to the place, so that nothing jumps
    from one link to another behind it; far from the arm the place stays as it is.

    Args:
        model: the arm.
        q: (n,) its joint positions [rad].
        eye: (3,) where the person looks from [m], base frame.
        place: (3,) [m], base frame.
    """
    shares = np.linspace(*_DEPTHS, _LOOKS)
    points = eye + shares[:, None] * (place - eye)
    kin, none = model.kinematics(q), np.zeros(_LOOKS, np.int64)
    aside = np.tile([0.0, 0.0, 1.0], (_LOOKS, 1))
    gaps = closest_points(kin, model.capsules, kin.position[model.ee], none, points, aside).body_distance
    apart = np.linalg.norm(points - place, axis=1)
    weight = np.exp(-np.maximum(gaps, 0.0) / _NEAR_M - (apart / _OWN_M) ** 2)
    farther = float(weight @ (shares - 1.0)) / (_STAY + float(weight.sum()))
    return np.asarray(place + farther * (place - eye))


def clear_place(model: RobotModel, q: FloatArray, scene: SceneSpec, place: FloatArray, room: float) -> FloatArray:
    """Place (3,) [m] near a given one that is at least `room` [m] from the arm and all that stands around it.

    A place that is clear is returned as it is. Around one that is not, places are looked at 2 cm farther away, again
    and again.

    Args:
        model: the arm.
        q: (n,) its joint positions [rad].
        scene: what stands around it.
        place: (3,) to begin with [m], base frame.
        room: the hand's radius, and a gap [m].
    """
    around = _sphere(_DIRECTIONS)
    candidates, radius = place[None], 0.0
    while True:
        gaps = _gaps(model, q, scene, candidates)
        if gaps.max() >= room:
            return candidates[int(gaps.argmax())].copy()
        radius += _SHELL_M
        candidates = place + radius * around


def _gaps(model: RobotModel, q: FloatArray, scene: SceneSpec, places: FloatArray) -> FloatArray:
    """Distances (K,) [m] of places (K, 3) [m] from the nearest of arm, pedestal, floor and boxes."""
    count, kin = len(places), model.kinematics(q)
    aside = np.tile([0.0, 0.0, 1.0], (count, 1))
    arm = closest_points(kin, model.capsules, kin.position[model.ee], np.zeros(count, np.int64), places, aside)
    gaps = np.minimum(arm.body_distance, places[:, 2] - scene.floor_height)
    column = places - [0.0, 0.0, 1.0] * np.clip(places, scene.floor_height, -scene.pedestal_radius)
    gaps = np.minimum(gaps, np.linalg.norm(column, axis=1) - scene.pedestal_radius)
    for box in scene.boxes:
        gaps = np.minimum(gaps, _outside(box, places))
    return gaps


def _outside(box: Box, places: FloatArray) -> FloatArray:
    """Distances (K,) [m] of places (K, 3) [m] from a box, 0 inside."""
    beyond = np.abs(places - np.array(box.center)) - np.array(box.half_size)
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0.0), axis=1))


def _sphere(count: int) -> FloatArray:
    """Unit vectors (count, 3), about evenly spread: turns of the golden angle."""
    turns = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    height = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    across = np.sqrt(1.0 - height**2)
    return np.column_stack([across * np.cos(turns), across * np.sin(turns), height])
