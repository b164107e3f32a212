"""The simulated room of a live session: arm, sensor units, object and a person's hand."""

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, cast

import numpy as np

from pretouch.checks import Check, Checked
from pretouch.control.path import Path, WayPoints
from pretouch.errors import ParameterError
from pretouch.page.mouse import GAP_M, HAND_SPEED_M_S, Mouse, clear_place
from pretouch.page.real_units import RealUnits
from pretouch.ports import Skin as UnitPort
from pretouch.profiles import PROFILES, Profile
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import Skin
from pretouch.sim.hand import Hand, PersonArm
from pretouch.sim.paper_scenes import FACE_M, Placement, Side, board_beside
from pretouch.sim.placement import placement_for
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.sim.touch_sensor import SimulatedTouchSkin, TouchErrors, TouchSensors
from pretouch.types import FloatArray

PathName = Literal["circle", "line"]
"""The paper's two paths; the line is run there and back."""

ObjectName = Literal["none", "board -y", "board +y"]
"""What stands in the arm's way: nothing, or the static experiment's board on one side."""

Stiffness = Annotated[float, Check(low=3_000.0, high=150_000.0)]
"""Of a contact with the arm [N/m]. On a softer one a hand that pushes hard sinks through a thin link; a stiffer one of
a hand of 0.6 kg swings too quickly for physics in steps of 1 ms."""


@dataclass(frozen=True)
class Faults(Checked):
    """What is wrong with the sensor units."""

    silenced: frozenset[str] = frozenset()
    """Ids of the units that no longer send."""
    noise_factor: Annotated[float, Check(low=0.0, high=20.0)] = 1.0
    """Factor on the standard deviation of the readings."""
    latency_s: Annotated[float, Check(low=0.0, high=1.0)] = 0.0
    """Time by which readings arrive later than they do anyway [s]."""


@dataclass(frozen=True)
class LiveSettings(Checked):
    """What a live session begins with, and begins again with at a reset."""

    profile: Profile = field(default_factory=lambda: PROFILES["paper"])
    """Parameters of the controller, restrictions and speed included."""
    path: PathName = "circle"
    """Path of the end-effector."""
    object: ObjectName = "none"
    """What stands in its way."""
    stiffness: Stiffness = HandSpec.stiffness
    """Stiffness of what the arm can touch, the person's hand and the object [N/m]."""
    faults: Faults = field(default_factory=Faults)
    """What is wrong with the sensor units."""
    seed: Annotated[int, Check(low=0)] = 0
    """Decides the arm's errors and all noise."""
    plant: PlantParams = field(default_factory=PlantParams)
    """The kind of simulated arm."""
    ranging: RangeFinderParams = field(default_factory=RangeFinderParams)
    """How simulated units err without faults."""
    hand_start: tuple[float, float, float] = (1.0, 0.5, 0.3)
    """Where the person's hand begins [m], base frame: in view, and clear of both paths; moved aside if that is inside
    something."""
    placement: Placement = field(default_factory=Placement)
    """Where the paper's paths are for the arm."""


def settings_for(model: RobotModel, settings: LiveSettings) -> LiveSettings:
    """Return settings with the paths, the place where the hand begins, and the kind of arm for an arm.

    Raises ExperimentError where the arm cannot follow the paths anywhere.
    """
    placement = placement_for(model)
    hand, plant = placement.point(*settings.hand_start), plant_params_of(model.description)
    return replace(settings, placement=placement, hand_start=hand, plant=plant)


_SETTLE_S = 0.2
"""Time the arm stands before the controller starts [s]: the observer's transient is over."""


def live_path(settings: LiveSettings) -> Path:
    """Return the path by its name, begun on the side away from the object."""
    path = settings.placement.path(settings.path, 1.0 if settings.object == "board +y" else -1.0)
    return WayPoints(path.points, closed=True) if isinstance(path, WayPoints) else path


