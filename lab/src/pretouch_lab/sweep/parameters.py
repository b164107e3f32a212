"""What one cell of a sweep is played with: a base profile, the values of swept parameters, and their ranges.

A parameter has a name with a dot: `GROUP.FIELD` of the profile, `plant.FIELD` of the simulated arm, `plant.kind` for a
named one, `plant.world` for the arm and range finders that the seed draws of a set of the domain randomisation,
`sensing.FIELD` of the range finders, `skin.units` for so many units spread over the arm, and `scene.FIELD` of what the
experiment plays.
"""

import math
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from numbers import Real
from typing import Any

from pretouch.checks import Checked
from pretouch.composition import Part, at
from pretouch.errors import ExperimentError, ParameterError
from pretouch.profiles import Profile, profile
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.randomisation import WorldSet, drawn, with_own, world_set
from pretouch.sim.range_finder import RangeFinderParams
from pretouch_lab.bench.dense_skin import spread_skin
from pretouch_lab.bench.scenes import model, plant_of, scenario

Value = float | int | str | bool
Values = dict[str, Value]
"""Values of parameters by their names."""

UNITS, KIND, WORLD = "skin.units", "plant.kind", "plant.world"
USUAL_WORLD = "none"
"""In place of the name of a world where none is drawn."""
LARGEST_UNITS = 64
_HOW = "write NAME=LOW:HIGH, NAME=LOW:HIGH:log, NAME=LOW:HIGH:LEVELS for a grid, or NAME=VALUE,VALUE,..."
_LEVELS = 5
_WORDS = {"yes": True, "true": True, "no": False, "false": False}


@dataclass(frozen=True)
class Setting:
    """One cell's parameters."""

    profile_text: str
    """As `pretouch.profiles.profile` reads it."""
    plant: PlantParams
    sensing: RangeFinderParams
    units: int
    """Units spread over the arm; 0: the seven of the paper's experiment."""
    scene: Checked
    """What the experiment plays."""
    seed: int

    @property
    def profile(self) -> Profile:
        """Return the controller's parameters."""
        return profile(self.profile_text)

    @property
    def skin(self) -> Skin:
        """Return the units on the arm."""
        return skin_of(self.units)

    @property
    def world(self) -> str:
        """All but the controller's parameters, as text: what a recorded stream depends on."""
        return repr((self.plant, self.sensing, self.units, self.scene, self.seed))


@cache
def skin_of(units: int) -> Skin:
    """Return so many units spread over the Panda, or the paper's seven for 0; made once in each process."""
    return spread_skin(model(), units) if units else paper_skin(model())


def plants() -> tuple[str, ...]:
    """Names of the kinds of simulated arms; `scenarios/arms.toml` has what is different of each."""
    return tuple(scenario("arms"))


def current(name: str, base: Profile, scene: Checked) -> Value:
    """Return a parameter's value where nothing changes it; an ExperimentError for a parameter there is not."""
    group, _, field = name.partition(".")
    if name == UNITS:
        return 0
    if name == KIND:
        return "nominal"
    if name == WORLD:
        return USUAL_WORLD
    groups: dict[str, Any] = {"plant": PlantParams(), "sensing": RangeFinderParams(), "scene": scene}
    if group not in groups:
        value = _of_profile(name, base, (*groups, "skin"))
    elif not hasattr(groups[group], field):
        known = [f.name for f in fields(groups[group])] + (["kind", "world"] if group == "plant" else [])
        raise ExperimentError(f"The parameter {name!r} is unknown: {group} has {', '.join(known)}.")
    else:
        value = getattr(groups[group], field)
    if not isinstance(value, Real | str):
        held = "no usual value" if value is None else "one value a joint"
        raise ExperimentError(f"The parameter {name} holds {held}: sweep one that holds a single value.")
    return value  # type: ignore[return-value]  # a bool is a Real


def _of_profile(name: str, base: Profile, others: tuple[str, ...]) -> object:
    try:
        value = at(base, name)
    except ParameterError as error:
        also = f"Beside those of the profile there are parameters of {', '.join(others)}."
        raise ExperimentError(f"{error} {also}") from error
    if is_dataclass(value) or value is None:  # a part, or a group that can be left out
        return value.name if isinstance(value, Part) else "none" if value is None else "on"
    return value


def built(profile_text: str, scene: Checked, values: Values, seed: int) -> Setting:
    """Make a cell's setting; a value that is not allowed is an error of this package that says so."""
    parts: dict[str, dict[str, Any]] = {"plant": {}, "sensing": {}, "scene": {}}
    text, units, kind, world = profile_text, 0, "nominal", USUAL_WORLD
    for name, value in values.items():
        group, _, field = name.partition(".")
        if name == UNITS:
            units = _counted(value)
        elif name == KIND:
            kind = str(value)
        elif name == WORLD:
            world = str(value)
        elif group in parts:
            parts[group][field] = value
        else:
            text += f":{name}={_written(value)}"
    if kind not in plants():
        raise ExperimentError(f"The arm plant.kind={kind} is unknown: choose from {', '.join(plants())}.")
    profile(text)  # refuses what is not allowed
    plant, ranging = plant_of(kind), RangeFinderParams()
    if world != USUAL_WORLD:
        drawn_world = drawn(_set(world), seed, PlantParams())
        plant, ranging = with_own(drawn_world.plant, plant, PlantParams()), drawn_world.ranging
    return Setting(
        text, replace(plant, **parts["plant"]), replace(ranging, **parts["sensing"]), units,
        replace(scene, **parts["scene"]), seed,  # type: ignore[type-var]
    )  # fmt: skip


