"""How much each parameter matters: Sobol indices with 95 % intervals, or the course over a grid; as rows and tables."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pretouch.text_table import Column, TextTable, tabulated
from pretouch.types import FloatArray
from pretouch_lab.run import Row
from pretouch_lab.sweep.design import SEED, Sweep, problem
from pretouch_lab.sweep.play import Run
from pretouch_lab.table import rounded

_RESAMPLES = 500
_DRAWN_WITH = 2021
_FLAT = 1e-9
"""Spread of a number, as a part of its size, below which it does not vary."""


def indices(run: Run) -> dict[str, Row]:
    """Return what there is to say of each number: rows, and how many points they rest on."""
    if run.sweep.design == "sobol":
        return {name: sobol_indices(run.sweep, values) for name, values in run.values().items()}
    return {name: _courses(run, values) for name, values in run.values().items()}


def sobol_indices(sweep: Sweep, values: FloatArray) -> Row:
    """First-order and total index of each column, from values (samples * (D + 2),) in the order of the design.

    A block in which a value is missing is left out whole, for its differences are what the indices are made of.
    """
    from SALib.analyze import sobol

    columns = sweep.columns
    blocks = values.reshape(-1, len(columns) + 2)
    whole = blocks[np.isfinite(blocks).all(axis=1)]
    about: Row = {"points": len(whole), "of": len(blocks), **_spread(whole[:, [0, -1]].ravel())}
    if len(whole) < 2 or np.ptp(whole) <= _FLAT * np.abs(whole).max():
        return about | {"rows": []}
    answer = sobol.analyze(
        problem(columns), whole.ravel(), calc_second_order=False, num_resamples=_RESAMPLES, seed=_DRAWN_WITH
    )
    rows = [
        {
            "parameter": one.name, "first": rounded(answer["S1"][i], 4), "first_95": rounded(answer["S1_conf"][i], 4),
            "total": rounded(answer["ST"][i], 4), "total_95": rounded(answer["ST_conf"][i], 4),
        }
        for i, one in enumerate(columns)
    ]  # fmt: skip
    return about | {"rows": rows}


def _courses(run: Run, values: FloatArray) -> Row:
    """Mean, median and 10 to 90 % at each level of each parameter, over all else."""
    rows = []
    for one in run.sweep.vary:
        for level in one.grid():
            here = np.array([v for p, v in zip(run.points, values, strict=True) if p.values[one.name] == level])
            here = here[np.isfinite(here)]
            rows.append({"parameter": one.name, "level": level, "n": len(here), **_spread(here)})
    known = np.isfinite(values)
    return {"points": int(known.sum()), "of": len(values), **_spread(values[known]), "rows": rows}


def _spread(values: FloatArray) -> Row:
    """Mean, median and 10 to 90 % of some values, None of none."""
    if not len(values):
        return dict.fromkeys(("mean", "median", "p10", "p90"))
    low, middle, high = np.percentile(values, [10, 50, 90])
    numbers = {"mean": values.mean(), "median": middle, "p10": low, "p90": high}
    return {name: rounded(value, 4) for name, value in numbers.items()}


def tables(sweep: Sweep, found: dict[str, Row], metrics: tuple[str, ...]) -> list[TextTable]:
    """Return the indices of some numbers in one table, or the course over a grid in one for each parameter."""
    title = f"{sweep.measure.name}: {sweep.measure.text}"
    if sweep.design == "grid":
        return [_course_table(title, one.name, found, metrics, _note(sweep, found, metrics)) for one in sweep.vary]
    ranges = {one.name: one.written for one in sweep.columns} | {SEED: f"{len(sweep.seeds)} arms"}
    columns: list[Column] = [("parameter", str), ("range", ranges.__getitem__)]
    for metric in metrics:
        of = {row["parameter"]: row for row in found[metric]["rows"]}
        columns += [(f"{metric}:\nfirst", _index(of, "first")), ("total", _index(of, "total"))]
    return [tabulated(title, columns, [one.name for one in sweep.columns], _note(sweep, found, metrics))]


def _index(rows: dict[str, Any], key: str) -> Callable[[str], str]:
    return lambda name: f"{rows[name][key]:.2f} ± {rows[name][f'{key}_95']:.2f}" if name in rows else "-"


def _course_table(
    title: str, name: str, found: dict[str, Row], metrics: tuple[str, ...], note: str
) -> TextTable:  # fmt: skip
    lines: dict[Any, list[str]] = {}
    for metric in metrics:
        for row in found[metric]["rows"]:
            if row["parameter"] == name:
                level = row["level"]
                lines.setdefault(f"{level:g}" if isinstance(level, float) else str(level), []).append(_band(row))
    return TextTable(title, (name, *metrics), tuple((level, *bands) for level, bands in lines.items()), note)


def _band(row: Row) -> str:
    return "-" if row["median"] is None else f"{row['median']:.3g} ({row['p10']:.3g} to {row['p90']:.3g})"


def _note(sweep: Sweep, found: dict[str, Row], metrics: tuple[str, ...]) -> str:
    said = [f"Fixed: {', '.join(f'{name} = {value}' for name, value in sweep.fixed.items())}."] if sweep.fixed else []
    for metric in metrics:
        about, what = found[metric], "blocks" if sweep.design == "sobol" else "points"
        numbers = (
            "there is none" if about["median"] is None
            else f"mean {about['mean']:.3g}, median {about['median']:.3g}, 10 to 90 %: {about['p10']:.3g} to"
            f" {about['p90']:.3g}; {about['points']} of {about['of']} {what} have it"
        )  # fmt: skip
        said.append(f"{metric}: {sweep.measure.metrics[metric]}, {numbers}.")
    said.append(f"Profile {sweep.profile}, arms {sweep.seeds[0]} to {sweep.seeds[-1]}.")
    return " ".join(said)
