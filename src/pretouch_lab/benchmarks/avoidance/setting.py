"""A trial's setting: the arm, skin, path, scene and person a scenario and a seed decide."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from pretouch.control.path import Circle, Path, line
from pretouch.profiles import Profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, load_skin, paper_skin
from pretouch.sim.hand import HandScript, PersonArm
from pretouch.sim.misplacement import Misplacement, misplaced
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.pushes import Visit, Visitor
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.types import ControlStep, FloatArray
from pretouch_lab.benchmarks.avoidance.obstacle import Ball, Cuboid, Shape, Walker
from pretouch_lab.benchmarks.avoidance.scenario import Scenario, Table
from pretouch_lab.benchmarks.scenario_files import scenario_path
from pretouch_lab.trial import Setup

_HELD_M = 0.001
"""Length of the path of a hand that is held: a path has to have one."""


@dataclass(frozen=True)
class Setting:
    """All that a trial is made of, but the controller."""

    setup: Setup
    """With a profile that is replaced."""
    shape: Callable[[FloatArray], Shape]
    """The obstacle, given where the person's hand is (3,) [m]."""
    done: Callable[[ControlStep, Plant], bool]


@cache
def arm() -> RobotModel:
    """Return the arm of all scenarios."""
    return RobotModel(panda())


@cache
def skin(name: str) -> Skin:
    """Return a skin by the name that scenarios have for it."""
    return load_skin(scenario_path("dense_skin.toml"), arm()) if name == "dense" else paper_skin(arm())


def setting(scenario: Scenario, profile: Profile, seed: int) -> Setting:
    """Make the setting of a trial."""
    says, model = scenario.says, arm()
    path = path_of(says["path"])
    placed = _obstacle(says, seed)
    units = skin(says["skin"])
    error = says.get("misplaced")
    setup = Setup(
        model=model,
        skin=units,
        believed=misplaced(units, model, Misplacement(**error), seed)[0] if error else None,
        profile=profile,
        scene=placed.scene,
        path=path,
        seed=seed,
        plant=plant_of(says.get("plant", {})),
        ranging=RangeFinderParams(**says.get("ranging", {})),
        hand=placed.hand,
        person=placed.person,
    )
    return Setting(setup, placed.shape, _done(says, path))


def path_of(told: Table) -> Path:
    """Return the path a scenario tells of."""
    if told["kind"] == "held":
        x, y, z = told["point"]
        return line((x, y, z), (x, y, z + _HELD_M))
    if "side" in told:
        return static_path(told["kind"], told["side"])
    return Circle()


def plant_of(told: Table) -> PlantParams:
    """Return the arm's errors; `friction_factor` is that of all joints' friction."""
    own, usual = dict(told), PlantParams()
    factor = own.pop("friction_factor", 1.0)
    return replace(usual, friction_f1_nm=tuple(factor * f for f in usual.friction_f1_nm), **own)


@dataclass(frozen=True)
class _Placed:
    """An obstacle in its scene."""

    scene: SceneSpec
    shape: Callable[[FloatArray], Shape]
    hand: HandScript | None = None
    person: PersonArm = field(default_factory=PersonArm)


def _obstacle(says: Table, seed: int) -> _Placed:
    told = says["obstacle"]
    stiffness = told["contact_stiffness_n_m"]
    match told["kind"]:
        case "board":
            way = says["path"]
            return _standing(static_scene(way["kind"], way["side"], stiffness, seed).boxes[0])
        case "box":
            (x, y, z), (a, b, c) = told["center"], told["half_size"]
            return _standing(Box("object", (x, y, z), (a, b, c), stiffness))
        case "visitor":
            return _visiting(told, seed)
    return _walking(told, seed)


def _standing(box: Box) -> _Placed:
    shape = Cuboid(np.array(box.center), np.array(box.half_size))
    return _Placed(SceneSpec(boxes=(box,)), lambda _: shape)


def _visiting(told: Table, seed: int) -> _Placed:
    """Place a person who holds a hand beside the path or into it on one side, as in the paper's experiment."""
    rng = np.random.default_rng([seed, 21])
    side = rng.choice([-1.0, 1.0])
    place = np.array([told["x_m"], side * told["y_m"], told["z_m"]]) + told["spread_m"] * rng.uniform(-1, 1, 3)
    spec = HandSpec(told["radius_m"], told["mass_kg"], told["contact_stiffness_n_m"])
    script = Visitor(arm(), (Visit(told["arrive_s"], told["leave_s"], place),))
    return _Placed(SceneSpec(hand=spec), lambda hand: Ball(hand, spec.radius), script)


def _walking(told: Table, seed: int) -> _Placed:
    """Place a person or a hand that comes straight in and stays; the seed draws speed, time and perhaps the side."""
    rng = np.random.default_rng([seed, 20])
    side = rng.choice([-1.0, 1.0]) if told.get("both_sides") else 1.0
    begin, end = (np.array(told[key]) * [1.0, side, 1.0] for key in ("from", "to"))
    speed, start = rng.uniform(*told["speed_m_s"]), rng.uniform(*told["start_s"])
    x, y, z = begin.tolist()
    spec = HandSpec(told["radius_m"], told["mass_kg"], told["contact_stiffness_n_m"], (x, y, z))
    return _Placed(
        SceneSpec(hand=spec),
        lambda hand: Ball(hand, spec.radius),
        Walker(begin, end, speed, start, told["force_max_n"]),
        PersonArm(2.0 * speed, told["spring_n_m"], told["damping_n_s_m"]),
    )


def _done(says: Table, path: Path) -> Callable[[ControlStep, Plant], bool]:
    """End at the time limit, a while after the first touch, or after so many turns, as the scenario says."""
    after, turns = says.get("after_contact_s", np.inf), says.get("turns", np.inf)

    def done(step: ControlStep, plant: Plant) -> bool:
        touched = plant.touches[0].time if plant.touches else np.inf
        return (
            step.stamp >= says["duration_s"] or step.stamp >= touched + after or step.path_phase >= turns * path.length
        )

    return done
