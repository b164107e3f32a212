"""The simulated room of a live session: arm, sensor units, object, and a person's hand that follows a mouse."""

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, cast

import numpy as np

from pretouch.checks import Check, Checked
from pretouch.control.path import Path, WayPoints
from pretouch.errors import ParameterError
from pretouch.page.real_units import RealUnits
from pretouch.perception.closest import closest_points
from pretouch.ports import SkinPort as UnitPort
from pretouch.profiles import PROFILES, Profile
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import Skin
from pretouch.sim.hand import Hand, HandGoal, PersonArm
from pretouch.sim.paper_scenes import FACE_M, Placement, board_beside, placement_for
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.sim.touch_sensor import SimulatedTouchSkin, TouchErrors, TouchSensors
from pretouch.types import FloatArray

PathName = Literal["circle", "line"]
"""The paper's two paths; the line is run there and back."""

ObjectName = Literal["none", "board -y", "board +y"]
"""Object in the arm's way: none, or the static experiment's board on one side."""

_SETTLE_S = 0.2
"""Time the arm stands before the controller starts [s]: the observer's transient is over."""
HAND_SPEED_M_S = 0.8
"""Largest speed at which the hand is drawn along [m/s]. At 75 kN/m a hand of 0.6 kg so meets one capsule of an arm that
comes at 0.3 m/s with (0.8 + 0.3) sqrt(75 000 * 0.6) = 233 N; ISO/TS 15066 gives 280 N for a moment."""
HAND_FORCE_N = 60.0
"""Largest force the person moves the hand with [N], as in the experiments; ISO/TS 15066 gives 140 N for longer."""
_LOWEST, _HIGHEST = np.array([-1.0, -1.2, -1.0]), np.array([1.4, 1.2, 1.4])
"""Corners of the space the hand is led through [m], base frame: what a Panda reaches, and half a metre round it."""
_DEPTHS, _LOOKS = (0.4, 1.6), 121
"""Shares of the distance from the eye between which a line of sight is looked along, and at how many points."""
_NEAR_M, _OWN_M, _STAY = 0.04, 0.35, 0.2
"""How quickly a point of it counts less for the depth with its distance from the arm and from the place [m], and what
the place's own depth counts."""


@dataclass(frozen=True)
class LiveSettings(Checked):
    """Settings that a live session starts with, also after a reset."""

    profile: Profile = field(default_factory=lambda: PROFILES["paper"])
    """Parameters of the controller, restrictions and speed included."""
    path: PathName = "circle"
    """Path of the end-effector."""
    object: ObjectName = "none"
    """Object in the way of the arm."""
    silenced: frozenset[str] = frozenset()
    """Ids of the simulated units that do not send."""
    seed: Annotated[int, Check(low=0)] = 0
    """Decides the arm's errors and all noise."""
    plant: PlantParams = field(default_factory=PlantParams)
    """The kind of simulated arm."""
    ranging: RangeFinderParams = field(default_factory=RangeFinderParams)
    """Errors of simulated units."""
    hand_start: tuple[float, float, float] = (1.0, 0.5, 0.3)
    """Start of the person's hand [m], base frame: in view, and clear of both paths."""
    placement: Placement = field(default_factory=Placement)
    """Placement of the paper's paths for the arm."""


def settings_for(model: RobotModel, settings: LiveSettings) -> LiveSettings:
    """Return settings with the paths, the place where the hand begins, and the kind of arm for an arm.

    Raises ExperimentError where the arm cannot follow the paths anywhere.
    """
    placement = placement_for(model)
    hand, plant = placement.point(*settings.hand_start), plant_params_of(model.description)
    return replace(settings, placement=placement, hand_start=hand, plant=plant)


def live_path(settings: LiveSettings) -> Path:
    """Return the path by its name, begun on the side away from the object."""
    path = settings.placement.path(settings.path, 1.0 if settings.object == "board +y" else -1.0)
    return WayPoints(path.points, closed=True) if isinstance(path, WayPoints) else path


