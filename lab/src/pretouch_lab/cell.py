"""What tells one trial from another, and what all trials of a run share."""

import re
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from pretouch.control.path import Path as TaskPath
from pretouch.profiles import Profile, profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.paper_scenes import Placement
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import SceneSpec
from pretouch_lab.restrictions import mode_of, with_mode
from pretouch_lab.rows import Row
from pretouch_lab.trial import Setup

_OF_THE_PAPER = ("off", "hard", "slack", "floor")
"""Restriction modes of the paper's equations; any other makes a profile what it is."""
NAMES_MODE = re.compile(r":approach(\.rows)?=")
"""How the name of a profile names a mode."""
_SAFE = {"-y": "minus-y", "+y": "plus-y"}


@dataclass(frozen=True)
class Grid:
    """What a run varies: each experiment makes its cells of that part of it which concerns it."""

    profiles: tuple[str, ...]
    restrictions: tuple[str, ...] = ()
    """Restriction modes; none: each experiment's own."""
    stiffness: tuple[float, ...] = (25_000.0,)
    """Contact stiffnesses of static objects [N/m]."""

    def controllers(self, restrictions: str) -> list[tuple[str, str]]:
        """Profiles with restriction modes; `restrictions` is the experiment's own.

        Without proximity the mode is `off`; a profile that is named with a mode keeps it, and so does one whose mode
        is not of the paper's equations.
        """
        pairs = []
        for name in self.profiles:
            found = profile(name)
            mode = mode_of(found)
            fixed = found.perception is None or bool(NAMES_MODE.search(name)) or mode not in _OF_THE_PAPER
            modes = (mode,) if fixed else self.restrictions or (restrictions,)
            pairs += [(name, mode) for mode in modes]
        return list(dict.fromkeys(pairs))


@dataclass(frozen=True)
class Cell:
    """One cell of an experiment's table: all its trials differ by their seed only."""

    experiment: str
    profile: str
    where: dict[str, str | float] = field(default_factory=dict)
    """What else tells the cell from the others, in the order of the table."""

    @property
    def name(self) -> str:
        """Name for files: safe characters only. Where two names could become one, a digest tells them apart."""
        parts = [
            f"{value:.12g}" if isinstance(value, float) else _SAFE.get(value, value) for value in self.where.values()
        ]
        exact = "_".join([self.experiment, *parts, self.profile])
        safe = re.sub(r"[^A-Za-z0-9._-]", "-", exact)
        plain = safe == re.sub(r"[:=]", "-", exact)
        return safe if plain else f"{safe}-{sha256(exact.encode()).hexdigest()[:8]}"

    def row(self, seed: int) -> Row:
        """Begin the row of results of a trial: what tells it from all others."""
        return {"experiment": self.experiment, **self.where, "profile": self.profile, "seed": seed}


@dataclass(frozen=True)
class Context:
    """What all trials of a run share."""

    model: RobotModel
    skin: Skin
    placement: Placement = field(default_factory=Placement)
    """Where the paper's paths and places are for this arm."""
    world: str = ""
    """Set of the domain randomisation of which each trial's seed draws its own, or none."""
    recording: Path | None = None
    """File to record the trial in, if it is to be recorded."""
    plant: PlantParams | None = None
    """How far the arm is from its model; none, and as far as real arms are (`plant_params_of`)."""
    ranging: RangeFinderParams = field(default_factory=RangeFinderParams)
    """How the skin's units err."""

    @property
    def arm(self) -> PlantParams:
        """How far the arm is from its model."""
        return self.plant or plant_params_of(self.model.description)

    def profile(self, cell: Cell) -> Profile:
        """Return a cell's profile with the restriction mode of the cell, if it names one, as this run has it."""
        found = profile(cell.profile)
        if "restrictions" in cell.where:
            found = with_mode(found, str(cell.where["restrictions"]))
        return found

    def setup(self, cell: Cell, seed: int, scene: SceneSpec, path: TaskPath, **other: Any) -> Setup:
        """Return what a trial of a cell is made of; `other` are further fields of `Setup`, or other values of them."""
        usual = Setup(
            self.model, self.skin, self.profile(cell), scene, path, seed, plant=self.arm, ranging=self.ranging,
            recording=self.recording, world=self.world,
        )  # fmt: skip
        return replace(usual, **other)
