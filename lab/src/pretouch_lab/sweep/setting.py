"""What one cell of a sweep is played with, made of a base profile and the values of the parameters that are swept.

A parameter has a name with a dot: `GROUP.FIELD` of the profile, `plant.FIELD` of the simulated arm, `plant.kind` for a
named one, `plant.world` for the arm and range finders that the seed draws of a set of the domain randomisation,
`sensing.FIELD` of the range finders, `skin.units` for so many units spread over the arm, and `scene.FIELD` of what the
experiment plays.
"""

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
from pretouch_lab.benchmarks.dense_skin import spread_skin
from pretouch_lab.benchmarks.detection.arm import model, plant_of
from pretouch_lab.benchmarks.scenario_files import scenario

Value = float | int | str | bool
Values = dict[str, Value]
"""Values of parameters by their names."""

UNITS, KIND, WORLD = "skin.units", "plant.kind", "plant.world"
USUAL_WORLD = "none"
"""In place of the name of a world where none is drawn."""
LARGEST_UNITS = 64


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
