"""Sweeps: influence of parameters on the measures of the paper's experiments, over a grid or by Sobol indices.

Parameters are `GROUP.FIELD` of the profile, `plant.FIELD` of the simulated arm, `plant.kind` for a named arm,
`plant.world` for a set of the domain randomisation that the seed draws arm and range finders from, `sensing.FIELD` of
the range finders, `skin.units` for the number of units spread over the arm, and `scene.FIELD` of the experiment.

A seed is a simulated arm in a scene. A grid plays each combination with the same arms, so that two of its points differ
by their parameters alone (common random numbers). For Sobol indices the arm is a column of the design, `seed`: its
index is the influence of the arm, and no parameter's index contains it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
from matplotlib.figure import Figure

from pretouch.checks import Check, Checked, Positive
from pretouch.composition import at, changed
from pretouch.errors import ExperimentError, PretouchError
from pretouch.extras import Extra
from pretouch.profiles import profile
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.text_table import TextTable
from pretouch_lab.bench.dense_skin import spread_skin
from pretouch_lab.bench.scenes import SeedRange, model, plant_of, scenario
from pretouch_lab.domain_randomisation import drawn, named_set, with_own
from pretouch_lab.experiment import Context, experiment
from pretouch_lab.options import SweepOptions
from pretouch_lab.run import Play, Row
from pretouch_lab.table import Column, rounded, summary, table

Value = float | int | str
Design = Literal["grid", "sobol"]
SWEEP = Extra("sweep", ("SALib",), "setup", "pretouch-lab")
_SEED_RANGES: dict[SeedRange, tuple[int, int]] = {"published": (0, 999), "development": (1000, 1999)}
_DESIGN_SEED, _RESAMPLING_SEED, _RESAMPLES = 20_211_116, 2021, 500
_INDICES = {"first": "S1", "first_95": "S1_conf", "total": "ST", "total_95": "ST_conf"}
"""Indices with 95 % intervals, as SALib names them."""


@dataclass(frozen=True)
class StaticScene(Checked):
    """The board of paper IV-A."""

    trajectory: Literal["circle", "line"] = "circle"
    side: Literal["-y", "+y"] = "-y"
    stiffness_n_per_m: Positive = 25_000.0


@dataclass(frozen=True)
class AvoidanceScene(Checked):
    """The person's hand of paper IV-B."""

    place: Literal["beside", "inside"] = "inside"


@dataclass(frozen=True)
class DynamicScene(Checked):
    """The pushes of paper IV-C, drawn by the seed alone."""


@dataclass(frozen=True)
class UnitCount(Checked):
    """Units of the skin."""

    units: Annotated[int, Check(low=0, high=64)] = 0
    """Number of units spread over the arm; 0: the seven of the paper's experiment."""


@dataclass(frozen=True)
class Swept:
    """Defaults and measures of an experiment in a sweep."""

    profile: str
    """Profile to start from, unless the sweep names another."""
    scene: Checked
    """Default fields of its cells, `scene.FIELD`."""
    metrics: tuple[str, ...]
    """Names of the measures in its rows."""


_TOUCH = ("peak_estimate_n", "true_peak_n", "true_peak_20ms_n", "detection_delay_s", "missed", "false_detections")
_NEAR = ("least_gap_m", "true_peak_n", "deviation_m", "travelled_m", "contact", "false_detections")
EXPERIMENTS = {
    "static": Swept("paper:approach=none", StaticScene(), (*_TOUCH, "impact_speed_m_s", "contact")),
    "avoidance": Swept("paper", AvoidanceScene(), _NEAR),
    "dynamic": Swept("paper", DynamicScene(), _TOUCH),
}


def _usual(name: str) -> dict[str, Any]:
    """Return the default parameters outside the profile, by group."""
    skin, scene = UnitCount(), EXPERIMENTS[name].scene
    return {"plant": PlantParams(), "sensing": RangeFinderParams(), "skin": skin, "scene": scene}


