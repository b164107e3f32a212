"""Worlds: named sets of simulated arms, sensors and delays, of which a seed draws one."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar
from zlib import crc32

import numpy as np
from msgspec import UNSET, Struct, UnsetType, ValidationError, convert

from pretouch.checks import is_number
from pretouch.errors import ParameterError
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.random_skin import Misplacement
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.toml_files import parse_toml
from pretouch.types import FloatArray

FOLDER = Path(__file__).parent / "worlds"
SETS = ("nominal", "realistic", "stress", "hard")
"""Sets that come with the package."""
_STREAM = 51
"""Number of the random stream of worlds; a field has a stream of its own in it."""
_RANGES = ("uniform", "log_uniform", "normal")
_FIELDS = {
    "plant": tuple(field.name for field in fields(PlantParams)),
    "ranging": tuple(field.name for field in fields(RangeFinderParams)),
    "misplaced": ("position_mm", "orientation_deg"),
}
"""Tables of a file, and the fields that each may have."""

Params = TypeVar("Params", PlantParams, RangeFinderParams)


class FieldSpread(Struct, frozen=True, forbid_unknown_fields=True):
    """How one field is drawn, in one of four ways."""

    value: Any = UNSET
    """It has this value."""
    uniform: tuple[float, float] | UnsetType = UNSET
    """Ends of a range."""
    log_uniform: tuple[float, float] | UnsetType = UNSET
    """Ends of a range above 0."""
    normal: tuple[float, float] | UnsetType = UNSET
    """Mean and standard deviation."""
    times: bool = False
    """Whether the number drawn is a factor on the usual value."""
    each: bool = False
    """Whether each joint has a draw of its own."""
    source: str = ""
    standard_error: float | list[float] = 0.0
    """Of what was identified, for who reads the file."""

    def __post_init__(self) -> None:
        if sum(getattr(self, way) is not UNSET for way in ("value", *_RANGES)) != 1:
            raise ValueError(f"give one of value, {', '.join(_RANGES)}")
        if self.way != "value":
            low, high = self.numbers
            if not np.isfinite(self.numbers).all() or (self.way != "normal" and low > high):
                raise ValueError(f"{self.way} is {self.numbers}: give two numbers, the lower first")
            if self.way == "log_uniform" and low <= 0.0:
                raise ValueError(f"log_uniform is {self.numbers}: give two numbers, the lower first and above 0")

    @property
    def way(self) -> str:
        """Name of the way."""
        return next((way for way in _RANGES if getattr(self, way) is not UNSET), "value")

    @property
    def numbers(self) -> Any:
        """The value, the ends of the range, or mean and standard deviation."""
        return getattr(self, self.way)

    def draw(self, field: str, seed: int, count: int) -> FloatArray:
        """Draw `count` numbers for a field, in a range."""
        rng = np.random.default_rng([seed, _STREAM, crc32(field.encode())])
        first, second = self.numbers
        if self.way == "normal":
            return rng.normal(first, second, count)
        if self.way == "log_uniform":
            return np.exp(rng.uniform(math.log(first), math.log(second), count))
        return rng.uniform(first, second, count)


@dataclass(frozen=True)
class WorldSet:
    """A set of worlds."""

    name: str
    about: str
    spreads: dict[str, FieldSpread]
    """By field, as `plant.mass_error`."""
    digest: str
    """SHA-256 of the file."""


@dataclass(frozen=True)
class DrawnWorld:
    """One arm with its sensors: what a seed draws of a set. Delays of state and commands are fields of the plant."""

    plant: PlantParams
    ranging: RangeFinderParams
    misplaced: Misplacement
    """By how much each unit sits elsewhere than the controller believes."""


def with_own(world: Params, own: Params, usual: Params) -> Params:
    """Return parameters of a world, but for those that an experiment has otherwise than is usual: its own stay."""
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
    chosen = WorldSet(name, str(table.pop("about", "")), dict(_spreads(place, table)), sha256(data).hexdigest())
    drawn(chosen, 0)  # what can never be drawn is said before an hour of trials
    return chosen


def _spreads(place: Path, table: dict[str, Any]) -> Iterator[tuple[str, FieldSpread]]:
    """How the fields of a file's tables are drawn."""
    for part, entries in table.items():
        if part not in _FIELDS or not isinstance(entries, dict):
            raise ParameterError(f"{place} has an unknown table {part!r}: use about, {', '.join(_FIELDS)}.")
        for name, entry in entries.items():
            if name not in _FIELDS[part]:
                names = ", ".join(_FIELDS[part])
                raise ParameterError(f"{place} has an unknown field {part}.{name}: choose from {names}.")
            try:
                yield f"{part}.{name}", convert(entry if isinstance(entry, dict) else {"value": entry}, FieldSpread)
            except ValidationError as error:
                raise ParameterError(f"{place}: {part}.{name}: {error}.") from error


def drawn(chosen: WorldSet, seed: int, usual: PlantParams | None = None) -> DrawnWorld:
    """Draw the world of a seed: the same for the same seed, whatever else is drawn.

    `usual` is the arm that factors are of; None: the Panda's. A draw that is no possible arm is a ParameterError.
    """
    plant, ranging = PlantParams() if usual is None else usual, RangeFinderParams()
    values: dict[str, dict[str, Any]] = {"plant": {}, "ranging": {}, "misplaced": {}}
    for field, spread in chosen.spreads.items():
        part, name = field.split(".")
        of = {"plant": plant, "ranging": ranging, "misplaced": None}[part]
        values[part][name] = _value(field, spread, seed, getattr(of, name) if of is not None else 0.0)
    try:
        return DrawnWorld(
            replace(plant, **values["plant"]),
            replace(ranging, **values["ranging"]),
            Misplacement(**values["misplaced"]),
        )
    except ParameterError as error:
        raise ParameterError(f"The world {chosen.name}, seed {seed}: {error}") from error


def _value(field: str, spread: FieldSpread, seed: int, usual: Any) -> Any:
    """Draw a field's value, of the form that its usual one has."""
    if spread.way == "value":
        value = spread.value
        if isinstance(usual, tuple):
            if not isinstance(value, list) or not all(map(is_number, value)):
                raise ParameterError(f"{field} is {value!r}: give a list of numbers, one a joint.")
            return tuple(map(float, value))
        if not isinstance(usual, float | None):
            return value
        if not is_number(value):
            raise ParameterError(f"{field} is {value!r}: give a number.")
        return float(value)
    if usual is None and spread.times:
        raise ParameterError(f"{field} has no usual value that it could be a factor on: leave out times.")
    if isinstance(usual, tuple):
        numbers = np.broadcast_to(spread.draw(field, seed, len(usual) if spread.each else 1), len(usual))
        return tuple(float(n) for n in (numbers * np.array(usual) if spread.times else numbers))
    number = float(spread.draw(field, seed, 1)[0])
    return number * float(usual) if spread.times else number
