"""Scenario files, fixed by checksums, and arms and skins by name."""

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
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.types import FloatArray
from pretouch_lab.domain_randomisation import Misplacement, misplaced

FOLDER = Path(str(files("pretouch_lab.bench") / "scenarios"))
CHECKSUMS = "CHECKSUMS"
"""File with a line `DIGEST  NAME` (SHA-256) for each other file, in the format of `sha256sum`."""

SeedRange = Literal["published", "development"]
"""Seeds for the published tables, and seeds to develop detectors with."""


def scenario_path(name: str, folder: Path = FOLDER) -> Path:
    """Return the path of a scenario file after a check of its digest. Raises ExperimentError for a changed file."""
    path, digests = folder / name, checksums(folder)
    if name not in digests:
        raise ExperimentError(f"The scenario file {name} has no checksum: choose from {', '.join(digests)}.")
    try:
        digest = sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ExperimentError(f"The scenario file {path} cannot be read: {error.strerror}: install again.") from error
    if digest != digests[name]:
        raise ExperimentError(
            f"The scenario file {path} was changed, its SHA-256 is {digest[:12]}..., not {digests[name][:12]}...:"
            " scenarios are fixed before detectors are built, so put the file back."
        )
    return path


@cache
def scenario(name: str, folder: Path = FOLDER) -> dict[str, Any]:
    """Read the scenario file `NAME.toml`. Raises ExperimentError for a changed file."""
    return tomllib.loads(scenario_path(f"{name}.toml", folder).read_text(encoding="utf-8"))


def checksums(folder: Path = FOLDER) -> dict[str, str]:
    """Return the SHA-256 digest of each scenario file by name."""
    try:
        lines = (folder / CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise ExperimentError(f"The checksums in {folder} cannot be read: {error.strerror}: install again.") from error
    pairs = [line.split() for line in lines if line.strip()]
    return {name: digest for digest, name in pairs}


def numbered(
    family: dict[str, Any], entries: list[dict[str, Any]], seeds: SeedRange, quick: bool
) -> Iterator[tuple[dict[str, Any], int]]:
    """Yield each entry of a family for each of its trials, with a seed.

    The n-th trial of the full run has the n-th seed, in a quick run too.
    """
    every = [(entry, i) for entry in entries for i in range(entry["full"])]
    for number, (entry, i) in enumerate(every):
        if i < entry["quick"] or not quick:
            yield entry, seed_of(family, seeds, number)


def seed_of(family: dict[str, Any], seeds: SeedRange, number: int) -> int:
    """Return the seed of trial `number` (from 0) of a family in a range of seeds."""
    first, last = family["seeds"][seeds]
    if not 0 <= number <= last - first:
        raise ExperimentError(
            f"There is no seed number {number} in the {seeds} ones, {first} to {last}: play fewer trials."
        )
    return int(first) + number


@dataclass(frozen=True)
class Sensing:
    """A skin of a scenario file with its errors."""

    skin: Skin
    """Units at their true places."""
    believed: Skin
    """Units at the places that the controller assumes."""
    ranging: RangeFinderParams
    hand_radius: float
    """Radius of the person's visible hand [m]."""


@dataclass(frozen=True)
class ArmCell:
    """One kind of arm of the detection benchmark, its motion and its contacts; a seed draws an arm of it."""

    family: str
    """free, contacts or hard: the scenario file."""
    kind: str = "nominal"
    """Name in `arms.toml`."""
    sensing: str = "nominal"
    """Name in `sensing.toml`."""
    path: str = "circle"
    """circle, line or rest; in the family hard a motion of its file."""
    speed_m_s: float = 0.0
    near: str = "nothing"
    """nothing, standing or passing; touched: a hand touches the arm again and again."""
    counted_s: float = 0.0
    """Time after the warm-up in which alarms count [s]."""
    count: int = 0
    """Number of contacts."""
    ablated: bool = False
    """True if ablations replay it."""
    world: str = ""
    """Set of the domain randomisation that the seed draws from; empty: none."""


@cache
def model() -> RobotModel:
    """Return the arm of all scenarios, one for each process."""
    return RobotModel(panda())


def plant_of(kind: str) -> PlantParams:
    """Return the plant of a kind of arm in `arms.toml`."""
    return replace(PlantParams(), **scenario("arms")[kind])


def sensing_of(name: str, seed: int, skin: Skin | None = None) -> Sensing:
    """Return the named skin of `sensing.toml`, or `skin` with its errors; the seed draws misplacements of units."""
    values: dict[str, Any] = dict(scenario("sensing")[name])
    kind, radius = values.pop("skin"), values.pop("hand_radius")
    error = Misplacement(values.pop("position_mm", 0.0), values.pop("orientation_deg", 0.0))
    units = skin or (paper_skin(model()) if kind == "seven" else load_skin(scenario_path("dense_skin.toml"), model()))
    believed = units if error == Misplacement() else misplaced(units, model(), error, seed)
    return Sensing(units, believed, RangeFinderParams(**values), radius)


def path_of(name: str) -> TaskPath:
    """Return a path by name: circle, line (to and fro), or rest."""
    if name == "line":
        return WayPoints(np.array([[0.4, 0.5, 0.5], [0.4, -0.5, 0.5]]), closed=True)
    return Circle() if name == "circle" else held(Circle().point(0.0))


def held(at: FloatArray) -> TaskPath:
    """Return the path of an arm that holds a place (3,) [m]: a millimetre, as a path needs a length."""
    return WayPoints(np.array([at, np.add(at, (0.0, 0.0, 0.001))]))