def setting(name: str, profile_text: str, values: Mapping[str, Value], seed: int) -> tuple[Row, Context]:
    """Return an experiment's cell and its arm and skin; an error names a value outside its range."""
    params = _usual(name)
    changes: dict[str, dict[str, str]] = {group: {} for group in params}
    for parameter, value in values.items():
        group, _, field = parameter.partition(".")
        if group in changes:
            changes[group][field] = str(value)
        else:
            profile_text += f":{parameter}={value}"
    profile(profile_text)  # raises ParameterError for values outside their range
    kind, world = changes["plant"].pop("kind", "nominal"), changes["plant"].pop("world", "")
    if kind not in scenario("arms"):
        raise ExperimentError(f"The arm plant.kind={kind} is unknown: choose from {', '.join(scenario('arms'))}.")
    params["plant"] = plant_of(kind)
    if world:
        by_seed = drawn(named_set(world), seed, PlantParams())
        params["plant"] = with_own(by_seed.plant, params["plant"], PlantParams())
        params["sensing"] = by_seed.ranging
    plant, ranging, skin, scene = (changed(params[group], own, group) for group, own in changes.items())
    plant.check_joints(model().n, len(model().links))
    return asdict(scene) | {"profile": profile_text}, Context(model(), skin_of(skin), plant=plant, ranging=ranging)


@cache
def skin_of(count: UnitCount) -> Skin:
    """Return the units on the arm."""
    return spread_skin(model(), count.units) if count.units else paper_skin(model())


def trial(name: str, profile_text: str, cell: dict[str, Value], seed: int) -> Row:
    """Play a cell; return its measures, or the reason of a failure."""
    metrics = EXPERIMENTS[name].metrics
    try:
        played, context = setting(name, profile_text, cell, seed)
        row = experiment(name).trial(played, seed, context)[0]
    except Exception as error:  # the row has the reason, and the other cells go on
        reason = str(error) if isinstance(error, PretouchError) else f"{type(error).__name__}: {error}"
        return {"failed": reason or type(error).__name__, **dict.fromkeys(metrics)}
    touches = row.get("contacts", [{"detected": row.get("detection_delay_s") is not None}] * row["contact"])
    row["missed"] = float(np.mean([not touch["detected"] for touch in touches])) if touches else None
    return {"failed": "", **{metric: row[metric] for metric in metrics}}


@dataclass(frozen=True)
class Dimension:
    """One swept parameter: a list of values, or a range of numbers."""

    name: str
    text: str
    choices: tuple[Value, ...] = ()
    low: float = 0.0
    high: float = 1.0
    log: bool = False
    """True for values evenly spaced by their logarithm."""
    whole: bool = False
    levels: int = 5
    """Number of values of a range on a grid."""

    def at(self, part: float) -> Value:
        """Return the value at a fraction of the range, 0 to 1; choices and whole numbers have equal shares of it."""
        if self.choices:
            return self.choices[min(int(part * len(self.choices)), len(self.choices) - 1)]
        wide = 0.5 if self.whole and not self.log else 0.0
        low, high = self.low - wide, self.high + wide
        value = high if part >= 1.0 else low * (high / low) ** part if self.log else low + part * (high - low)
        return int(np.clip(round(value), self.low, self.high)) if self.whole else value

    def grid(self) -> list[Value]:
        """Return the values on a grid, both ends included."""
        if self.choices:
            return list(self.choices)
        spaced = np.geomspace if self.log else np.linspace
        values = spaced(self.low, self.high, self.levels).tolist()
        return list(dict.fromkeys(round(value) for value in values)) if self.whole else values