class Room:
    """All that is simulated, at rest where the path begins."""

    def __init__(
        self, settings: LiveSettings, path: Path, model: RobotModel, skin: Skin, real: RealUnits | None = None
    ) -> None:
        """Build it; a control period that is no whole number of physics steps is a ParameterError.

        With `real` units the arm carries those in place of simulated ones.
        """
        q, hand = brought_to(model, path.point(0.0)), HandSpec(stiffness=settings.stiffness)
        boxes: tuple[Box, ...] = ()
        if settings.object != "none":
            side: Side = "+y" if settings.object == "board +y" else "-y"
            face, met_by = settings.placement.face(FACE_M, side), settings.placement.hand(side)
            boxes = (board_beside(path, side, settings.stiffness, face, hand=met_by),)
        scene = SceneSpec(boxes=boxes, hand=hand)
        self.mouse = Mouse(np.array(settings.hand_start), scene, hand, settings.placement.scale)
        start = clear_place(model, q, scene, self.mouse.target, hand.radius + GAP_M)
        self.mouse.move(start)
        self.scene = replace(scene, hand=replace(hand, start=tuple(start.tolist())))
        self.plant = Plant(model, self.scene, settings.plant, q, settings.seed)
        self._simulated = None if real else RangeFinders(self.plant, skin, settings.ranging, settings.seed)
        self.units: UnitPort = self._simulated or cast(RealUnits, real)
        if self._simulated and len(skin.touching):
            touch = TouchSensors(self.plant, skin, TouchErrors(), settings.seed)
            self.units = SimulatedTouchSkin(self._simulated, touch)
        self.hand = Hand(self.plant, self.mouse, PersonArm(speed_max=HAND_SPEED_M_S))
        self.clock = PlantClock(self.plant, settings.profile.task.control_period_s)
        self.stiffness = self._wanted = settings.stiffness
        self._skin, self._nominal = skin, settings.ranging
        self._moving = np.flatnonzero(model.moved_by.any(axis=1))
        self.set_faults(settings.faults)
        self.plant.advance(_SETTLE_S)
        if real:
            real.begin(lambda: self.plant.time)

    def set_faults(self, faults: Faults) -> None:
        """Apply faults to the units from the next measurement on; an unknown id is a ParameterError.

        So is any fault of real units.
        """
        if self._simulated is None:
            if faults != Faults():
                raise ParameterError("These units are real: unplug or cover one to see what the arm does.")
            return
        unknown = sorted(faults.silenced - set(self._skin.boards))
        if unknown:
            known = ", ".join(unit.id for unit in self._skin.mounted)
            raise ParameterError(f"Unknown unit {', '.join(unknown)}: choose from {known}.")
        sound = self._nominal
        self._simulated.silenced = {i for i, name in enumerate(self._skin.boards) if name in faults.silenced}
        self._simulated.change(replace(
            sound, noise_floor_m=sound.noise_floor_m * faults.noise_factor,
            noise_rate=sound.noise_rate * faults.noise_factor, latency_s=sound.latency_s + faults.latency_s,
        ))  # fmt: skip

    def set_stiffness(self, stiffness: float) -> None:
        """Give hand and object another stiffness [N/m], as soon as nothing touches."""
        self._wanted = stiffness

    @property
    def touched(self) -> FloatArray | None:
        """Middle (3,) of the points at which something touches the arm [m], base frame; None while nothing does."""
        data, owner = self.plant.mj_data, self.plant.mj_model.geom_bodyid
        if not data.ncon:
            return None
        on_arm = np.isin(owner[data.contact.geom], self._moving).any(axis=1)
        return np.mean(data.contact.pos[on_arm], axis=0) if on_arm.any() else None

    def tick(self) -> float:
        """Let one control period pass and return the time [s]."""
        if self._wanted != self.stiffness and not self.plant.touching:
            self.stiffness = self._wanted
            for thing in ("hand", *(box.name for box in self.scene.boxes)):
                self.plant.stiffen(thing, self.stiffness)
        return self.clock.tick()
