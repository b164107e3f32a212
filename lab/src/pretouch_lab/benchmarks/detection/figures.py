"""Figures of the detection benchmark."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch_lab.baselines.detection import Baseline
from pretouch_lab.benchmarks import style
from pretouch_lab.benchmarks.detection.judge import BUSY
from pretouch_lab.benchmarks.detection.results import Rows
from pretouch_lab.benchmarks.scenario_files import scenario
from pretouch_lab.rows import Row


def curve_figure(results: Row, baselines: Iterable[Baseline]) -> Figure:
    """Draw median delay and missed share against false alarms an hour, with 95 % bounds of the latter."""
    figure = Figure((9.0, 6.5), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey="row")
    goal = scenario("contacts")["goal"]
    for column, seen in enumerate(("seen", "unseen")):
        for baseline in baselines:
            _curve(panels[:, column], results["curves"], baseline, seen)
        panels[0, column].set_title(f"contacts {'' if seen == 'seen' else 'not '}seen by the skin")
        for axes, wanted in zip(panels[:, column], (1000 * goal[f"{seen}_delay_s"], 0.0), strict=True):
            axes.plot(goal["false_alarms_per_hour"], wanted, "*", color="gold", mec="black", ms=13, zorder=4,
                      label="goal")  # fmt: skip
        panels[1, column].set_xlabel("false alarms per hour at 0.3 m/s")
    panels[0, 0].set_xscale("symlog", linthresh=0.1)
    panels[0, 0].set_xlim(-0.02, 3600.0)
    panels[0, 0].set_ylim(bottom=0.0)
    panels[0, 0].set_ylabel("median delay [ms]")
    panels[1, 0].set_ylabel("missed [%]")
    style.legend_above(figure, panels[0, 0], 7)
    for axes in panels.flat:
        style.plain(axes)
    return figure


def _curve(panels: Iterable[Axes], curves: list[Row], baseline: Baseline, seen: str) -> None:
    points = [p for p in curves if p["contender"] == baseline.name and p.get(seen, {}).get("contacts")]
    points = [p for p in points if "false_alarms_per_hour" in p]
    if not points:
        return
    colour = style.colour(baseline.name)
    x = np.array([p["false_alarms_per_hour"] for p in points])
    bounds = np.array([[p["low_per_hour"], p["high_per_hour"]] for p in points]).T
    delay = np.array([np.nan if (d := p[seen]["median_delay_s"]) is None else 1000 * d for p in points])
    missed = np.array([100 * p[seen]["missed"] / p[seen]["contacts"] for p in points])
    own = np.array([p[baseline.sweep] == baseline.default for p in points])
    # of the values without a false alarm, all with the same bounds, those of the first and of its own tell enough
    informative = (x > 0) | own | (np.arange(len(x)) == np.argmin(x))
    for axes, y in zip(panels, (delay, missed), strict=True):
        axes.plot(x, y, **style.line(baseline.name))
        axes.hlines(y[informative], bounds[0, informative], bounds[1, informative], color=(colour, 0.35), lw=1.0)
        axes.plot(x[own], y[own], style.marker(baseline.name), color=colour, mec="black", ms=7, zorder=3,
                  label=baseline.name)  # fmt: skip


def missed_figure(rows: Rows, baselines: Iterable[Baseline]) -> Figure:
    """Draw the share of contacts that each detector missed, by force and duration, links and sensing together."""
    shown = list(baselines)
    chosen = scenario("contacts")["contact"]
    forces = chosen["forces_n"]
    durations = sorted({duration for kind in chosen["kind"] for duration in kind["durations_s"]})
    figure = Figure((3.1 * len(shown) + 0.8, 3.6), layout="constrained")
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    image = None
    for axes, baseline in zip(panels, shown, strict=True):
        share = missed_share(rows, baseline.name, forces, durations)
        image = axes.imshow(share, origin="lower", vmin=0, vmax=100, cmap="Reds", aspect="auto")
        for (i, k), value in np.ndenumerate(share):
            if np.isfinite(value):
                axes.text(k, i, f"{value:.0f}", ha="center", va="center", fontsize=7,
                          color="white" if value > 60 else "black")  # fmt: skip
        axes.set_xticks(range(len(durations)), [f"{1000 * d:g}" for d in durations], rotation=60, fontsize=8)
        axes.set_yticks(range(len(forces)), [f"{f:g}" for f in forces], fontsize=8)
        axes.set_title(baseline.name, fontsize=10)
        axes.set_xlabel("duration [ms]")
    panels[0].set_ylabel("force [N]")
    if image is not None:
        figure.colorbar(image, ax=panels, label="missed [%]")
    return figure


def missed_share(rows: Rows, baseline: str, forces: list[float], durations: list[float]) -> np.ndarray:
    """Share [%] of contacts missed (forces, durations), NaN where there was none."""
    contacts = [c for cell in rows.contacts if cell["contender"] == baseline for c in cell["contacts"]]
    share = np.full((len(forces), len(durations)), np.nan)
    for i, force in enumerate(forces):
        for k, duration in enumerate(durations):
            found = [
                c["delay_s"] for c in contacts
                if c["force_n"] == force and c["duration_s"] == duration and c["delay_s"] != BUSY
            ]  # fmt: skip
            if found:
                share[i, k] = 100 * sum(delay is None for delay in found) / len(found)
    return share
