"""Inputs that the commands come back into: the simulated arm, and arms that follow among many points.

They are the same to the bit on one machine, and nowhere else: they are compared between two checkouts and not stored.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from pretouch.control.path import Path
from pretouch.controller import Controller
from pretouch.loop import Cycle, run
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import profile
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import Skin
from pretouch.sim.hand import Hand, Pusher
from pretouch.sim.paper_scenes import dynamic_pushes, static_path, static_scene
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.random_skin import random_skin
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import HandSpec, SceneSpec, fixtures
from pretouch.types import Inputs, RangeReadings, RangeStatus, RobotState
from tests.golden.fields import Values, values_of
from tests.golden.streams import model, skin

SEED = 3
_UNIT_RATE = 50.0
"""Readings of a unit in a second."""


class _Steps:
    """Keeps the values of each step."""

    def __init__(self) -> None:
        self.values: list[Values] = []

    def record(self, cycle: Cycle) -> None:
        self.values.append(values_of(cycle.step))


def simulated(
    scene: SceneSpec, path: Path, name: str, seconds: float, person: Pusher | None = None
) -> dict[int, Values]:
    """Run the simulated arm for a time in a scene, beside a person or alone."""
    plant = Plant(model(), scene, PlantParams(), brought_to(model(), path.point(0.0)), SEED)
    units, steps = RangeFinders(plant, skin(), RangeFinderParams(), SEED), _Steps()
    if person is not None:
        Hand(plant, person)
    controller = Controller(model(), skin(), fixtures(scene), path, profile(name))
    clock = PlantClock(plant, controller.profile.task.control_period_s)
    plant.advance(0.2)
    run(controller, plant, units, clock, steps, lambda step: step.stamp >= seconds)
    return dict(enumerate(steps.values))


def static(name: str, trajectory: str, side: str) -> dict[int, Values]:
    """Run into the paper's static object."""
    scene = static_scene(trajectory, side, 25_000.0, SEED)
    return simulated(scene, static_path(trajectory, side), name, 8.0)


def dynamic(name: str) -> dict[int, Values]:
    """Be pushed by the paper's person."""
    person, scene = Pusher(model(), dynamic_pushes(SEED)), SceneSpec(hand=HandSpec())
    return simulated(scene, static_path("circle", "-y"), name, 20.0, person)


def crowd(units: int, name: str, cycles: int) -> dict[int, Values]:
    """Let an arm with many units follow its commands among things that all of them see."""
    rng, placed, seed = np.random.default_rng(SEED), [], 0
    while len(placed) < units:
        placed += random_skin(model(), seed).units
        seed += 1
    many = Skin([replace(unit, id=f"unit_{i}") for i, unit in enumerate(placed[:units])], model())
    found = Controller(model(), many, no_fixtures(), static_path("circle", "-y"), profile(name))
    q, qd, still = brought_to(model(), found.path.point(0.0)), np.zeros(model().n), np.zeros(model().n)
    state = found.init(RobotState(0.0, q, qd, q, qd, still, np.zeros(6)))
    stamp, distance, phase = np.zeros(units), rng.uniform(0.3, 0.6, units), rng.uniform(0.0, 1.0, units)
    steps = {}
    for i in range(cycles):
        now = 0.01 * i
        due = np.floor(now * _UNIT_RATE - phase) > np.floor((now - 0.01) * _UNIT_RATE - phase)
        stamp = np.where(due, now, stamp)
        distance = np.where(due, np.clip(distance + rng.normal(0.0, 0.01, units), 0.1, 0.8), distance)
        readings = RangeReadings(stamp, distance, np.full(units, int(RangeStatus.OK)))
        wrench = np.concatenate([rng.normal(0.0, 0.3, 3), np.zeros(3)])
        step, state = found.step(state, Inputs(now, RobotState(now, q, qd, q, qd, still, wrench), readings))
        q, qd = q + step.command * 0.01, step.command
        steps[i] = values_of(step)
    return steps


CLOSED: dict[str, Callable[[], dict[int, Values]]] = {
    "static/circle/paper": partial(static, "paper:approach=none", "circle", "-y"),
    "static/line/paper-slack": partial(static, "paper", "line", "+y"),
    "static/line/pretouch": partial(static, "pretouch", "line", "+y"),
    "dynamic/paper": partial(dynamic, "paper"),
    "dynamic/pretouch": partial(dynamic, "pretouch"),
    "32-units/paper": partial(crowd, 32, "paper", 400),
    "32-units/pretouch": partial(crowd, 32, "pretouch", 400),
    "1000-points/paper": partial(crowd, 1000, "paper", 200),
    "1000-points/pretouch": partial(crowd, 1000, "pretouch", 200),
}
"""Name -> what runs it. Names stay, and have no spaces."""
