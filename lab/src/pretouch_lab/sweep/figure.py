"""Figures of a sweep: indices with their intervals, or the course over a grid."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch_lab.sweep.design import Sweep

_FIRST, _TOTAL = "#0072b2", "#d55e00"
"""Colours that the colour-blind tell apart too (Okabe and Ito, 2008)."""
_ROW_IN = 0.3
"""Height of a parameter's row [in]."""


def sweep_figure(sweep: Sweep, found: dict[str, Any], metrics: tuple[str, ...]) -> Figure:
    """Draw what `indices` found of some numbers: a column of panels for each, or a row for each over a grid."""
    if sweep.design == "grid":
        return _courses(sweep, found, metrics)
    rows = max((len(found[metric]["rows"]) for metric in metrics), default=0)
    figure = Figure((2.2 + 3.2 * len(metrics), 1.6 + _ROW_IN * max(rows, 3)), layout="constrained")
    panels = figure.subplots(1, len(metrics), sharey=True, squeeze=False)[0]
    for axes, metric in zip(panels, metrics, strict=True):
        _indices(axes, found[metric]["rows"])
        axes.set_title(metric, fontsize=10)
        _plain(axes)
    panels[0].invert_yaxis()
    filled = next((axes for axes in panels if axes.get_legend_handles_labels()[0]), None)
    if filled is not None:
        _legend_above(figure, filled, 2)
    return figure


def _indices(axes: Axes, rows: list[dict[str, Any]]) -> None:
    axes.set_xlabel("part of the variance")
    if not rows:
        axes.text(0.5, 0.5, "does not vary", transform=axes.transAxes, ha="center", va="center", color="gray")
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


def _courses(sweep: Sweep, found: dict[str, Any], metrics: tuple[str, ...]) -> Figure:
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
