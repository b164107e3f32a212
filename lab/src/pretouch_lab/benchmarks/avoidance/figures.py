"""Figures of the avoidance benchmark."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch_lab.benchmarks import style
from pretouch_lab.benchmarks.avoidance.trade import TRADE, trade, trade_points
from pretouch_lab.experiment import Picture
from pretouch_lab.rows import Row, grouped

_HELD_M = 0.01
"""Way below which the hand was held [m]."""
_OVER_TIME = ("srdo", "drdo", "walking")
_SIDE_BY_SIDE = ("srdo", "drdo")


def figures(summary: Row, rows: list[Row]) -> list[Picture]:
    """Draw what forces are paid for with, distances over time, and what each baseline came to in each scenario."""
    names = style.shown(list(dict.fromkeys(cell["contender"] for cell in summary["cells"])))
    rows = [row for row in rows if row["contender"] in names]
    drawn = []
    if trade_points(summary):
        drawn.append(Picture("bench-trade", TRADE, trade(summary)))
    if len({row["family"] for row in rows} & set(_SIDE_BY_SIDE)) == len(_SIDE_BY_SIDE):
        text = "Distance of the obstacle from the arm in srdo and drdo, first seed"
        drawn.append(Picture("bench-avoidance-distance", text, _distances(rows, names)))
    text = "Least distance, force and tracking of each contender in each scenario, median and 10-90 %"
    drawn.append(Picture("bench-avoidance-outcome", text, _outcome(summary, names)))
    for key, group in grouped(rows, ("scenario",)):
        if group[0]["family"] in _OVER_TIME:
            first = [row for row in group if row["seed"] == group[0]["seed"]]
            stem = key["scenario"].replace(" ", "-")
            text = f"{key['scenario']}: distance, force and way over time, first seed"
            drawn.append(Picture(f"bench-avoidance-{stem}", text, _courses(first)))
    return drawn


def _distances(rows: list[Row], names: list[str]) -> Figure:
    """Draw distance over time for the two scenes of an obstacle that moves in, side by side."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    panels: list[Axes] = list(figure.subplots(1, 2, sharey=True))
    titles = {"srdo": "srdo: the hand is held", "drdo": "drdo: the hand runs the circle"}
    for ax, family in zip(panels, _SIDE_BY_SIDE, strict=True):
        group = [row for row in rows if row["family"] == family]
        first = {row["contender"]: row for row in reversed(group) if row["seed"] == group[0]["seed"]}
        for name in (name for name in names if name in first):
            course = first[name]["course"]
            ax.plot(course["time_s"], 1000 * np.array(course["distance_m"]), label=name, **style.line(name))
        ax.axhline(0.0, color="0.4", lw=0.8, zorder=0)
        ax.set_title(titles[family], fontsize=10)
        ax.set_xlabel("time [s]")
        style.plain(ax)
    panels[0].set_ylabel("distance [mm], negative in contact")
    style.legend_above(figure, panels[0], 4)
    return figure


def _outcome(summary: Row, names: list[str]) -> Figure:
    scenes = list(dict.fromkeys(cell["scenario"] for cell in summary["cells"]))
    figure = Figure(figsize=(11, 1.2 + 0.36 * len(scenes)), layout="constrained")
    axes: list[Axes] = list(figure.subplots(1, 3, sharey=True))
    for ax, (key, label) in zip(
        axes,
        (
            ("least_distance_m", "least distance [m]"),
            ("true_peak_20ms_n", "true force, 20 ms peak [N]"),
            ("tracking_rms_m", "off the path, rms [m]"),
        ),
        strict=True,
    ):
        for cell in summary["cells"]:
            spread, place = cell[key], scenes.index(cell["scenario"])
            if spread is None:
                continue
            i = names.index(cell["contender"])
            y = place + 0.7 * ((i + 0.5) / len(names) - 0.5)
            colour = style.colour(cell["contender"])
            ax.plot([spread["p10"], spread["p90"]], [y, y], color=colour, lw=1.5)
            ax.plot(
                spread["median"],
                y,
                style.marker(cell["contender"]),
                color=colour,
                ms=4,
                label=cell["contender"] if place == 0 else None,
            )
        for place in range(0, len(scenes), 2):
            ax.axhspan(place - 0.5, place + 0.5, color="0.95", zorder=0)
        ax.set_xlabel(label)
        ax.set_ylim(len(scenes) - 0.5, -0.5)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_yticks(range(len(scenes)), scenes)
    style.legend_above(figure, axes[0], 8)
    return figure


def _courses(rows: list[Row]) -> Figure:
    """Draw distance and force over time, and the way along the path unless the hand is held."""
    shown = {"distance_m": "distance [m]", "force_n": "true force [N]", "way_m": "way along the path [m]"}
    if max(max(row["course"]["way_m"]) for row in rows) < _HELD_M:
        del shown["way_m"]
    figure = Figure(figsize=(8, 2 * len(shown)), layout="constrained")
    axes: list[Axes] = list(figure.subplots(len(shown), 1, sharex=True))
    for ax, (key, label) in zip(axes, shown.items(), strict=True):
        for row in rows:
            name = row["contender"]
            ax.plot(row["course"]["time_s"], row["course"][key], label=name, **style.line(name))
        ax.set_ylabel(label)
        ax.spines[["top", "right"]].set_visible(False)
        ax.set_ylim(top=max(ax.get_ylim()[1], 1.0 if key == "force_n" else 0.0))
    axes[0].axhline(0.0, color="0.7", lw=0.8, zorder=0)
    axes[1].set_ylim(bottom=0.0)
    axes[-1].set_xlabel("time [s]")
    style.legend_above(figure, axes[0], 4)
    return figure
