"""Domain randomisation of a trial: the seed draws an arm and sensors from a set; the experiment's own values stay.

A set, a world file, says of some fields of arm, range finders and places of units how they are drawn.
"""

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from zlib import crc32

import numpy as np
from msgspec import Struct, ValidationError, convert

from pretouch.checks import is_number
from pretouch.errors import ParameterError, SkinError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.toml_files import parse_toml
from pretouch.types import FloatArray


@dataclass(frozen=True)
class Misplacement:
    """Error of each unit's pose in the controller's skin file."""

    position_mm: float = 0.0
    orientation_deg: float = 0.0


def misplaced(skin: Skin, model: RobotModel, error: Misplacement, seed: int) -> Skin:
    """Return what the controller believes of a skin.

    Each unit's position is off in a random direction, its orientation about a random axis, both uniform on the sphere:
    a turn about the beam changes nothing, and the beam itself tilts by 0.79 of the angle on average. Direction and axis
    depend on the seed and the unit, not on the error's size. A pose that `Skin` refuses, inside the unit's own link, is
    drawn again.
    """
    rngs = (np.random.default_rng([seed, 13, k]) for k in range(len(skin.mounted)))
    return Skin([_believed(unit, model, error, rng) for unit, rng in zip(skin.mounted, rngs, strict=True)], model)


def _believed(unit: SensorUnit, model: RobotModel, error: Misplacement, rng: np.random.Generator) -> SensorUnit:
    from scipy.spatial.transform import Rotation  # a fifth of a second, and few skins are misplaced

    T = unit.T_link_sensor.copy()
    while True:
        off, axis = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
        T[:3, 3] = unit.T_link_sensor[:3, 3] + error.position_mm / 1000 * off
        turn = Rotation.from_rotvec(error.orientation_deg * axis, degrees=True)
        T[:3, :3] = unit.T_link_sensor[:3, :3] @ turn.as_matrix()
        believed = replace(unit, T_link_sensor=T)
        with suppress(SkinError):
            Skin([believed], model)
            return believed


FOLDER = Path(__file__).parent / "worlds"
SETS = ("nominal", "realistic", "stress", "hard")
"""Sets that come with the lab."""
_STREAM = 51
"""Number of the random stream of worlds; a field has a stream of its own in it."""
_PARTS = {"plant": PlantParams, "ranging": RangeFinderParams, "misplaced": Misplacement}
"""Tables of a file: what their fields are of."""
_WAYS = ("value", "uniform", "log_uniform")

Params = TypeVar("Params", PlantParams, RangeFinderParams)


class FieldSpread(Struct, frozen=True, forbid_unknown_fields=True):
    """Distribution of one field, in one of three forms."""

    value: Any = None
    """It has this value."""
    uniform: tuple[float, float] | None = None
    """Ends of a range."""
    log_uniform: tuple[float, float] | None = None
    """Ends of a range above 0."""
    times: bool = False
    """True if the number drawn is a factor on the default value."""
    each: bool = False
    """True if each joint has a draw of its own."""
    source: str = ""
    standard_error: float | list[float] = 0.0
    """Standard error of an identified value, for readers of the file."""

    def __post_init__(self) -> None:
        if sum(getattr(self, way) is not None for way in _WAYS) != 1:
            raise ValueError(f"give one of {', '.join(_WAYS)}")
        if self.ends is not None and not (-math.inf < self.ends[0] <= self.ends[1] < math.inf):
            raise ValueError(f"the range is {self.ends}: give two numbers, the lower first")
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise ValueError(f"log_uniform is {self.log_uniform}: give two numbers, the lower first and above 0")

    @property
    def ends(self) -> tuple[float, float] | None:
        """Ends of the range, or None for a value."""
        return self.uniform or self.log_uniform

    def draw(self, field: str, seed: int, count: int) -> FloatArray:
        """Draw `count` numbers for a field, in a range."""
        rng = np.random.default_rng([seed, _STREAM, crc32(field.encode())])
        if self.log_uniform is not None:
            low, high = map(math.log, self.log_uniform)
            return np.exp(rng.uniform(low, high, count))
        return rng.uniform(*(self.uniform or (0.0, 0.0)), count)


