"""Worlds: named sets of simulated arms, sensors and delays, of which a seed draws one."""

import math
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar
from zlib import crc32

import numpy as np

from pretouch.checks import is_number
from pretouch.errors import ParameterError
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.toml_files import parse_toml

FOLDER = Path(__file__).parent / "worlds"
SETS = ("nominal", "realistic", "stress", "hard")
"""Sets that come with the package."""
_STREAM = 51
"""Number of the random stream of worlds; a field has a stream of its own in it."""
_WAYS = ("value", "uniform", "log_uniform", "normal")
_OTHER = ("times", "each", "source", "standard_error")
_MISPLACED = ("position_mm", "orientation_deg")

Params = TypeVar("Params", PlantParams, RangeFinderParams)


@dataclass(frozen=True)
class Spread:
    """How one field is drawn."""

    field: str
    """As `plant.mass_error`."""
    way: str
    """value, uniform, log_uniform or normal."""
    numbers: Any
    """The value, the ends of the range, or mean and standard deviation."""
    times: bool
    """Whether the number drawn is a factor on the usual value."""
    each: bool
    """Whether each joint has a draw of its own."""
    source: str

    def draw(self, seed: int, count: int) -> Any:
        """Draw `count` numbers; a fixed value is returned as it is."""
        if self.way == "value":
            return self.numbers
        rng = np.random.default_rng([seed, _STREAM, crc32(self.field.encode())])
        first, second = self.numbers
        if self.way == "normal":
            return rng.normal(first, second, count)
        if self.way == "log_uniform":
            return np.exp(rng.uniform(math.log(first), math.log(second), count))
        return rng.uniform(first, second, count)

    def said(self) -> str:
        """Return the range as a table has it."""
        if self.way == "value":
            return f"{self.numbers}"
        mark = "x " if self.times else ""
        joined = f"{self.numbers[0]:g} +- {self.numbers[1]:g}" if self.way == "normal" else (
            f"{self.numbers[0]:g} to {self.numbers[1]:g}"
        )  # fmt: skip
        return f"{mark}{joined}{', each joint' if self.each else ''}{', log' if self.way == 'log_uniform' else ''}"


@dataclass(frozen=True)
class WorldSet:
    """A set of worlds."""

    name: str
    about: str
    spreads: tuple[Spread, ...]
    digest: str
    """SHA-256 of the file."""


@dataclass(frozen=True)
class World:
    """One arm with its sensors: what a seed draws of a set. Delays of state and commands are fields of the plant."""

    plant: PlantParams
    ranging: RangeFinderParams
    position_mm: float = 0.0
    """By how far each unit sits elsewhere than the controller believes [mm]."""
    orientation_deg: float = 0.0
    """By how much it is turned [deg]."""

    def plant_with(self, own: PlantParams, usual: PlantParams) -> PlantParams:
        """Return this world's plant, but for what an experiment has otherwise than the usual arm: that stays."""
        return _with(self.plant, own, usual)

    def ranging_with(self, own: RangeFinderParams) -> RangeFinderParams:
        """Return this world's range finders, but for what an experiment has otherwise than the usual ones."""
        return _with(self.ranging, own, RangeFinderParams())


def _with(world: Params, own: Params, usual: Params) -> Params:
    names = [f.name for f in fields(own)]
    return replace(world, **{n: getattr(own, n) for n in names if getattr(own, n) != getattr(usual, n)})


def world_set(name: str) -> WorldSet:
    """Read a set by its name, or a file of the same form. ParameterError for what it cannot be, with the way out."""
    place = FOLDER / f"{name}.toml" if name in SETS else Path(name)
    try:
        data = place.read_bytes()
        table = parse_toml(data)
    except OSError as error:
        raise ParameterError(
            f"The world {name!r} is not one of {', '.join(SETS)}, and no file of that name can be read"
            f" ({error.strerror}): choose one of these, or give a TOML file (docs/how-to/sim-to-real.md)."
        ) from error
    except ValueError as error:
        raise ParameterError(f"The world file {place} is not valid TOML ({error}): correct it.") from error
    found = WorldSet(name, str(table.get("about", "")), tuple(_spreads(place, table)), sha256(data).hexdigest())
    drawn(found, 0)  # what can never be drawn is said before an hour of trials
    return found


