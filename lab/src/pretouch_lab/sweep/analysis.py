"""How much each parameter matters: Sobol indices with 95 % intervals, or the course over a grid."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.text_table import Column, TextTable, tabulated
from pretouch.types import FloatArray
from pretouch_lab.run import Row
from pretouch_lab.sweep.design import SEED, Point, Sweep, problem
from pretouch_lab.table import rounded

_RESAMPLES = 500
_DRAWN_WITH = 2021
_FIRST, _TOTAL = "#0072b2", "#d55e00"
"""Colours that the colour-blind tell apart too (Okabe and Ito, 2008)."""
_ROW_IN = 0.3
"""Height of a parameter's row [in]."""
_FLAT = 1e-9
"""Spread of a number, as a part of its size, below which it does not vary."""


def indices(sweep: Sweep, points: list[Point], values: dict[str, FloatArray]) -> dict[str, Row]:
    """Return what there is to say of each number: rows, and how many points they rest on."""
    if sweep.design == "sobol":
        return {name: sobol_indices(sweep, numbers) for name, numbers in values.items()}
    return {name: _courses(sweep, points, numbers) for name, numbers in values.items()}


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
            "parameter": one.name,
            "first": rounded(answer["S1"][i], 4),
            "first_95": rounded(answer["S1_conf"][i], 4),
            "total": rounded(answer["ST"][i], 4),
            "total_95": rounded(answer["ST_conf"][i], 4),
        }
        for i, one in enumerate(columns)
    ]
    return about | {"rows": rows}


def _courses(sweep: Sweep, points: list[Point], values: FloatArray) -> Row:
    """Mean, median and 10 to 90 % at each level of each parameter, over all else."""
    rows = []
    for one in sweep.vary:
        for level in one.grid():
            here = np.array([v for p, v in zip(points, values, strict=True) if p.values[one.name] == level])
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


def _course_table(title: str, name: str, found: dict[str, Row], metrics: tuple[str, ...], note: str) -> TextTable:
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
            "there is none"
            if about["median"] is None
            else f"mean {about['mean']:.3g}, median {about['median']:.3g}, 10 to 90 %: {about['p10']:.3g} to"
            f" {about['p90']:.3g}; {about['points']} of {about['of']} {what} have it"
        )
        said.append(f"{metric}: {sweep.measure.metrics[metric]}, {numbers}.")
    said.append(f"Profile {sweep.profile}, arms {sweep.seeds[0]} to {sweep.seeds[-1]}.")
    return " ".join(said)


def sweep_figure(sweep: Sweep, found: dict[str, Any], metrics: tuple[str, ...]) -> Figure:
    """Draw what `indices` found of some numbers: a column of panels for each, or a row for each over a grid."""
    if sweep.design == "grid":
        return _drawn_courses(sweep, found, metrics)
    rows = max((len(found[metric]["rows"]) for metric in metrics), default=0)
    figure = Figure((2.2 + 3.2 * len(metrics), 1.6 + _ROW_IN * max(rows, 3)), layout="constrained")
    panels = figure.subplots(1, len(metrics), sharey=True, squeeze=False)[0]
    for axes, metric in zip(panels, metrics, strict=True):
        _drawn_indices(axes, found[metric]["rows"])
        axes.set_title(metric, fontsize=10)
        _plain(axes)
    panels[0].invert_yaxis()
    filled = next((axes for axes in panels if axes.get_legend_handles_labels()[0]), None)
    if filled is not None:
        _legend_above(figure, filled, 2)
    return figure


def _drawn_indices(axes: Axes, rows: list[dict[str, Any]]) -> None:
    axes.set_xlabel("part of the variance")
    if not rows:
        axes.text(0.5, 0.5, "does not vary", transform=axes.transAxes, ha="center", va="center", color="gray")
        return
    at = np.arange(len(rows))
    for key, shift, colour, label in (
        ("first", -0.2, _FIRST, "first-order"),
        ("total", 0.2, _TOTAL, "total, with all interactions"),
    ):
        axes.barh(
            at + shift,
            [row[key] for row in rows],
            0.36,
            xerr=[row[f"{key}_95"] for row in rows],
            color=colour,
            error_kw={"lw": 1.0, "capsize": 2.0},
            label=f"{label}; bar: 95 %",
        )
    axes.axvline(0.0, color="black", lw=0.8)
    axes.set_yticks(at, [row["parameter"] for row in rows], fontsize=8)


def _drawn_courses(sweep: Sweep, found: dict[str, Any], metrics: tuple[str, ...]) -> Figure:
    shape = len(metrics), len(sweep.vary)
    figure = Figure((1.0 + 4.4 * shape[1], 0.6 + 2.5 * shape[0]), layout="constrained")
    panels = figure.subplots(*shape, sharex="col", sharey="row", squeeze=False)
    for line, metric in zip(panels, metrics, strict=True):
        for axes, one in zip(line, sweep.vary, strict=True):
            rows = [row for row in found[metric]["rows"] if row["parameter"] == one.name and row["n"]]
            levels = [row["level"] for row in rows]
            at = levels if all(isinstance(level, float | int) for level in levels) else [str(level) for level in levels]
            middle, mean, low, high = ([row[key] for row in rows] for key in ("median", "mean", "p10", "p90"))
            axes.fill_between(at, low, high, color=_FIRST, alpha=0.2, lw=0, label="10 to 90 %")
            axes.plot(at, middle, color=_FIRST, marker="o", label="median")
            axes.plot(at, mean, color=_TOTAL, ls="--", marker="s", ms=4, label="mean")
            axes.set_xlabel(one.name)
            _plain(axes)
        line[0].set_ylabel(metric, fontsize=9)
    _legend_above(figure, panels[0, 0], 3)
    return figure


def _plain(axes: Axes) -> None:
    """Take away what a reader does not need."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, lw=0.6)


def _legend_above(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend of some axes above all."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, frameon=False)
