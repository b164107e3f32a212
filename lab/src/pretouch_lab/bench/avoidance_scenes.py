"""Scenes of the avoidance benchmark: scenarios from files, and the setting that a seed draws."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from pretouch.control.path import Path
from pretouch.profiles import Profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, load_skin, paper_skin, skin_for
from pretouch.sim.hand import PersonArm
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.types import ControlStep
from pretouch_lab.bench.obstacle import Ball, Cuboid, ShapeAt
from pretouch_lab.bench.scenes import SeedRange, held, scenario, scenario_path, seed_of
from pretouch_lab.domain_randomisation import Misplacement, misplaced
from pretouch_lab.experiments.avoidance import Visit, Visitor, Walk
from pretouch_lab.placement import UNMOVED, PeoplePlacement, people_placement
from pretouch_lab.trial import Setup

FAMILIES = ("srdo", "drdo", "person", "hand", "static", "sensing", "arm", "walking")
"""Files without the prefix `avoidance-`, in the order of the tables."""
Table = dict[str, Any]
PANDA = "panda"
"""The arm of the scenarios' coordinates."""
_USUAL = PlantParams()


@dataclass(frozen=True, eq=False)
class Scenario:
    """One scene with the values of its file; its trials differ by their seed."""

    name: str
    family: str
    text: str
    """Description in one sentence."""
    params: Table
    """The file's keys, replaced by those of this variant; `count` and `quick` are numbers of trials of a contender."""

    def seeds(self, seeds: SeedRange, quick: bool) -> list[int]:
        """Return the seeds of a run's trials."""
        return self.first_seeds(seeds, self.params["quick" if quick else "count"])

    def first_seeds(self, seeds: SeedRange, count: int) -> list[int]:
        """Return the first `count` seeds of a range."""
        return [seed_of(self.params, seeds, number) for number in range(count)]


@cache
def scenarios() -> dict[str, Scenario]:
    """Return all scenarios by name. Raises ExperimentError for a changed file."""
    every: dict[str, Scenario] = {}
    for family in FAMILIES:
        shared = dict(scenario(f"avoidance-{family}"))
        for variant in shared.pop("variant"):
            own = {  # a variant replaces single keys of a table
                key: shared[key] | value if isinstance(shared.get(key), dict) else value
                for key, value in variant.items()
            }
            every[own["name"]] = Scenario(own["name"], family, shared["text"], shared | own)
    return every


@dataclass(frozen=True)
class Setting:
    """Setup, obstacle and end of a trial."""

    setup: Setup
    shape: ShapeAt
    """The obstacle's surface as a function of the position of the person's hand."""
    done: Callable[[ControlStep, Plant], bool]


@cache
def arm(name: str = PANDA) -> RobotModel:
    """Return the arm of all scenarios: the Panda, or another by its name or folder."""
    return RobotModel(robot_named(name))


@cache
def place(name: str = PANDA) -> PeoplePlacement:
    """Return the placement of the scenarios' paths and obstacles for an arm."""
    return people_placement(arm(name))


@cache
def skin(name: str, of: str = PANDA) -> Skin:
    """Return the skin of a name in the scenarios; another arm than the Panda always has its own skin."""
    if of != PANDA:
        return skin_for(arm(of), paper=True)
    return load_skin(scenario_path("dense_skin.toml"), arm()) if name == "dense" else paper_skin(arm())


def setting(scenario: Scenario, profile: Profile, seed: int, name: str = PANDA) -> Setting:
    """Return the setting of a trial with the named arm."""
    params, model = scenario.params, arm(name)
    path = path_of(params["path"], place(name))
    units = skin(params["skin"], name) if profile.perception else Skin((), model)  # no units if the profile reads none
    error = params.get("misplaced")
    shape, scene = _obstacle(params, seed, name)
    setup = Setup(
        model=model,
        skin=units,
        believed=misplaced(units, model, Misplacement(**error), seed) if error else None,
        profile=profile,
        path=path,
        seed=seed,
        plant=plant_of(params.get("plant", {}), plant_params_of(model.description)),
        ranging=RangeFinderParams(realistic=True, **params.get("ranging", {})),
        **scene,
    )
    after, length = params.get("after_contact_s", np.inf), params.get("turns", np.inf) * path.length

    def done(step: ControlStep, plant: Plant) -> bool:
        touched = plant.touches[0].time if plant.touches else np.inf
        return bool(step.stamp >= min(params["duration_s"], touched + after) or step.path_phase >= length)

    return Setting(setup, shape, done)