def dimension(name: str, text: str, now: object) -> Dimension:
    """Read the range or the values of a parameter whose default is `now`. Raises ExperimentError."""
    if ":" not in text:
        return Dimension(name, text, tuple(value_of(word.strip()) for word in text.split(",")))
    begin, end, *more = text.split(":")
    whole, log, levels = isinstance(now, int), "log" in more, [int(word) for word in more if word.isdigit()]
    ends = [float(each) for each in map(value_of, (begin, end)) if isinstance(each, int if whole else int | float)]
    readable = len(ends) == 2 and type(now) in (int, float) and len(levels) + log == len(more)
    if not readable or not ends[0] < ends[1] or (log and ends[0] <= 0.0) or min(levels, default=2) < 2:
        raise ExperimentError(
            f"The range {name}={text} cannot be used, as {name} is {now}: write NAME=LOW:HIGH for numbers, the lower"
            " first, whole ones for whole ones; with :log, if LOW is above 0, or :LEVELS; or NAME=VALUE,VALUE."
        )
    return Dimension(name, text, (), ends[0], ends[1], log, whole, *levels[:1])


def value_of(text: str) -> Value:
    """Read a number as int or float, and other text as str."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


@dataclass(frozen=True)
class SweepPlan:
    """One sweep."""

    experiment: str
    profile: str
    vary: tuple[Dimension, ...]
    fixed: dict[str, Value]
    design: Design
    samples: int
    """Base points of the Sobol sequence; a grid uses `Dimension.levels`."""
    seeds: range

    @property
    def columns(self) -> list[Dimension]:
        """Columns of the Sobol design: the swept parameters, and `seed` if there are several arms."""
        arm = [Dimension("seed", f"{len(self.seeds)} arms", tuple(self.seeds))] if len(self.seeds) > 1 else []
        return [*self.vary, *arm]

    def plays(self) -> list[Play]:
        """Return the cells with their seeds in the order of the design. Raises ExperimentError for a cell out of range.

        For Sobol indices they form `samples` blocks of D + 2: Saltelli's A, A with each column from B, and B.
        """
        if self.design == "sobol":
            from SALib.sample import sobol

            random = np.random.default_rng(_DESIGN_SEED)
            rows = sobol.sample(problem(self.columns), self.samples, calc_second_order=False, seed=random).tolist()
            cells = [{one.name: one.at(part) for one, part in zip(self.columns, row, strict=True)} for row in rows]
        else:
            grids = {one.name: one.grid() for one in self.vary} | {"seed": [*self.seeds]}
            cells = [dict(zip(grids, values, strict=True)) for values in product(*grids.values())]
        plays: list[Play] = []
        for cell in cells:
            seed = int(cell.pop("seed", self.seeds[0]))
            try:
                setting(self.experiment, self.profile, self.fixed | cell, seed)
            except PretouchError as error:
                raise ExperimentError(f"{error} The cell is {cell}: narrow a range.") from error
            plays.append((self.fixed | cell, seed))
        return plays


def sweep_of(options: SweepOptions, vary: Mapping[str, str], fix: Mapping[str, str]) -> SweepPlan:
    """Read a sweep from ranges and values of the command line. Raises an error of this package."""
    name, samples, arms = options.experiment, options.samples, options.arms
    if name not in EXPERIMENTS:
        raise ExperimentError(f"The experiment {name!r} cannot be swept: choose from {', '.join(EXPERIMENTS)}.")
    if not vary:
        raise ExperimentError("Nothing is varied: give --vary NAME=LOW:HIGH, for example detect.f_base_n=5:15.")
    if both := [parameter for parameter in vary if parameter in fix]:
        raise ExperimentError(f"The parameter {both[0]} is both varied and fixed: remove --vary or --fix for it.")
    if options.design == "sobol" and (samples < 2 or samples & (samples - 1)):
        raise ExperimentError(f"The number of samples is {samples}: give a power of two, for example 64.")
    first, last = _SEED_RANGES[options.seeds]
    if not 1 <= arms <= last - first + 1:
        raise ExperimentError(f"The number of arms is {arms}: give 1 to {last - first + 1}.")
    base = options.profile or EXPERIMENTS[name].profile
    dimensions = []
    for parameter, text in vary.items():
        group, _, field = parameter.partition(".")
        usual = _usual(name).get(group)
        now = None if ":" not in text else at(usual, field, group) if usual else at(profile(base), parameter)
        dimensions.append(dimension(parameter, text, now))
    fixed = {parameter: value_of(text) for parameter, text in fix.items()}
    return SweepPlan(name, base, tuple(dimensions), fixed, options.design, samples, range(first, first + arms))


def problem(columns: list[Dimension]) -> dict[str, Any]:
    """Return the columns as SALib's problem: fractions of their ranges, 0 to 1."""
    names = [one.name for one in columns]
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def sobol_indices(columns: list[Dimension], numbers: Sequence[float | None]) -> list[Row]:
    """Return first-order and total index of each column, from numbers (samples * (D + 2),) in the order of the design.

    A block with a missing number is left out: the indices are sums over the differences within a block. A measure that
    does not vary has no indices.
    """
    from SALib.analyze import sobol

    blocks = np.array(numbers, np.float64).reshape(-1, len(columns) + 2)
    whole = blocks[np.isfinite(blocks).all(axis=1)]
    rows: list[Row] = [
        {"parameter": one.name, "range": one.text, "blocks": len(whole), "of": len(blocks), **dict.fromkeys(_INDICES)}
        for one in columns
    ]
    if len(whole) < 2 or np.ptp(whole) <= 1e-9 * np.abs(whole).max():
        return rows
    answer = sobol.analyze(
        problem(columns), whole.ravel(), calc_second_order=False, num_resamples=_RESAMPLES, seed=_RESAMPLING_SEED
    )
    return [row | {key: rounded(answer[of][i], 4) for key, of in _INDICES.items()} for i, row in enumerate(rows)]


