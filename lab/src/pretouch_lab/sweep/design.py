"""A sweep: what is varied, which cells are played, and what they came to.

A seed is a simulated arm in a scene: masses, friction, noise, where the board stands. A grid plays each combination
with the same arms, so that two of its points differ by their parameters alone (common random numbers). For Sobol
indices the arm is one more column of the design, `seed`: its index says how much of what is seen is due to which arm it
was, and no parameter's index holds a part of that.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from pretouch.errors import ExperimentError, PretouchError
from pretouch.extras import Extra
from pretouch.profiles import profile
from pretouch.types import FloatArray
from pretouch_lab.bench.scenes import SeedRange
from pretouch_lab.run import Play, Row
from pretouch_lab.sweep.measures import Measure, measure
from pretouch_lab.sweep.parameters import (
    Dimension,
    Setting,
    Values,
    built,
    current,
    dimension,
    read_value,
    world_digest,
)

Design = Literal["grid", "sobol"]
SEED = "seed"
SWEEP = Extra("sweep", ("SALib",), "setup", "pretouch-lab")
LARGEST = 200_000
"""Cells of one sweep."""
_DRAWN_WITH = 20_211_116
"""Seed of the designs themselves: the same sweep always has the same cells."""
_SEED_RANGES: dict[SeedRange, tuple[int, int]] = {"published": (0, 999), "development": (1000, 1999)}


@dataclass(frozen=True)
class Sweep:
    """One sweep, checked."""

    measure: Measure
    """The experiment."""
    profile: str
    """As `pretouch.profiles.profile` reads it."""
    vary: tuple[Dimension, ...]
    fixed: Values
    design: Design
    samples: int
    """Base points of the Sobol sequence; a grid has its levels."""
    seeds: range
    """Of the simulated arms."""

    @property
    def columns(self) -> list[Dimension]:
        """Columns of the Sobol design: what is varied, and the arm if there are several."""
        arm = [Dimension(SEED, choices=tuple(self.seeds))] if len(self.seeds) > 1 else []
        return [*self.vary, *arm]

    def setting(self, point: "Point") -> Setting:
        """Make the setting of a cell."""
        return built(self.profile, self.measure.scene, self.fixed | point.values, point.seed)


@dataclass(frozen=True)
class Point:
    """One cell: the values of what is varied, and the arm's seed."""

    values: Values
    seed: int


def sweep_of(
    experiment: str, vary: Mapping[str, str], fix: Mapping[str, str], profile_text: str = "", design: Design = "sobol",
    samples: int = 64, arms: int = 16, seeds: SeedRange = "development",
) -> Sweep:  # fmt: skip
    """Read and check a sweep.

    Args:
        experiment: name of a `Measure`.
        vary: range of each parameter that is varied, as `dimension` reads it.
        fix: value of each one that is something else throughout.
        profile_text: profile to start from; empty: the experiment's own.
        design: all combinations, or Saltelli's for Sobol indices.
        samples: base points of the latter, a power of two.
        arms: simulated arms.
        seeds: of which range these are.

    Raises an error of this package for what cannot be swept.
    """
    what = measure(experiment)
    base = profile(profile_text or what.profile)
    if not vary:
        raise ExperimentError("Nothing is varied: give --vary NAME=LOW:HIGH, detect.f_base_n=5:15 for one.")
    now = {name: current(name, base, what.scene) for name in (*vary, *fix)}
    for name in now:
        what.check(name)
    both = [name for name in vary if name in fix]
    if both:
        raise ExperimentError(f"The parameter {both[0]} is both varied and fixed: do one of them.")
    if design == "sobol" and (samples < 2 or samples & (samples - 1)):
        raise ExperimentError(f"The number of samples is {samples}: give a power of two, 64 for one.")
    first, last = _SEED_RANGES[seeds]
    if not 1 <= arms <= last - first + 1:
        raise ExperimentError(f"The number of arms is {arms}: give 1 to {last - first + 1}.")
    sweep = Sweep(
        what, profile_text or what.profile, tuple(dimension(name, text, now[name]) for name, text in vary.items()),
        {name: read_value(name, text, now[name]) for name, text in fix.items()}, design, samples,
        range(first, first + arms),
    )  # fmt: skip
    for one in sweep.vary:
        for value in one.ends:
            try:
                sweep.setting(Point({one.name: value}, 0))
            except PretouchError as error:
                raise ExperimentError(
                    f"The range of {one.name} holds {value}, which is not allowed: {error}"
                ) from error
    return sweep