def _spreads(place: Path, table: dict[str, Any]) -> list[Spread]:
    known = {
        "plant": tuple(f.name for f in fields(PlantParams)),
        "ranging": tuple(f.name for f in fields(RangeFinderParams)),
        "misplaced": _MISPLACED,
    }  # fmt: skip
    found = []
    for part, entries in table.items():
        if part == "about":
            continue
        if part not in known or not isinstance(entries, dict):
            raise ParameterError(f"{place} has an unknown table {part!r}: use about, {', '.join(known)}.")
        for name, entry in entries.items():
            if name not in known[part]:
                raise ParameterError(
                    f"{place} has an unknown field {part}.{name}: choose from {', '.join(known[part])}."
                )
            found.append(_spread(place, f"{part}.{name}", entry))
    return found


def _spread(place: Path, field: str, entry: Any) -> Spread:
    if not isinstance(entry, dict):
        entry = {"value": entry}
    ways = [way for way in _WAYS if way in entry]
    unknown = [key for key in entry if key not in (*_WAYS, *_OTHER)]
    if len(ways) != 1 or unknown:
        raise ParameterError(
            f"{place}: {field} says {', '.join(entry) or 'nothing'}: give one of {', '.join(_WAYS)}, and if need be"
            f" {', '.join(_OTHER)}."
        )
    numbers = entry[ways[0]]
    if ways[0] != "value":
        good = isinstance(numbers, list) and len(numbers) == 2 and all(is_number(n) for n in numbers)
        ordered = good and (ways[0] == "normal" or numbers[0] <= numbers[1])
        if not ordered or (ways[0] == "log_uniform" and numbers[0] <= 0.0):
            raise ParameterError(
                f"{place}: {field}.{ways[0]} is {numbers}: give two numbers, the lower first"
                f"{' and above 0' if ways[0] == 'log_uniform' else ''} (of normal, mean and standard deviation)."
            )
    return Spread(
        field, ways[0], numbers, bool(entry.get("times", False)), bool(entry.get("each", False)),
        str(entry.get("source", "")),
    )  # fmt: skip


def drawn(chosen: WorldSet, seed: int, usual: PlantParams | None = None) -> World:
    """Draw the world of a seed: the same for the same seed, whatever else is drawn.

    `usual` is the arm that factors are of; None: the Panda's. A draw that is no possible arm is a ParameterError.
    """
    plant, ranging = PlantParams() if usual is None else usual, RangeFinderParams()
    values: dict[str, dict[str, Any]] = {"plant": {}, "ranging": {}, "misplaced": {}}
    for spread in chosen.spreads:
        part, name = spread.field.split(".")
        of = {"plant": plant, "ranging": ranging, "misplaced": None}[part]
        values[part][name] = _value(spread, seed, getattr(of, name) if of is not None else 0.0)
    try:
        return World(replace(plant, **values["plant"]), replace(ranging, **values["ranging"]), **values["misplaced"])
    except ParameterError as error:
        raise ParameterError(f"The world {chosen.name}, seed {seed}: {error}") from error


def _value(spread: Spread, seed: int, usual: Any) -> Any:
    """Draw a field's value, of the form that its usual one has."""
    if isinstance(usual, tuple):
        if spread.way == "value":
            if not isinstance(spread.numbers, list) or not all(is_number(n) for n in spread.numbers):
                raise ParameterError(f"{spread.field} is {spread.numbers!r}: give a list of numbers, one a joint.")
            return tuple(float(n) for n in spread.numbers)
        numbers = np.broadcast_to(spread.draw(seed, len(usual) if spread.each else 1), len(usual))
        return tuple(float(n) for n in (numbers * np.array(usual) if spread.times else numbers))
    if usual is None and spread.times:
        raise ParameterError(f"{spread.field} has no usual value that it could be a factor on: leave out times.")
    if spread.way == "value":
        if not isinstance(usual, float | None):
            return spread.numbers
        if not is_number(spread.numbers):
            raise ParameterError(f"{spread.field} is {spread.numbers!r}: give a number.")
        return float(spread.numbers)
    number = float(spread.draw(seed, 1)[0])
    return number * float(usual) if spread.times else number