def results_of(sweep: SweepPlan, rows: list[Row], metrics: Sequence[str]) -> dict[str, list[Row]]:
    """Return indices by metric, or for a grid summaries by parameter, from rows in the order of the design."""
    if sweep.design == "sobol":
        return {metric: sobol_indices(sweep.columns, [row[metric] for row in rows]) for metric in metrics}
    return {one.name: summary(rows, [one.name], metrics) for one in sweep.vary}


def tables(sweep: SweepPlan, results: dict[str, list[Row]], metrics: Sequence[str]) -> list[TextTable]:
    """Return a table for each metric of a Sobol design, or for each parameter of a grid."""
    fixed = "".join(f" {name} = {value}." for name, value in sweep.fixed.items())
    note = f"Profile {sweep.profile}, arms {sweep.seeds[0]} to {sweep.seeds[-1]}.{fixed}"
    every = []
    for name, rows in results.items():
        if sweep.design == "grid":
            columns = [Column(name, name), *(Column(metric, metric, 3, band=True) for metric in metrics)]
            text = f"{note} Medians of {rows[0]['trials']} cells, with 10 to 90 %."
        else:
            columns = [Column(key, key, 2 if key in _INDICES else None) for key in ("parameter", "range", *_INDICES)]
            text = f"{note} {rows[0]['blocks']} of {rows[0]['of']} blocks have a value."
        every.append(table(f"{sweep.experiment}: {name}", columns, rows, text))
    return every


def sobol_figure(indices: dict[str, list[Row]]) -> Figure:
    """Draw the indices of each metric as bars."""
    count = len(next(iter(indices.values())))
    figure = Figure((2.2 + 3.2 * len(indices), 1.6 + 0.3 * count), layout="constrained")
    panels = figure.subplots(1, len(indices), sharey=True, squeeze=False)[0]
    for axes, (metric, rows) in zip(panels, indices.items(), strict=True):
        for key, shift, colour in (("first", -0.2, "#0072b2"), ("total", 0.2, "#d55e00")):
            size, off = ([row[part] or 0.0 for row in rows] for part in (key, f"{key}_95"))
            axes.barh(np.arange(count) + shift, size, 0.36, xerr=off, color=colour, label=f"{key}; bar: 95 %")
        axes.set_title(metric, fontsize=10)
        axes.set_xlabel("part of the variance")
        axes.grid(alpha=0.25, lw=0.6)
    panels[0].set_yticks(np.arange(count), [row["parameter"] for row in rows], fontsize=8)
    panels[0].invert_yaxis()
    panels[0].legend(fontsize="x-small")
    return figure