def points(sweep: Sweep) -> list[Point]:
    """Return a sweep's cells in the order of its design; an ExperimentError where one has values that go not together.

    For Sobol indices these are `samples` blocks of D + 2: Saltelli's A, A with each column from B, and B.
    """
    cells = _grid(sweep) if sweep.design == "grid" else _saltelli(sweep)
    for point in cells:
        try:
            sweep.setting(point)
        except PretouchError as error:
            listed = ", ".join(f"{name} = {value}" for name, value in point.values.items())
            raise ExperimentError(f"Values go not together, {listed}: {error} Narrow a range.") from error
    return cells


def _grid(sweep: Sweep) -> list[Point]:
    names, levels = [one.name for one in sweep.vary], [one.grid() for one in sweep.vary]
    count = len(sweep.seeds)
    for level in levels:
        count *= len(level)
    _check_count(count)
    return [Point(dict(zip(names, values, strict=True)), seed) for values in product(*levels) for seed in sweep.seeds]


def _saltelli(sweep: Sweep) -> list[Point]:
    from SALib.sample import sobol

    columns = sweep.columns
    _check_count(sweep.samples * (len(columns) + 2))
    unit = sobol.sample(
        problem(columns), sweep.samples, calc_second_order=False, seed=np.random.default_rng(_DRAWN_WITH)
    )
    rows = [{one.name: one.at(float(part)) for one, part in zip(columns, row, strict=True)} for row in unit]
    return [Point(row, int(row.pop(SEED, sweep.seeds[0]))) for row in rows]


def problem(columns: list[Dimension]) -> dict[str, Any]:
    """Return the columns as SALib names them: parts of their ranges, from 0 to 1."""
    names = [one.name for one in columns]
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def _check_count(count: int) -> None:
    if count > LARGEST:
        raise ExperimentError(f"The sweep has {count} cells, more than {LARGEST}: take fewer samples, levels or arms.")


Group = tuple[list[int], Play]
"""Numbers of points that are played one after the other, as they have a recorded stream in common; and that play."""


def groups(sweep: Sweep, cells: list[Point]) -> list[Group]:
    """Return the points of a design as plays: each of its own, or all of a recorded stream.

    A cell has digests of the worlds that its values name, so that rows of a file as it was before are not taken for it.
    """
    shared: dict[str, list[int]] = {}
    for number, point in enumerate(cells):
        same = sweep.setting(point).world if sweep.measure.shared else json.dumps([point.values, point.seed])
        shared.setdefault(same, []).append(number)
    made: list[Group] = []
    for numbers in shared.values():
        values = [sweep.fixed | cells[n].values for n in numbers]
        worlds = sorted({digest for each in values if (digest := world_digest(each))})
        made.append((numbers, ({"cells": values, "worlds_sha256": worlds}, cells[numbers[0]].seed)))
    return made


def trial(experiment: str, profile_text: str, cell: Row, seed: int) -> Row:
    """Play cells that have a stream in common; return their numbers, or why they failed, whatever it was."""
    what = measure(experiment)
    try:
        settings = [built(profile_text, what.scene, values, seed) for values in cell["cells"]]
        stream = what.shared(settings[0]) if what.shared else None
        return {"failed": "", "metrics": [what.run(setting, stream) for setting in settings]}
    except Exception as error:  # it is written down, and the others go on
        reason = str(error) if isinstance(error, PretouchError) else f"{type(error).__name__}: {error}"
        return {"failed": reason or type(error).__name__, "metrics": []}


def values_of(sweep: Sweep, count: int, played: Iterable[tuple[Group, Row]]) -> dict[str, FloatArray]:
    """Return each number (count,) that is measured, by the points of the design; NaN where there is none."""
    found = {name: np.full(count, np.nan) for name in sweep.measure.metrics}
    for (numbers, _), row in played:
        for number, metrics in zip(numbers, row["metrics"], strict=not row["failed"]):
            for name, value in metrics.items():
                found[name][number] = np.nan if value is None else value
    return found