class Mouse:
    """The script of a hand that follows a pointer."""

    def __init__(self, target: FloatArray, scene: SceneSpec, hand: HandSpec, size: float = 1.0) -> None:
        """Begin with the pointer at a place (3,) [m]. The workspace scales with the arm's `size`, 1 for a Panda."""
        space = max(1.0, size)
        self.lowest, self.highest = space * _LOWEST, space * _HIGHEST
        """Corners (3,) of the space the hand is led through [m], base frame."""
        self.lowest[2] = max(self.lowest[2], scene.floor_height + hand.radius)
        self.target = target
        """(3,) where the hand is to be [m], base frame; to be set by `move`."""
        self.move(target)

    def move(self, target: FloatArray) -> None:
        """Point to a place (3,) [m], or the nearest to it in the workspace; an invalid place is a ParameterError."""
        self.target = np.clip(_place("The hand's target", target), self.lowest, self.highest)

    def point(self, eye: FloatArray, place: FloatArray, model: RobotModel, q: FloatArray) -> None:
        """Point to what a person sees at a place (3,) [m] from an `eye` (3,) [m], as `move` does; see `at_depth`."""
        pointed = _place("The hand's target", place)
        self.move(at_depth(model, q, _place("The camera's position", eye), pointed))

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Go straight there, whatever is in the way."""
        return HandGoal(self.target, HAND_FORCE_N)


def _place(what: str, numbers: FloatArray) -> FloatArray:
    place = np.asarray(numbers, dtype=np.float64)
    if place.shape != (3,) or not np.all(np.isfinite(place)):
        raise ParameterError(f"{what} is {place.tolist()}: give x, y and z in metres.")
    return place


def at_depth(model: RobotModel, q: FloatArray, eye: FloatArray, place: FloatArray) -> FloatArray:
    """Place (3,) [m] on the line of sight through another, at the arm's depth where that line passes the arm.

    A pointer has no depth: without this a hand dragged onto the arm in the picture may pass half a metre before it.
    Each point of the line counts for the depth by how near it is to the arm and to the place, so that nothing jumps
    from one link to another behind it; far from the arm the place stays as it is. `q` (n,) [rad]; `eye` (3,) [m] is the
    person's point of view, base frame.
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


class Room:
    """Simulated room, at rest at the start of the path."""

    def __init__(
        self, settings: LiveSettings, path: Path, model: RobotModel, skin: Skin, real: RealUnits | None = None
    ) -> None:
        """Build the room; a control period that is no whole number of physics steps is a ParameterError.

        With `real` units the arm carries those in place of simulated ones.
        """
        q, hand = brought_to(model, path.point(0.0)), HandSpec()
        boxes: tuple[Box, ...] = ()
        if settings.object != "none":
            side = settings.object.removeprefix("board ")
            face, met_by = settings.placement.face(FACE_M, side), settings.placement.hand(side)
            boxes = (board_beside(path, side, hand.stiffness, face, hand=met_by),)
        scene = SceneSpec(boxes=boxes, hand=hand)
        self.mouse = Mouse(np.array(settings.hand_start), scene, hand, settings.placement.scale)
        self.scene = replace(scene, hand=replace(hand, start=tuple(self.mouse.target.tolist())))
        self.plant = Plant(model, self.scene, settings.plant, q, settings.seed)
        self._simulated = None if real else RangeFinders(self.plant, skin, settings.ranging, settings.seed)
        self.units: UnitPort = self._simulated or cast(RealUnits, real)
        if self._simulated and len(skin.touching):
            touch = TouchSensors(self.plant, skin, TouchErrors(), settings.seed)
            touch.silenced = self._simulated.silenced
            self.units = SimulatedTouchSkin(self._simulated.read, touch.touch)
        self.hand = Hand(self.plant, self.mouse, PersonArm(speed_max=HAND_SPEED_M_S))
        self.clock = PlantClock(self.plant, settings.profile.task.control_period_s)
        self._skin = skin
        self.silence(settings.silenced)
        self.plant.advance(_SETTLE_S)
        if real:
            real.begin(lambda: self.plant.time)

    def silence(self, units: frozenset[str]) -> None:
        """Let units, by their ids, send nothing, and all others send; an unknown id, or a real unit's, is an error."""
        if self._simulated is None:
            if units:
                raise ParameterError("These units are real: unplug or cover one to see what the arm does.")
            return
        unknown = sorted(units - set(self._skin.boards))
        if unknown:
            choices = ", ".join(unit.id for unit in self._skin.mounted)
            raise ParameterError(f"Unknown unit {', '.join(unknown)}: choose from {choices}.")
        self._simulated.silenced.clear()
        self._simulated.silenced.update(i for i, name in enumerate(self._skin.boards) if name in units)

    @property
    def touched(self) -> FloatArray | None:
        """Middle (3,) of the points at which something touches the arm [m], base frame; None while nothing does."""
        points = [force.point for force in self.plant.contact_forces()]
        return np.mean(points, axis=0) if points else None

    def tick(self) -> float:
        """Let one control period pass and return the time [s]."""
        return self.clock.tick()