def path_of(params: Table, where: PeoplePlacement = UNMOVED) -> Path:
    """Return the path of a scenario at its place for an arm."""
    if params["kind"] == "held":
        return held(np.array(where.point(*params["point"])))
    if "side" in params:
        return static_path(params["kind"], params["side"], where)
    return where.path("circle", -1.0)


def plant_of(params: Table, usual: PlantParams = _USUAL) -> PlantParams:
    """Return the errors of the arm; `friction_factor` scales the friction of all joints."""
    factor = params.get("friction_factor", 1.0)
    own = {key: value for key, value in params.items() if key != "friction_factor"}
    return replace(usual, friction_f1_nm=tuple(factor * f for f in usual.friction_f1_nm), **own)


def _obstacle(params: Table, seed: int, name: str) -> tuple[ShapeAt, Table]:
    """Return an obstacle's surface, and its fields of a `Setup`."""
    obstacle, where = params["obstacle"], place(name)
    stiffness = obstacle["contact_stiffness_n_m"]
    match obstacle["kind"]:
        case "board":
            way = params["path"]
            return _standing(static_scene(way["kind"], way["side"], stiffness, seed, where).boxes[0])
        case "box":
            (x, y, _), z, (a, b, c) = where.moved(*obstacle["center"]), obstacle["center"][2], obstacle["half_size"]
            return _standing(Box("object", (x, y, z), (a, b, c), stiffness))  # it stands on the floor
        case "visitor":
            return _visiting(obstacle, seed, name)
    return _walking(obstacle, seed, where)


def _standing(box: Box) -> tuple[ShapeAt, Table]:
    shape = Cuboid(np.array(box.center), np.array(box.half_size))
    return lambda _: shape, {"scene": SceneSpec(boxes=(box,))}


def _visiting(obstacle: Table, seed: int, name: str) -> tuple[ShapeAt, Table]:
    """Place a person who holds a hand beside the path or in it on one side, as in the paper's experiment."""
    rng, where = np.random.default_rng([seed, 21]), place(name)
    side = rng.choice([-1.0, 1.0])
    # shifted like the hands of the paper's experiment, from the place for the Panda
    off = np.subtract(where.visited("beside", side), UNMOVED.visited("beside", side))
    at = np.array([obstacle["x_m"], side * obstacle["y_m"], obstacle["z_m"]]) + off
    visit = Visit(obstacle["arrive_s"], obstacle["leave_s"], at + obstacle["spread_m"] * rng.uniform(-1, 1, 3))
    spec = HandSpec(obstacle["radius_m"], obstacle["mass_kg"], obstacle["contact_stiffness_n_m"])
    return lambda hand: Ball(hand, spec.radius), {"scene": SceneSpec(hand=spec), "hand": Visitor(arm(name), (visit,))}


def _walking(obstacle: Table, seed: int, where: PeoplePlacement) -> tuple[ShapeAt, Table]:
    """Place a person or a hand that moves straight in and stays; the seed draws speed, time and perhaps the side."""
    rng = np.random.default_rng([seed, 20])
    side = rng.choice([-1.0, 1.0]) if obstacle.get("both_sides") else 1.0
    begin, end = (np.array(where.moved(*obstacle[key])) * [1.0, side, 1.0] for key in ("from", "to"))
    speed, start = rng.uniform(*obstacle["speed_m_s"]), rng.uniform(*obstacle["start_s"])
    times, (x, y, z) = start + np.array([0.0, float(np.linalg.norm(end - begin)) / speed]), begin.tolist()
    spec = HandSpec(obstacle["radius_m"], obstacle["mass_kg"], obstacle["contact_stiffness_n_m"], (x, y, z))
    return lambda hand: Ball(hand, spec.radius), {
        "scene": SceneSpec(hand=spec),
        "hand": Walk(times, np.array([begin, end]), obstacle["force_max_n"]),
        "person": PersonArm(2.0 * speed, obstacle["spring_n_m"], obstacle["damping_n_s_m"]),
    }