class WorldSet(NamedTuple):
    """A set of worlds."""

    name: str
    about: str
    spreads: dict[str, FieldSpread]
    """Distributions by field, as `plant.mass_error`."""
    digest: str
    """SHA-256 of the file."""


class DrawnWorld(NamedTuple):
    """One arm with its sensors: what a seed draws of a set. Delays of state and commands are fields of the plant."""

    plant: PlantParams
    ranging: RangeFinderParams
    misplaced: Misplacement
    """Error of each unit's pose in the controller's skin file."""


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
    """Yield the distribution of each field of a file's tables."""
    for part, entries in table.items():
        if part not in _PARTS or not isinstance(entries, dict):
            raise ParameterError(f"{place} has an unknown table {part!r}: use about, {', '.join(_PARTS)}.")
        names = [field.name for field in fields(_PARTS[part])]
        for name, entry in entries.items():
            if name not in names:
                raise ParameterError(f"{place} has an unknown field {part}.{name}: choose from {', '.join(names)}.")
            try:
                yield f"{part}.{name}", convert(entry if isinstance(entry, dict) else {"value": entry}, FieldSpread)
            except ValidationError as error:
                raise ParameterError(f"{place}: {part}.{name}: {error}.") from error


def drawn(chosen: WorldSet, seed: int, usual: PlantParams | None = None) -> DrawnWorld:
    """Draw the world of a seed: the same for the same seed, whatever else is drawn.

    `usual` is the arm that factors are of; None: the Panda's. A draw that is no possible arm is a ParameterError.
    """
    world = DrawnWorld(usual or PlantParams(), RangeFinderParams(), Misplacement())
    values: dict[str, dict[str, Any]] = {part: {} for part in _PARTS}
    for field, spread in chosen.spreads.items():
        part, name = field.split(".")
        values[part][name] = _value(field, spread, seed, getattr(getattr(world, part), name))
    try:
        return DrawnWorld(*(replace(usual_one, **values[part]) for part, usual_one in world._asdict().items()))
    except ParameterError as error:
        raise ParameterError(f"The world {chosen.name}, seed {seed}: {error}") from error


def _value(field: str, spread: FieldSpread, seed: int, usual: Any) -> Any:
    """Draw a field's value, of the form that its usual one has."""
    value = spread.value
    if spread.ends is None and isinstance(usual, tuple):
        if not isinstance(value, list) or not all(map(is_number, value)):
            raise ParameterError(f"{field} is {value!r}: give a list of numbers, one a joint.")
        return tuple(map(float, value))
    if spread.ends is None:
        if isinstance(usual, float | None) and not is_number(value):
            raise ParameterError(f"{field} is {value!r}: give a number.")
        return float(value) if isinstance(usual, float | None) else value
    if usual is None and spread.times:
        raise ParameterError(f"{field} has no usual value that it could be a factor on: leave out times.")
    if isinstance(usual, tuple):
        numbers = np.broadcast_to(spread.draw(field, seed, len(usual) if spread.each else 1), len(usual))
        return tuple((numbers * np.array(usual) if spread.times else numbers).tolist())
    number = float(spread.draw(field, seed, 1)[0])
    return number * float(usual) if spread.times else number


named_set = cache(world_set)


def folder_part(name: str) -> str:
    """Return the suffix of a folder's name that separates runs with different sets; empty without a set."""
    if not name:
        return ""
    if name in SETS:
        return f"-{name}"
    safe = re.sub(r"[^A-Za-z0-9.]+", "-", name.removesuffix(".toml")).strip("-.")[-40:]
    return f"-{safe}-{sha256(name.encode()).hexdigest()[:6]}"


def sentence(name: str) -> str:
    """Return a sentence that names the set of a run; empty without a set."""
    if not name:
        return ""
    about = named_set(name).about
    return f"Domain randomisation {name}: other arms and sensors than those of the published tables. {about}"
