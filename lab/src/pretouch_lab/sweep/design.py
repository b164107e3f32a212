"""Which cells a sweep plays.

A seed is a simulated arm in a scene: masses, friction, noise, where the board stands. A grid plays each combination
with the same arms, so that two of its points differ by their parameters alone (common random numbers). In a Latin
hypercube and for Sobol indices the arm is one more column of the design, `seed`: its index says how much of what is
seen is due to which arm it was, and no parameter's index holds a part of that.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from pretouch.errors import ExperimentError, PretouchError
from pretouch.types import FloatArray
from pretouch_lab.sweep.definition import Sweep
from pretouch_lab.sweep.setting import Values
from pretouch_lab.sweep.space import Dimension

SEED = "seed"
LARGEST = 200_000
"""Cells of one sweep."""
_DRAWN_WITH = 20_211_116
"""Seed of the designs themselves: the same sweep always has the same cells."""


@dataclass(frozen=True)
class Point:
    """One cell: the values of what is varied, and the arm's seed."""

    values: Values
    seed: int


def columns(sweep: Sweep) -> list[Dimension]:
    """Return the columns of a hypercube: what is varied, and the arm if there are several."""
    arm = [Dimension(SEED, choices=tuple(sweep.arm_seeds))] if sweep.arms > 1 else []
    return [*sweep.vary, *arm]


def points(sweep: Sweep) -> list[Point]:
    """Return a sweep's cells in the order of its design; an ExperimentError where one has values that go not together.

    For Sobol indices these are `samples` blocks of D + 2: Saltelli's A, A with each column from B, and B.
    """
    found = _points(sweep)
    for point in found:
        try:
            sweep.setting(point.values, point.seed)
        except PretouchError as error:
            listed = ", ".join(f"{name} = {value}" for name, value in point.values.items())
            raise ExperimentError(f"Values go not together, {listed}: {error} Narrow a range.") from error
    return found


def _points(sweep: Sweep) -> list[Point]:
    if sweep.design == "grid":
        levels = [one.grid() for one in sweep.vary]
        _check_count(int(np.prod([len(values) for values in levels])) * sweep.arms)
        names = [one.name for one in sweep.vary]
        return [
            Point(dict(zip(names, chosen, strict=True)), seed)
            for chosen in product(*levels)
            for seed in sweep.arm_seeds
        ]
    wanted = columns(sweep)
    blocks = len(wanted) + 2 if sweep.design == "sobol" else 1
    _check_count(sweep.samples * blocks)
    rows = saltelli(wanted, sweep.samples) if sweep.design == "sobol" else _hypercube(len(wanted), sweep.samples)
    return [_point(wanted, row, sweep) for row in rows]


def _check_count(count: int) -> None:
    if count > LARGEST:
        raise ExperimentError(f"The sweep has {count} cells: take fewer samples, levels or arms, at most {LARGEST}.")


def _point(wanted: list[Dimension], row: FloatArray, sweep: Sweep) -> Point:
    values = {one.name: one.at(float(part)) for one, part in zip(wanted, row, strict=True)}
    return Point(values, int(values.pop(SEED, sweep.arm_seeds[0])))


def _hypercube(columns: int, samples: int) -> FloatArray:
    from scipy.stats.qmc import LatinHypercube

    return np.asarray(LatinHypercube(columns, rng=np.random.default_rng(_DRAWN_WITH)).random(samples))


def problem(wanted: list[Dimension]) -> dict[str, Any]:
    """Return the columns as SALib knows them: parts of their ranges."""
    return {
        "num_vars": len(wanted), "names": [one.name for one in wanted], "bounds": [[0.0, 1.0]] * len(wanted),
    }  # fmt: skip


def saltelli(wanted: list[Dimension], samples: int) -> FloatArray:
    """Return parts (samples * (D + 2), D) of the ranges, for first-order and total indices."""
    from SALib.sample import sobol

    rows = sobol.sample(problem(wanted), samples, calc_second_order=False, seed=np.random.default_rng(_DRAWN_WITH))
    return np.asarray(rows)
