"""A sweep as it is defined: by options, or by a TOML file with one or several of them."""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, cast, get_args

from pretouch.errors import ExperimentError, PretouchError
from pretouch.profiles import profile
from pretouch.toml_files import read_toml
from pretouch_lab.benchmarks.scenario_files import SeedRange
from pretouch_lab.sweep.measures import Measure
from pretouch_lab.sweep.registry import MEASURES, measure
from pretouch_lab.sweep.setting import Setting, Values, built, current
from pretouch_lab.sweep.space import Dimension, dimension, read_value

Design = Literal["grid", "lhs", "sobol"]
SENSITIVITY = "sensitivity"
"""The sweeps of docs/explanation/sensitivity.md."""
_SEED_RANGES: dict[SeedRange, tuple[int, int]] = {"published": (0, 999), "development": (1000, 1999)}


@dataclass(frozen=True)
class Asked:
    """A sweep as text has it: options of the command, or a [[sweep]] of a file, whose keys these are."""

    experiment: str
    vary: Mapping[str, str]
    """Range of each parameter that is varied, as `space.dimension` reads it."""
    fix: Mapping[str, str] = field(default_factory=dict)
    """Value of each one that is something else throughout."""
    profile: str = ""
    """None: the experiment's own."""
    design: str = "sobol"
    samples: int = 64
    arms: int = 16
    metrics: tuple[str, ...] = ()
    """None: all."""
    ranks: tuple[str, ...] = ()
    name: str = ""
    """None: the experiment's."""
    text: str = ""


@dataclass(frozen=True)
class Sweep:
    """One sweep, checked."""

    name: str
    """Of its folder."""
    experiment: str
    profile: str
    """As `pretouch.profiles.profile` reads it."""
    vary: tuple[Dimension, ...]
    fixed: Values
    design: Design
    samples: int
    """Points of a Latin hypercube, or base points of the Sobol sequence; a grid has its levels."""
    arms: int
    """Simulated arms; each seed is another one."""
    metrics: tuple[str, ...]
    """What figures and tables show; everything measured is kept."""
    seeds: SeedRange = "development"
    text: str = ""
    """What it is about, for the document."""
    ranks: tuple[str, ...] = ()
    """Metrics of which Sobol indices are of the ranks: of numbers of which few are very large, the variance is that of
    those few."""

    @property
    def measure(self) -> Measure:
        """The experiment."""
        return measure(self.experiment)

    @property
    def arm_seeds(self) -> range:
        """Seeds of the arms."""
        first = _SEED_RANGES[self.seeds][0]
        return range(first, first + self.arms)

    def setting(self, values: Values, seed: int) -> Setting:
        """Make a cell's setting of the values of what is swept."""
        return built(self.profile, self.measure.scene, self.fixed | values, seed)

    def described(self) -> dict[str, Any]:
        """Return the definition as JSON can hold it."""
        found: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return found


def sweep_of(asked: Asked, seeds: SeedRange = "development") -> Sweep:
    """Read and check a sweep whose ranges are given as text. Raises an error of this package."""
    what, vary, fix = measure(asked.experiment), asked.vary, asked.fix
    base_text, name = asked.profile or what.profile, asked.name or asked.experiment
    base = profile(base_text)
    if asked.design not in get_args(Design):
        raise ExperimentError(f"The design {asked.design!r} is unknown: choose from {', '.join(get_args(Design))}.")
    if not vary:
        raise ExperimentError("Nothing is varied: give --vary NAME=LOW:HIGH, detect.f_base_n=5:15 for one.")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name):
        raise ExperimentError(f"The name {name!r} would be a bad one for a folder: use letters, digits and dashes.")
    for one in (*vary, *fix):
        current(one, base, what.scene)
        what.check(one)
    both = [one for one in vary if one in fix]
    if both:
        raise ExperimentError(f"The parameter {both[0]} is both varied and fixed: do one of them.")
    dimensions = tuple(dimension(one, text, current(one, base, what.scene)) for one, text in vary.items())
    fixed = {one: read_value(one, text, current(one, base, what.scene)) for one, text in fix.items()}
    unknown = [one for one in (*asked.metrics, *asked.ranks) if one not in what.metrics]
    if unknown:
        known = ", ".join(what.metrics)
        raise ExperimentError(f"{asked.experiment} does not measure {unknown[0]!r}: choose from {known}.")
    _check_counts(asked, seeds)
    found = Sweep(
        name, asked.experiment, base_text, dimensions, fixed, cast(Design, asked.design), asked.samples, asked.arms,
        asked.metrics or tuple(what.metrics), seeds, asked.text, asked.ranks,
    )  # fmt: skip
    _check_ends(found)
    return found


