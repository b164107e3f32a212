"""Force at contact without and with proximity (paper, Fig. contact_differences)."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.profiles import profile
from pretouch.recording.run_record import RunRecord
from pretouch_lab.paper.figures.marks import BLIND, OURS, SENSING, Y, touching

_TRAJECTORIES, _SIDES = ("circle", "line"), ("-y", "+y")


def force_difference_figure(traces: Mapping[tuple[str, str, str], RunRecord], profiles: Sequence[str]) -> Figure:
    """Force along y with the band between the thresholds, before and after contact.

    Blind is blue, the first of the others red, the second green.
    `traces` by (trajectory, side, profile); `profiles` are one or two to show beside `blind`.
    """
    shown = [name for name in dict.fromkeys(("blind", *profiles)) if any(key[2] == name for key in traces)]
    others = [name for name in profiles if name != "blind"]
    styles = {"blind": (BLIND, "...."), **dict(zip(others, ((SENSING, ""), (OURS, "")), strict=False))}
    figure = Figure(figsize=(10, 6.8), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for row, trajectory in enumerate(_TRAJECTORIES):
        for column, side in enumerate(_SIDES):
            axes: Axes = panels[row, column]
            for name in shown:
                trace = traces.get((trajectory, side, name))
                if trace is not None:
                    _force(axes, trace, -1.0 if side == "+y" else 1.0, name, *styles[name])
            axes.set_title(f"{trajectory}, object at {side}")
            axes.set_xlim(-1.0, 0.6)
            axes.grid(alpha=0.3)
    if panels[0, 0].lines:
        panels[0, 0].legend(loc="upper left", fontsize="small")
    figure.supxlabel("time from first touch [s]")
    figure.supylabel("force along y, away from the object [N]")
    figure.suptitle(f"Contact with a static object: force estimate and contact thresholds, {_listed(shown)}")
    return figure


def _force(axes: Axes, trace: RunRecord, push: float, name: str, colour: str, hatch: str) -> None:
    """Draw the estimate and its detection; of a detector by thresholds, these until then and the value of eq. 8 too."""
    style, filtered, marker = ("--", ":", "o") if hatch else ("-", "-.", "s")
    touched = np.flatnonzero(touching(trace))
    if len(touched) == 0:
        return
    time = trace.time - trace.time[touched[0]]
    found = np.flatnonzero(trace.detected & (time >= 0))
    before = time <= (time[found[0]] if len(found) else time[-1])
    if isinstance(profile(name).detect, MovingThresholds):
        axes.fill_between(
            time[before], push * trace.lower[before, Y], push * trace.upper[before, Y], facecolor=(colour, 0.15),
            edgecolor=(colour, 0.5), lw=0.8, ls=style, hatch=hatch, label=f"{name}: between thresholds",
        )  # fmt: skip
        axes.plot(time, push * trace.filtered_force[:, Y], color=colour, ls=filtered, lw=1.2, label=f"{name}: eq. 8")
    axes.plot(time, push * trace.force[:, Y], color=colour, ls=style, label=f"{name}: estimate")
    axes.plot(time[found], push * trace.force[found, Y], marker, color=colour, mec="black", label=f"{name}: detected")


def _listed(names: Sequence[str]) -> str:
    *first, last = names or [""]
    return f"{', '.join(first)} and {last}" if first else last
