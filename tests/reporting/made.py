"""Recordings as the reader hands them out, made without a file: played, or written down by hand."""

from dataclasses import dataclass, field, replace

import numpy as np

from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.loop import run
from pretouch.modes import Event
from pretouch.profiles import profile as find_profile
from pretouch.recording.simulation import Truth, truth_of
from pretouch.robot.postures import brought_to
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import fixtures
from pretouch.types import (
    Contact,
    ControlStep,
    Inputs,
    Mode,
    QpOutcome,
    QpSolution,
    RangeReadings,
    RobotState,
    Thresholds,
    no_obstacles,
)


@dataclass
class Run:
    model: object
    skin: object
    profile: object
    path: object = field(default_factory=Circle)
    versions: dict = field(default_factory=lambda: {"pretouch": "0.1", "numpy": "2.4"})
    started: float = 1_700_000_000.0
    about: dict = field(default_factory=lambda: {"command": "made", "seed": 3})


@dataclass
class Kept:
    run: int
    inputs: Inputs | None
    step: ControlStep
    truth: Truth | None = None


@dataclass
class Recorded:
    runs: tuple
    kept: list
    complete: bool = True
    sentence: str = ""

    def __getitem__(self, i):
        return self.kept[i]


class Recorder:
    def __init__(self, plant):
        self.plant, self.kept, self.forces, self.touches = plant, [], 0, 0

    def record(self, cycle):
        truth = truth_of(self.plant.true_log[self.forces :], self.plant.touches[self.touches :], None)
        self.forces, self.touches = len(self.plant.true_log), len(self.plant.touches)
        self.kept.append(Kept(0, cycle.inputs, cycle.step, truth))


def played(model, skin, profile="paper", side="-y", seed=0, seconds=6.0, until_reaction=None):
    """The arm runs into a board: what was recorded, and the plant that knows the truth."""
    used = replace(find_profile(profile), approach=None)
    scene, path = static_scene("line", side, 25_000.0, seed), static_path("line", side)
    plant = Plant(model, scene, PlantParams(), brought_to(model, path.point(0.0)), seed)
    units = RangeFinders(plant, skin, RangeFinderParams(), seed)
    recorder = Recorder(plant)
    plant.advance(0.2)
    controller = Controller(model, skin, fixtures(scene), path, used)
    felt = []

    def done(step):
        felt.extend([step.stamp] if step.contact is not None else [])
        over = until_reaction is not None and felt and step.stamp >= felt[0] + until_reaction
        return bool(over) or step.stamp > seconds

    run(controller, plant, units, PlantClock(plant, 0.01), recorder, done)
    return Recorded((Run(model, skin, used, path),), recorder.kept), plant


def seen(model, points):
    """Obstacles by hand: (unit, link, body distance, distance from the end-effector)."""
    count = len(points)
    unit, link, body, ee = (np.array(c) for c in zip(*points, strict=True)) if points else ((),) * 4
    place = np.tile([0.5, 0.0, 0.5], (count, 1))
    return no_obstacles(count)._replace(
        unit=np.array(unit, dtype=np.int64), point=place, ee_distance=np.array(ee, dtype=float), body_point=place,
        link=np.array([model.link_index(name) for name in link], dtype=np.int64), direction=place,
        body_distance=np.array(body, dtype=float),
    )  # fmt: skip


def step(model, units=7, stamp=0.0, near=(), **changes):
    """One step at rest in the ready posture that sees and feels nothing."""
    n, zero = model.n, np.zeros(3)
    made = ControlStep(
        stamp=stamp, mode=Mode.TRACK, event=Event.CLEAR, detail="", reason="Moving as requested.", latched=False,
        q=model.description.q_ready,
        q_commanded=model.description.q_ready, ee_position=np.array([0.5, 0.0, 0.5]), ee_velocity=zero,
        path_position=np.array([0.5, 0.0, 0.5]), path_phase=0.0, desired_velocity=zero, speed_scale=1.0,
        range_distance=np.full(units, np.nan), obstacles=seen(model, near), force=zero, filtered_force=zero,
        thresholds=Thresholds(*np.zeros((6, 3))), armed=True, contact=None, reaction_velocity=zero,
        restricted=np.zeros(0, np.int64), approach_limit=np.zeros(0),
        qp=QpSolution(np.zeros(n), np.zeros(0), np.zeros(n), QpOutcome.SOLVED, "Solved."), command=np.zeros(n),
        residual=np.zeros(n), evidence=0.0,
    )  # fmt: skip
    return replace(made, **changes)


def inputs(model, units=7, stamp=0.0, age=0.0, **changes):
    """What a step at an instant was given: readings and a robot state of an age, of nothing near."""
    n = model.n
    robot = RobotState(stamp - age, np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(6))
    readings = RangeReadings(np.full(units, stamp - age), np.full(units, 0.5), np.zeros(units, np.int64))
    return replace(Inputs(stamp, robot, readings), **changes)


def truth(time, force, touches=()):
    """True forces along -y at some instants."""
    along = np.zeros((len(time), 3))
    along[:, 1] = -np.asarray(force)
    return truth_of(list(zip(time, along, strict=True)), touches, None)


def recorded(model, skin, steps, *, given=None, truths=None, **changes):
    """Steps of one run with the profile paper, and what goes with each."""
    given, truths = given or [None] * len(steps), truths or [None] * len(steps)
    kept = [Kept(0, i, s, t) for i, s, t in zip(given, steps, truths, strict=True)]
    return Recorded((Run(model, skin, find_profile("paper")),), kept, **changes)


def contact(force, axes):
    return Contact(np.array(force, dtype=float), np.array(axes))
