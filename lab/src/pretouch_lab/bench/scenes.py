"""Scenario files: what is played, fixed with checksums before any detector was built; arms and skins by their names."""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pretouch.control.path import Circle, WayPoints
from pretouch.control.path import Path as TaskPath
from pretouch.errors import ExperimentError
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, load_skin, paper_skin
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.random_skin import Misplacement, misplaced
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.types import FloatArray

FOLDER = Path(str(files("pretouch_lab.bench") / "scenarios"))
CHECKSUMS = "CHECKSUMS"
"""File in the folder with a line `DIGEST  NAME` (SHA-256) for each of the others, as `sha256sum` writes it."""

SeedRange = Literal["published", "development"]
"""Seeds for the published tables, and others to develop detectors with."""


def scenario_path(name: str, folder: Path = FOLDER) -> Path:
    """Return where a scenario file is, once it is found to be as it was fixed; an ExperimentError if it is not."""
    path, known = folder / name, checksums(folder)
    if name not in known:
        raise ExperimentError(f"The scenario file {name} has no checksum: choose from {', '.join(known)}.")
    try:
        digest = sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ExperimentError(f"The scenario file {path} cannot be read: {error.strerror}: install again.") from error
    if digest != known[name]:
        raise ExperimentError(
            f"The scenario file {path} was changed, its SHA-256 is {digest[:12]}..., not {known[name][:12]}...:"
            " scenarios are fixed before detectors are built, so put the file back."
        )
    return path


@cache
def scenario(name: str, folder: Path = FOLDER) -> dict[str, Any]:
    """Read a scenario file of this name without `.toml`; one that was changed is an ExperimentError."""
    return tomllib.loads(scenario_path(f"{name}.toml", folder).read_text(encoding="utf-8"))


def checksums(folder: Path = FOLDER) -> dict[str, str]:
    """Return the SHA-256 digest of each scenario file by its name."""
    try:
        lines = (folder / CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise ExperimentError(f"The checksums in {folder} cannot be read: {error.strerror}: install again.") from error
    pairs = [line.split() for line in lines if line.strip()]
    return {name: digest for digest, name in pairs}


def numbered(
    family: dict[str, Any], entries: list[dict[str, Any]], seeds: SeedRange, quick: bool
) -> Iterator[tuple[dict[str, Any], int]]:
    """Give each entry of a family as often as it is played, each time with a seed of its own.

    The n-th of the full run has the n-th seed, in a quick run too.
    """
    every = [(entry, i) for entry in entries for i in range(entry["full"])]
    for number, (entry, i) in enumerate(every):
        if i < entry["quick"] or not quick:
            yield entry, seed_of(family, seeds, number)


def seed_of(family: dict[str, Any], seeds: SeedRange, number: int) -> int:
    """Return the seed of a family's cell number `number` (from 0) in a range of seeds."""
    first, last = family["seeds"][seeds]
    if not 0 <= number <= last - first:
        raise ExperimentError(f"There is no seed number {number} in the {seeds} ones, {first} to {last}: take fewer.")
    return int(first) + number


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


@dataclass(frozen=True)
class ArmCell:
    """One kind of arm of the detection benchmark, and what happens to it; a seed makes one of it."""

    family: str
    """free, contacts or hard: the scenario file."""
    kind: str = "nominal"
    """Of `arms.toml`."""
    sensing: str = "nominal"
    """Of `sensing.toml`."""
    path: str = "circle"
    """circle, line or rest; of the family hard a motion of its file."""
    speed_m_s: float = 0.0
    near: str = "nothing"
    """nothing, standing or passing; touched: a hand comes, touches and goes, again and again."""
    counted_s: float = 0.0
    """Time that counts [s], after the warm-up."""
    count: int = 0
    """Contacts."""
    ablated: bool = False
    """Whether ablations are given it."""
    world: str = ""
    """Set of the domain randomisation of which the seed draws one, or none."""


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
    believed = units if error == Misplacement() else misplaced(units, model(), error, seed)[0]
    return Sensing(units, believed, RangeFinderParams(**values), radius)


def path_of(name: str) -> TaskPath:
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
