"""Contacts on an arm that wanders: one at a time, or two at once, recorded with each skin."""

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

    contacts: int
    """At once: 1 or 2."""
    sensing: str
    seed: int

    @property
    def name(self) -> str:
        """Name for files."""
        return f"{self.contacts}_{self.sensing}_{self.seed:04d}"


def touched_cells(seeds: SeedRange, quick: bool) -> list[TouchedCell]:
    """Return the cells of the scenario file; an arm has the same seed, and so the same contacts, with each skin."""
    family = scenario("localization")
    return [
        TouchedCell(cell["contacts"], sensing, seed)
        for cell, seed in numbered(family, family["cell"], seeds, quick)
        for sensing in cell["sensing"]
    ]


def duration_s(cell: TouchedCell) -> float:
    """Say about how long a cell's stream is [s]."""
    family = scenario("localization")
    return float(family["duration"]["warm_up_s"] + 3.6 * family["contact"]["number"])


def planned(cell: TouchedCell) -> tuple[Wandering, list[list[Touching]]]:
    """Draw a cell's motion and, for each hand, its contacts, the visible hand's first. The seed says which."""
    family, rng = scenario("localization"), np.random.default_rng([cell.seed, 42])
    course = wandering(cell.seed, 2.0 * duration_s(cell))
    hands: list[list[Touching]] = [[] for _ in range(cell.contacts)]
    at = float(family["duration"]["warm_up_s"])
    for number in range(family["contact"]["number"]):
        first = _drawn(cell, course, at, number, None, rng)
        hands[0].append(first)
        if cell.contacts == 2:
            later = at + rng.uniform(0.0, family["pair"]["later_s"])
            hands[1].append(_drawn(cell, course, later, number, first, rng))
        at = max(hand[-1].end for hand in hands) + rng.uniform(*family["duration"]["gap_s"])
    return course, hands


def _drawn(
    cell: TouchedCell, course: Wandering, at: float, number: int, other: Touching | None, rng: np.random.Generator
) -> Touching:
    """Draw a contact that begins at a time [s]; links take turns, so that all are touched as often."""
    family, arm = scenario("localization"), model()
    chosen, pair, hand = family["contact"], family["pair"], scenario("contacts")["hand"]
    radius = sensing_of("nominal", 0).hand_radius
    if cell.contacts == 1:
        every = [(k, duration) for k, kind in enumerate(chosen["kind"]) for duration in kind["durations_s"]]
        k, duration = every[int(rng.integers(len(every)))]
        rise, links = chosen["kind"][k]["rise_s"], [chosen["links"][number % len(chosen["links"])]]
    else:
        k, duration, rise, links = 0, float(rng.choice(pair["durations_s"])), pair["rise_s"], pair["links"]
    indices = [arm.link_index(f"{arm.description.name}_{name}") for name in links]
    if other is not None:
        moved = arm.moved_by
        indices = [link for link in indices if (moved[link] != moved[other.link]).any()]
    link = indices[int(rng.integers(len(indices)))]
    point, normal = place_on(link, course.at(at)[0], radius, rng, hand["from_m"])
    inwards = chosen["tilt"] * rng.uniform(-1, 1, 3) - normal
    force = float(rng.choice(chosen["forces_n"]))
    return Touching(link, k, force, rise, duration, at, point, normal, inwards / np.linalg.norm(inwards))


def record_touched(cell: TouchedCell, file: Path) -> None:
    """Record one cell's stream, with its contacts: `touch.NAME` for each field of `Touching`, of all hands in turn."""
    course, hands = planned(cell)
    sensing, speed = sensing_of(cell.sensing, cell.seed), profile(PROFILE).task.speed_m_s
    kind = scenario("localization")["arm"]["kind"]
    end = max(hand[-1].end for hand in hands) + _TAIL_S
    what = Alone(
        path_of("rest"), speed, plant_of(kind), sensing, sensing.hand_radius, cell.seed, end,
        start=course.at(0.0)[0], controller=partial(WanderingController, course),
    )  # fmt: skip

    def prepare(plant: Plant) -> Callable[[float], FloatArray]:
        seen, *_ = [Toucher(plant, touches, sensing.hand_radius) for touches in hands]
        return seen.hand

    touches = [touch for hand in hands for touch in hand]
    save_stream(replace(record(what, prepare), truth=described(touches, sensing.hand_radius)), file)
