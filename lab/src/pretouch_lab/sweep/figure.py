"""Figures of a sweep: indices with their intervals, correlations, or the course over a grid."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from pretouch_lab.benchmarks import style
from pretouch_lab.sweep.definition import Sweep

_FIRST, _TOTAL = style.colour("pretouch"), style.colour("paper")
_ROW_IN = 0.3
"""Height of a parameter's row [in]."""


def sweep_figure(sweep: Sweep, found: dict[str, Any]) -> Figure:
    """Draw what `indices` found, a column of panels for each metric."""
    if sweep.design == "grid":
        return _courses(sweep, found)
    rows = max((len(found[metric]["rows"]) for metric in sweep.metrics), default=0)
    figure = Figure((2.2 + 3.2 * len(sweep.metrics), 1.6 + _ROW_IN * max(rows, 3)), layout="constrained")
    panels = figure.subplots(1, len(sweep.metrics), sharey=True, squeeze=False)[0]
    for axes, metric in zip(panels, sweep.metrics, strict=True):
        (_indices if sweep.design == "sobol" else _correlations)(axes, found[metric]["rows"])
        axes.set_title(_wrapped(sweep.measure.metrics[metric]), fontsize=10)
        style.plain(axes)
    panels[0].invert_yaxis()
    filled = next((axes for axes in panels if axes.get_legend_handles_labels()[0]), None)
    if filled is not None:
        style.legend_above(figure, filled, 2)
    return figure


def _indices(axes: Axes, rows: list[dict[str, Any]]) -> None:
    axes.set_xlabel("part of the variance")
    if not rows:
        _nothing(axes)
        return
    at = np.arange(len(rows))
    for key, shift, colour, label in (
        ("first", -0.2, _FIRST, "first-order"), ("total", 0.2, _TOTAL, "total, with all interactions"),
    ):  # fmt: skip
        axes.barh(
            at + shift, [row[key] for row in rows], 0.36, xerr=[row[f"{key}_95"] for row in rows], color=colour,
            error_kw={"lw": 1.0, "capsize": 2.0}, label=f"{label}; bar: 95 %",
        )  # fmt: skip
    axes.axvline(0.0, color="black", lw=0.8)
    axes.set_yticks(at, [row["parameter"] for row in rows], fontsize=8)
    highest = max(max(row["first"] + row["first_95"], row["total"] + row["total_95"]) for row in rows)
    axes.set_xlim(-0.15, min(1.5, max(0.4, 1.05 * highest)))


def _correlations(axes: Axes, rows: list[dict[str, Any]]) -> None:
    axes.set_xlabel("rank correlation")
    if not rows:
        _nothing(axes)
        return
    at, middle = np.arange(len(rows)), np.array([row["correlation"] for row in rows])
    ends = np.array([[row["low"], row["high"]] for row in rows]).T
    axes.barh(
        at, middle, 0.6, xerr=np.abs(ends - middle), color=_FIRST, error_kw={"lw": 1.0, "capsize": 2.0},
        label="Spearman; bar: 95 %",
    )  # fmt: skip
    axes.axvline(0.0, color="black", lw=0.8)
    axes.set_yticks(at, [row["parameter"] for row in rows], fontsize=8)
    axes.set_xlim(-1.0, 1.0)


def _courses(sweep: Sweep, found: dict[str, Any]) -> Figure:
    shape = len(sweep.metrics), len(sweep.vary)
    figure = Figure((1.0 + 4.4 * shape[1], 0.6 + 2.5 * shape[0]), layout="constrained")
    panels = figure.subplots(*shape, sharex="col", sharey="row", squeeze=False)
    for line, metric in zip(panels, sweep.metrics, strict=True):
        for axes, one in zip(line, sweep.vary, strict=True):
            rows = [r for r in found[metric]["rows"] if r["parameter"] == one.name and r["n"]]
            words = bool(one.choices) and not all(isinstance(c, int | float) for c in one.choices)
            at = [one.choices.index(r["level"]) if words else float(r["level"]) for r in rows]
            middle, mean, low, high = ([r[k] for r in rows] for k in ("median", "mean", "p10", "p90"))
            if rows:
                axes.fill_between(at, low, high, color=_FIRST, alpha=0.2, lw=0, label="10 to 90 %")
                axes.plot(at, middle, color=_FIRST, marker="o", label="median")
                axes.plot(at, mean, color=_TOTAL, ls="--", marker="s", ms=4, label="mean")
            else:
                _nothing(axes)
            if words:
                axes.set_xticks(range(len(one.choices)), [str(c) for c in one.choices])
            elif at and min(at) > 0 and max(at) >= 10 * min(at):
                axes.set_xscale("log", base=2)
                axes.set_xticks(at)
                axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
                axes.xaxis.set_minor_formatter(NullFormatter())
            style.plain(axes)
        line[0].set_ylabel(_wrapped(sweep.measure.metrics[metric]), fontsize=9)
    for axes, one in zip(panels[-1], sweep.vary, strict=True):
        axes.set_xlabel(one.name)
    if panels[0, 0].get_legend_handles_labels()[0]:
        style.legend_above(figure, panels[0, 0], 3)
    return figure


def _nothing(axes: Axes) -> None:
    axes.text(0.5, 0.5, "does not vary", transform=axes.transAxes, ha="center", va="center", color="gray")


def _wrapped(text: str) -> str:
    """Break a long line in its middle."""
    words = text.split()
    if len(text) <= 32 or len(words) < 2:
        return text
    cut = min(range(1, len(words)), key=lambda i: abs(len(" ".join(words[:i])) - len(text) / 2))
    return " ".join(words[:cut]) + "\n" + " ".join(words[cut:])
