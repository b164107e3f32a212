"""An arm that goes on whatever touches it, in a room with one ghost, and the stream of what it said."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from pretouch.control.path import Circle, Path, WayPoints
from pretouch.controller import Controller
from pretouch.loop import Cycle, run
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import Skin, load_skin, paper_skin
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.random_skin import Misplacement, misplaced
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import GhostSpec, SceneSpec, fixtures
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.detection.stream import PROFILE, Stream, StreamRecorder
from pretouch_lab.benchmarks.scenario_files import scenario, scenario_path
from pretouch_lab.domain_randomisation import Parts, randomised
from pretouch_lab.replay import Ghost
from pretouch_lab.trial import SETTLE_S

AWAY = np.array([0.0, 0.0, 4.0])
"""Where the ghost is while it is not there [m]: no unit sees so far."""
_RETURN_M_S = 0.1
"""Bound on the speed at which a standing arm goes back to where it is to stand [m/s]."""


@dataclass(frozen=True)
class Sensing:
    """A skin and how it errs, as a scenario file names it."""

    skin: Skin
    """Where the units are."""
    believed: Skin
    """Where the controller believes them to be."""
    ranging: RangeFinderParams
    hand_radius: float
    """Of the person's visible hand [m]."""


@cache
def model() -> RobotModel:
    """Return the arm of all scenarios, one for each process."""
    return RobotModel(panda())


def plant_of(kind: str) -> PlantParams:
    """Return the plant of a kind of arm in `arms.toml`."""
    return replace(PlantParams(), **scenario("arms")[kind])


def sensing_of(name: str, seed: int, skin: Skin | None = None) -> Sensing:
    """Return the skin of a name in `sensing.toml`, or another one that errs so; a seed says how units are misplaced."""
    values: dict[str, Any] = dict(scenario("sensing")[name])
    kind, radius = values.pop("skin"), values.pop("hand_radius")
    error = Misplacement(values.pop("position_mm", 0.0), values.pop("orientation_deg", 0.0))
    units = skin or (paper_skin(model()) if kind == "seven" else load_skin(scenario_path("dense_skin.toml"), model()))
    exact = error == Misplacement()
    believed = units if exact else misplaced(units, model(), error, seed)[0]
    return Sensing(units, believed, RangeFinderParams(**values), radius)


def path_of(name: str) -> Path:
    """Return a path by its name: circle, line (to and fro), or rest."""
    if name == "line":
        return WayPoints(np.array([[0.4, 0.5, 0.5], [0.4, -0.5, 0.5]]), closed=True)
    return Circle() if name == "circle" else Standing(Circle().point(0.0))


@dataclass(frozen=True)
class Standing:
    """A path that is one point, so that the arm stands."""

    at: FloatArray
    """(3,) [m], base frame."""
    length: float = 0.0
    closed: bool = False

    def point(self, _phase: float) -> FloatArray:
        """Return the point (3,) [m]."""
        return self.at

    def tangent(self, _phase: float) -> FloatArray:
        """Return no direction (3,)."""
        return np.zeros(3)


@dataclass(frozen=True)
class Alone:
    """An arm that is left to itself but for what `prepare` has done to it."""

    path: Path
    speed_m_s: float
    """Speed along the path [m/s]; 0 stands."""
    plant: PlantParams
    sensing: Sensing
    ghost_radius: float
    """[m]"""
    seed: int
    end_s: float
    """When it ends [s]."""
    world: str = ""
    """Set of the domain randomisation of which the seed draws one, or none."""
    start: FloatArray | None = None
    """Joint positions (n,) in which it begins [rad]; None: those in which its path does."""
    controller: Callable[..., Controller] = Controller
    """Makes its controller, as `Controller` is made."""


Prepare = Callable[[Plant], Callable[[float], FloatArray]]
"""Has things done to an arm before each physics step, and returns where the ghost is at a time: (3,) [m]."""


def record(
    what: Alone, prepare: Prepare, look: Callable[[Plant, Ghost, Cycle], None] = lambda plant, ghost, cycle: None
) -> Stream:
    """Let an arm run until its end and return its stream; `look(plant, ghost, cycle)` sees each cycle."""
    found, sensing = profile(PROFILE), what.sensing
    known = None if sensing.believed is sensing.skin else sensing.believed
    parts = randomised(what.world, what.seed, model(), Parts(what.plant, sensing.ranging, sensing.skin, known))
    task = replace(found.task, speed_m_s=what.speed_m_s or _RETURN_M_S)
    start = (float(AWAY[0]), float(AWAY[1]), float(AWAY[2]))
    scene = SceneSpec(ghost=GhostSpec(what.ghost_radius, start))
    begin = brought_to(model(), what.path.point(0.0)) if what.start is None else what.start
    plant = Plant(model(), scene, parts.plant, begin, what.seed)
    finders = RangeFinders(plant, parts.skin, parts.ranging, what.seed)
    ghost = Ghost(plant, prepare(plant))
    controller = what.controller(
        model(), parts.skin if parts.believed is None else parts.believed, fixtures(scene), what.path,
        replace(found, task=task),
    )  # fmt: skip
    plant.advance(SETTLE_S)
    recorder = StreamRecorder(plant, lambda cycle: look(plant, ghost, cycle))
    period = task.control_period_s
    run(
        controller, plant, finders, PlantClock(plant, period), recorder,
        lambda step: step.stamp >= what.end_s - 0.5 * period,
    )  # fmt: skip
    return recorder.stream()