def _check_counts(asked: Asked, seeds: SeedRange) -> None:
    """Refuse a number of samples or arms that there cannot be."""
    samples, sobol = asked.samples, asked.design == "sobol"
    if samples < 2 or (sobol and samples & (samples - 1)):
        least = 1 << max(1, samples.bit_length())
        kind = "a power of two" if sobol else "2 or more"
        raise ExperimentError(f"The number of samples is {samples}: give {kind}, {least} for one.")
    low, high = _SEED_RANGES[seeds]
    if not 1 <= asked.arms <= high - low + 1:
        raise ExperimentError(f"The number of arms is {asked.arms}: give 1 to {high - low + 1}.")


def _check_ends(sweep: Sweep) -> None:
    """Refuse what none of its values, or one end alone, is allowed to be."""
    for one in sweep.vary:
        for value in one.ends:
            try:
                sweep.setting({one.name: value}, 0)
            except PretouchError as error:
                raise ExperimentError(
                    f"The range of {one.name} holds {value}, which is not allowed: {error}"
                ) from error


def load_sweeps(path: Path, seeds: SeedRange = "development") -> list[Sweep]:
    """Read a file of sweeps: one [[sweep]] each. Raises an error of this package that names the file and the sweep."""
    try:
        data = read_toml(path)
    except OSError as error:
        known = ", ".join([*MEASURES, SENSITIVITY])
        raise ExperimentError(
            f"The sweep {path} is neither an experiment nor a file that can be read ({error.strerror}): choose from"
            f" {known}, or give a TOML file."
        ) from error
    except ValueError as error:
        raise ExperimentError(f"The sweep file {path} is not valid TOML: {error}.") from error
    entries = data.get("sweep")
    if set(data) != {"sweep"} or not isinstance(entries, list) or not entries:
        raise ExperimentError(f"The sweep file {path} has no [[sweep]]: give at least one, with experiment and vary.")
    found = [_from(entry, number, path, seeds) for number, entry in enumerate(entries, 1)]
    names = [sweep.name for sweep in found]
    if len(set(names)) < len(names):
        raise ExperimentError(f"Two sweeps of {path} have the same name: give each [[sweep]] its own name.")
    return found


def _from(entry: Any, number: int, path: Path, seeds: SeedRange) -> Sweep:
    where = f"sweep {number} of {path}"
    if not isinstance(entry, dict):
        raise ExperimentError(f"The {where} is {entry!r}: write it as a [[sweep]] table.")
    keys = [key.name for key in fields(Asked)]
    unknown = sorted(set(entry) - set(keys))
    if unknown:
        raise ExperimentError(f"The {where} has the unknown key {unknown[0]}: use {', '.join(keys)}.")
    for key, given in entry.items():
        kind, what = _TOLD.get(key, (str, "text"))
        if not isinstance(given, kind) or isinstance(given, bool):
            raise ExperimentError(f"The {where} has {key} = {given!r}: give {what}.")
        if isinstance(given, list) and not all(isinstance(one, str) for one in given):
            raise ExperimentError(f"The {where} has {key} = {given!r}: give {what}.")
        for name, value in given.items() if isinstance(given, dict) else ():
            if not isinstance(value, str):
                raise ExperimentError(f'The {where} has {key} {name} = {value!r}: give text, "5:15" or "yes".')
    settings: dict[str, Any] = {"experiment": "", "vary": {}}
    settings |= {key: tuple(given) if isinstance(given, list) else given for key, given in entry.items() if given != ""}
    try:
        return sweep_of(Asked(**settings), seeds)
    except PretouchError as error:
        raise ExperimentError(f"{error} (in {where})") from error


_TOLD: dict[str, tuple[type, str]] = {
    "samples": (int, "a whole number"), "arms": (int, "a whole number"), "vary": (dict, "a table"),
    "fix": (dict, "a table"), "metrics": (list, "a list of names"), "ranks": (list, "a list of names"),
}  # fmt: skip
"""What a key is parsed as, where it is not text."""


def sensitivity(seeds: SeedRange) -> list[Sweep]:
    """Return the sweeps of docs/explanation/sensitivity.md."""
    return load_sweeps(Path(str(files("pretouch_lab.sweep") / "sensitivity.toml")), seeds)


def smaller(sweep: Sweep, samples: int) -> Sweep:
    """Return a sweep with at most so many samples, and arms."""
    return replace(sweep, samples=min(samples, sweep.samples), arms=min(samples, sweep.arms))
