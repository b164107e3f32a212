"""A sweep as it is defined: by options, or by a TOML file with one or several of them."""

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, get_args

from pretouch.errors import ExperimentError, PretouchError
from pretouch.params import profile
from pretouch_lab.benchmarks.scenario_files import SeedRange
from pretouch_lab.sweep.measures import Measure
from pretouch_lab.sweep.registry import MEASURES, measure
from pretouch_lab.sweep.setting import Setting, Values, built, current
from pretouch_lab.sweep.space import Dimension, dimension, read_value

Design = Literal["grid", "lhs", "sobol"]
SENSITIVITY = "sensitivity"
"""The sweeps of docs/explanation/sensitivity.md."""
_SEED_RANGES: dict[SeedRange, tuple[int, int]] = {"published": (0, 999), "development": (1000, 1999)}
_KEYS = ("name", "experiment", "profile", "design", "samples", "arms", "metrics", "ranks", "vary", "fix", "text")


@dataclass(frozen=True)
class Sweep:
    """One sweep, checked."""

    name: str
    """Of its folder."""
    experiment: str
    profile: str
    """As `pretouch.params.profile` reads it."""
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


def sweep_of(
    experiment: str, vary: Mapping[str, str], *, fix: Mapping[str, str] | None = None, profile_text: str = "",
    design: str = "sobol", samples: int = 64, arms: int = 16, metrics: tuple[str, ...] = (), name: str = "",
    seeds: SeedRange = "development", text: str = "", ranks: tuple[str, ...] = (),
) -> Sweep:  # fmt: skip
    """Read and check a sweep whose ranges are given as text. Raises an error of this package."""
    what = measure(experiment)
    base_text = profile_text or what.profile
    base = profile(base_text)
    if design not in get_args(Design):
        raise ExperimentError(f"The design {design!r} is unknown: choose from {', '.join(get_args(Design))}.")
    if not vary:
        raise ExperimentError("Nothing is varied: give --vary NAME=LOW:HIGH, threshold.f_base_n=5:15 for one.")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name or experiment):
        raise ExperimentError(f"The name {name!r} would be a bad one for a folder: use letters, digits and dashes.")
    for one in (*vary, *(fix or {})):
        current(one, base, what.scene)
        what.check(one)
    both = [one for one in vary if one in (fix or {})]
    if both:
        raise ExperimentError(f"The parameter {both[0]} is both varied and fixed: do one of them.")
    dimensions = tuple(dimension(one, text, current(one, base, what.scene)) for one, text in vary.items())
    fixed = {one: read_value(one, text, current(one, base, what.scene)) for one, text in (fix or {}).items()}
    unknown = [one for one in (*metrics, *ranks) if one not in what.metrics]
    if unknown:
        raise ExperimentError(f"{experiment} does not measure {unknown[0]!r}: choose from {', '.join(what.metrics)}.")
    if samples < 2 or (design == "sobol" and samples & (samples - 1)):
        least = 1 << max(1, samples.bit_length())
        kind = "a power of two" if design == "sobol" else "2 or more"
        raise ExperimentError(f"The number of samples is {samples}: give {kind}, {least} for one.")
    low, high = _SEED_RANGES[seeds]
    if not 1 <= arms <= high - low + 1:
        raise ExperimentError(f"The number of arms is {arms}: give 1 to {high - low + 1}.")
    chosen = metrics or tuple(what.metrics)
    found = Sweep(
        name or experiment, experiment, base_text, dimensions, fixed, design, samples, arms, chosen, seeds, text,  # type: ignore[arg-type]
        ranks,
    )  # fmt: skip
    _check_ends(found)
    return found


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
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        known = ", ".join([*MEASURES, SENSITIVITY])
        raise ExperimentError(
            f"The sweep {path} is neither an experiment nor a file that can be read ({error.strerror}): choose from"
            f" {known}, or give a TOML file."
        ) from error
    except (ValueError, RecursionError) as error:
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
    unknown = sorted(set(entry) - set(_KEYS))
    if unknown:
        raise ExperimentError(f"The {where} has the unknown key {unknown[0]}: use {', '.join(_KEYS)}.")
    texts = {key: entry.get(key, "") for key in ("name", "experiment", "profile", "design", "text")}
    counts = {key: entry[key] for key in ("samples", "arms") if key in entry}
    tables = {key: entry.get(key, {}) for key in ("vary", "fix")}
    listed = {key: entry.get(key, []) for key in ("metrics", "ranks")}
    for kind, what, given in ((str, "text", texts), (int, "a whole number", counts), (dict, "a table", tables)):
        for key, value in given.items():
            if not isinstance(value, kind) or isinstance(value, bool):
                raise ExperimentError(f"The {where} has {key} = {value!r}: give {what}.")
    for key, names in listed.items():
        if not isinstance(names, list) or not all(isinstance(one, str) for one in names):
            raise ExperimentError(f"The {where} has {key} = {names!r}: give a list of names.")
    for key, table in tables.items():
        for name, value in table.items():
            if not isinstance(value, str):
                raise ExperimentError(f'The {where} has {key} {name} = {value!r}: give text, "5:15" or "yes".')
    try:
        return sweep_of(
            texts["experiment"], tables["vary"], fix=tables["fix"], profile_text=texts["profile"],
            design=texts["design"] or "sobol", metrics=tuple(listed["metrics"]), name=texts["name"], seeds=seeds,
            text=texts["text"], ranks=tuple(listed["ranks"]), **counts,
        )  # fmt: skip
    except PretouchError as error:
        raise ExperimentError(f"{error} (in {where})") from error


def sensitivity(seeds: SeedRange) -> list[Sweep]:
    """Return the sweeps of docs/explanation/sensitivity.md."""
    return load_sweeps(Path(str(files("pretouch_lab.sweep") / "sensitivity.toml")), seeds)


def smaller(sweep: Sweep, samples: int) -> Sweep:
    """Return a sweep with at most so many samples, and arms."""
    return replace(sweep, samples=min(samples, sweep.samples), arms=min(samples, sweep.arms))