@cache
def _set(name: str) -> WorldSet:
    return world_set(name)


def world_digest(values: Values) -> str | None:
    """Digest of the set of domain randomisation that values name, which decides what a cell is; None of none."""
    world = str(values.get(WORLD, USUAL_WORLD))
    return None if world == USUAL_WORLD else _set(world).digest


def _counted(value: Value) -> int:
    if not isinstance(value, int) or not 0 <= value <= LARGEST_UNITS:
        raise ExperimentError(f"{UNITS} is {value!r}: give a whole number to {LARGEST_UNITS}, 0 for the paper's seven.")
    return value


def _written(value: Value) -> str:
    """Write a value so that `profile` reads the very same."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return repr(value) if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Dimension:
    """One swept parameter: a range of numbers, or some values to choose from."""

    name: str
    low: float = 0.0
    high: float = 1.0
    log: bool = False
    """Whether it is spread evenly by its logarithm."""
    whole: bool = False
    """Whether it holds whole numbers."""
    levels: int = _LEVELS
    """Values of a range that a grid takes."""
    choices: tuple[Value, ...] = ()
    """Values to choose from, in place of a range."""

    def at(self, part: float) -> Value:
        """Return the value at a part of the range, from 0 to 1; each choice and each whole number has as much of it."""
        if self.choices:
            return self.choices[min(int(part * len(self.choices)), len(self.choices) - 1)]
        if not self.whole:
            return self._between(part, self.low, self.high)
        low, high = (self.low - 0.5, self.high + 0.5) if not self.log else (self.low, self.high)
        return int(min(max(round(self._between(part, low, high)), self.low), self.high))

    def _between(self, part: float, low: float, high: float) -> float:
        if part <= 0.0:
            return low  # exact, as the end is
        if part >= 1.0:
            return high
        return low * (high / low) ** part if self.log else low + part * (high - low)

    def grid(self) -> list[Value]:
        """Return the values that a grid takes, both ends among them."""
        if self.choices:
            return list(self.choices)
        parts = [i / (self.levels - 1) for i in range(self.levels)]
        values = [self._between(part, self.low, self.high) for part in parts]
        return list(dict.fromkeys(round(v) for v in values)) if self.whole else list(values)

    @property
    def ends(self) -> list[Value]:
        """Values to try first, whether they are allowed: the ends of a range, or all choices."""
        return list(self.choices) or [self.at(0.0), self.at(1.0)]

    @property
    def written(self) -> str:
        """The range, for tables."""
        if self.choices:
            return ", ".join(map(str, self.choices))
        return f"{self.low:g} to {self.high:g}{', log' if self.log else ''}"


def dimension(name: str, text: str, now: Value) -> Dimension:
    """Read what a parameter, which holds `now` otherwise, is to be varied over. Raises ExperimentError."""
    said = f"The range {name}={text}"
    if not text.strip():
        raise ExperimentError(f"{said} is empty: {_HOW}.")
    if ":" not in text:
        words = [word.strip() for word in text.split(",")]
        choices = tuple(read_value(name, word, now) for word in words)
        if len(set(choices)) < len(choices):
            raise ExperimentError(f"{said} names a value twice: name each once.")
        return Dimension(name, choices=choices)
    whole = isinstance(now, int) and not isinstance(now, bool)
    if isinstance(now, str | bool):
        raise ExperimentError(f"{said} is not one of numbers: {name} is {now!r}, so write NAME=VALUE,VALUE.")
    low_text, high_text, *more = text.split(":")
    low, high = (float(read_value(name, part, now)) for part in (low_text, high_text))
    log, levels = False, _LEVELS
    for word in more:
        if word == "log":
            log = True
        elif word == "int" and not whole:
            raise ExperimentError(f"{said} is of whole numbers, and {name} is none: leave :int out.")
        elif word.isdigit() and int(word) >= 2:
            levels = int(word)
        elif word != "int":
            raise ExperimentError(f"{said} ends in {word!r}: {_HOW}.")
    if not low < high:
        raise ExperimentError(f"{said} goes from {low:g} to {high:g}: give the lower one first.")
    if log and low <= 0.0:
        raise ExperimentError(f"{said} is logarithmic and begins at {low:g}: begin above 0, or leave :log out.")
    return Dimension(name, low, high, log, whole, levels)


def read_value(name: str, text: str, now: Value) -> Value:
    """Read a value of the kind a parameter holds."""
    text = text.strip()
    if isinstance(now, bool):
        if text not in _WORDS:
            raise ExperimentError(f"{name} is {text!r}: write yes or no.")
        return _WORDS[text]
    if isinstance(now, str):
        return text
    try:
        value = int(text) if isinstance(now, int) else float(text)
        finite = math.isfinite(value)
    except (ValueError, OverflowError):
        kind = "a whole number" if isinstance(now, int) else "a number"
        raise ExperimentError(f"{name} is {text!r}: write {kind}.") from None
    if not finite:
        raise ExperimentError(f"{name} is {text}: write a finite number.")
    if name == UNITS and value < 1:
        raise ExperimentError(f"{name} is {text}: give 1 or more; without it the paper's seven are taken.")
    return value
