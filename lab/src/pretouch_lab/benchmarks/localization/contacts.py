"""Contacts on an arm that wanders, recorded with each skin."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from pretouch.profiles import profile
from pretouch.sim.plant import Plant
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.detection.arm import Alone, model, path_of, plant_of, record, sensing_of
from pretouch_lab.benchmarks.detection.contacts import Toucher, Touching, described, place_on
from pretouch_lab.benchmarks.detection.stream import PROFILE, save_stream
from pretouch_lab.benchmarks.localization.motion import Wandering, WanderingController, wandering
from pretouch_lab.benchmarks.scenario_files import SeedRange, numbered, scenario

_TAIL_S = 0.6
"""Time after the last contact [s]."""


@dataclass(frozen=True)
class TouchedCell:
    """One arm with one skin, touched again and again."""

    sensing: str
    seed: int

    @property
    def name(self) -> str:
        """Name for files."""
        return f"{self.sensing}_{self.seed:04d}"


def touched_cells(seeds: SeedRange, quick: bool) -> list[TouchedCell]:
    """Return the cells of the scenario file; an arm has the same seed, and so the same contacts, with each skin."""
    family = scenario("localization")
    return [
        TouchedCell(sensing, seed)
        for cell, seed in numbered(family, family["cell"], seeds, quick)
        for sensing in cell["sensing"]
    ]


def duration_s(cell: TouchedCell) -> float:
    """Say about how long a cell's stream is [s]."""
    family = scenario("localization")
    return float(family["duration"]["warm_up_s"] + 3.6 * family["contact"]["number"])


def planned(cell: TouchedCell) -> tuple[Wandering, list[Touching]]:
    """Draw a cell's motion and its contacts. The seed says which."""
    family, rng = scenario("localization"), np.random.default_rng([cell.seed, 42])
    course = wandering(cell.seed, 2.0 * duration_s(cell))
    touches: list[Touching] = []
    at = float(family["duration"]["warm_up_s"])
    for number in range(family["contact"]["number"]):
        touches.append(_drawn(course, at, number, rng))
        at = touches[-1].end + rng.uniform(*family["duration"]["gap_s"])
    return course, touches


def _drawn(course: Wandering, at: float, number: int, rng: np.random.Generator) -> Touching:
    """Draw a contact that begins at a time [s]; links take turns, so that all are touched as often."""
    family, arm = scenario("localization"), model()
    chosen, hand = family["contact"], scenario("contacts")["hand"]
    radius = sensing_of("nominal", 0).hand_radius
    every = [(k, duration) for k, kind in enumerate(chosen["kind"]) for duration in kind["durations_s"]]
    k, duration = every[int(rng.integers(len(every)))]
    name = chosen["links"][number % len(chosen["links"])]
    link = arm.link_index(f"{arm.description.name}_{name}")
    point, normal = place_on(link, course.at(at)[0], radius, rng, hand["from_m"])
    inwards = chosen["tilt"] * rng.uniform(-1, 1, 3) - normal
    force = float(rng.choice(chosen["forces_n"]))
    inwards /= np.linalg.norm(inwards)
    return Touching(link, k, force, chosen["kind"][k]["rise_s"], duration, at, point, normal, inwards)


def record_touched(cell: TouchedCell, file: Path) -> None:
    """Record one cell's stream, with its contacts: `touch.NAME` for each field of `Touching`."""
    course, touches = planned(cell)
    sensing, speed = sensing_of(cell.sensing, cell.seed), profile(PROFILE).task.speed_m_s
    kind = scenario("localization")["arm"]["kind"]
    what = Alone(
        path_of("rest"), speed, plant_of(kind), sensing, sensing.hand_radius, cell.seed,
        touches[-1].end + _TAIL_S,
        start=course.at(0.0)[0], controller=partial(WanderingController, course),
    )  # fmt: skip

    def prepare(plant: Plant) -> Callable[[float], FloatArray]:
        return Toucher(plant, touches, sensing.hand_radius).hand

    save_stream(replace(record(what, prepare), truth=described(touches, sensing.hand_radius)), file)
