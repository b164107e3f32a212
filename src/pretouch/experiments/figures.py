"""Figures of the three experiments, in the manner of the paper's, from the traces of single trials."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.experiments.trace import Trace
from pretouch.types import BoolArray, FloatArray

_BLIND, _SENSING = "tab:blue", "tab:red"
_TRAJECTORIES, _SIDES = ("circle", "line"), ("-y", "+y")
_AXES = "xyz"
_SLOWED = 0.99
_OFF_PATH_M = 0.01


def static_figure(traces: Mapping[tuple[str, str, str], Trace], profile: str) -> Figure:
    """Force with moving thresholds before and after contact, without and with proximity (paper, Fig. 6).

    `traces` by (trajectory, side, profile); `profile` is the one to show beside `blind`.
    """
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for row, trajectory in enumerate(_TRAJECTORIES):
        for column, side in enumerate(_SIDES):
            axes: Axes = panels[row, column]
            for name, colour, style in (("blind", _BLIND, "--"), (profile, _SENSING, "-")):
                trace = traces.get((trajectory, side, name))
                if trace is not None:
                    _force(axes, trace, -1.0 if side == "+y" else 1.0, name, colour, style)
            axes.set_title(f"{trajectory}, object at {side}")
            axes.set_xlim(-1.0, 0.6)
            axes.grid(alpha=0.3)
    if panels[0, 0].lines:
        panels[0, 0].legend(loc="upper left")
    figure.supxlabel("time from first touch [s]")
    figure.supylabel("force along y, away from the object [N]")
    figure.suptitle(f"Contact with a static object: estimated force and contact thresholds, blind and {profile}")
    return figure


def _force(axes: Axes, trace: Trace, push: float, name: str, colour: str, style: str) -> None:
    touching = np.flatnonzero(np.linalg.norm(trace.true_force, axis=1) > 1.0)
    if len(touching) == 0:
        return
    time = trace.time - trace.time[touching[0]]
    bounds = push * trace.lower[:, 1], push * trace.upper[:, 1]
    before = time <= time[_first(trace.detected & (time >= 0), len(time) - 1)]
    axes.fill_between(time[before], bounds[0][before], bounds[1][before], color=colour, alpha=0.15, lw=0)
    axes.plot(time, push * trace.force[:, 1], color=colour, ls=style, label=f"{name}: estimate")
    axes.plot(time, push * trace.filtered_force[:, 1], color=colour, ls=":", lw=1, label=f"{name}: eq. 8")
    for i in np.flatnonzero(trace.detected & (time >= 0)):
        axes.plot(time[i], push * trace.force[i, 1], "o", color=colour, mec="black")


def _first(flags: BoolArray, otherwise: int) -> int:
    found = np.flatnonzero(flags)
    return int(found[0]) if len(found) else otherwise


def avoidance_figure(trace: Trace, profile: str) -> Figure:
    """End-effector path on the circle: free, slowed or turned aside by an obstacle, recovering (paper, Fig. 4)."""
    figure = Figure(figsize=(10, 5), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.2])
    off = np.linalg.norm(trace.ee_position - trace.path_position, axis=1)
    pressed = (trace.speed_scale < _SLOWED) & np.isfinite(trace.range_distance).any(axis=1)
    recovering = ~pressed & ((off > _OFF_PATH_M) | (trace.speed_scale < _SLOWED))
    left.plot(trace.path_position[:, 1], trace.path_position[:, 2], color="tab:blue", lw=4, alpha=0.3, label="path")
    for flags, colour, marker, label in (
        (pressed, "tab:red", "x", "obstacle sensed"),
        (recovering, "tab:green", "+", "recovering"),
    ):
        left.plot(*trace.ee_position[flags, 1:].T, marker, ms=3, color=colour, label=label)
    left.plot(*trace.ee_position[~(pressed | recovering), 1:].T, ".", ms=1, color="black", label="free")
    left.set_aspect("equal")
    left.set(xlabel="y [m]", ylabel="z [m]", title=f"End-effector, profile {profile}")
    left.legend(loc="center")
    right.plot(trace.time, np.linalg.norm(trace.ee_velocity, axis=1), color="black", lw=1, label="speed [m/s]")
    right.plot(trace.time, trace.speed_scale, color="tab:red", ls="--", label="speed factor, eqs. 3 and 4")
    right.plot(trace.time, off, color="tab:green", ls=":", label="distance from the path [m]")
    right.set(xlabel="time [s]", title="A hand comes from either side")
    right.legend(loc="center right")
    right.grid(alpha=0.3)
    return figure


def dynamic_figure(trace: Trace, units: tuple[str, ...], activation: float, profile: str) -> Figure:
    """Thirty seconds of interaction in three panels (paper, Fig. 5).

    Distances with the activation line, force with moving thresholds, end-effector velocity; along the axis of the
    largest push.
    """
    figure = Figure(figsize=(10, 8), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    styles = ("-", "--", "-.", ":")
    for k, unit in enumerate(units):
        top.plot(trace.time, trace.range_distance[:, k], styles[k % len(styles)], lw=1.2, label=unit)
    top.axhline(activation, color="black", ls=":", lw=2, label=f"d_max {activation:g} m")
    top.set(ylabel="distance [m]", title=f"Three pushes in thirty seconds, profile {profile}")
    top.legend(loc="upper right", fontsize="x-small", ncols=4)
    axis = int(np.argmax(np.abs(trace.true_force).max(axis=0)))
    _band(middle, trace, axis)
    middle.plot(trace.time, trace.force[:, axis], color="black", lw=0.8, label="estimate")
    middle.plot(trace.time, trace.filtered_force[:, axis], color="tab:blue", ls="--", lw=1, label="eq. 8")
    middle.set(ylabel=f"force along {_AXES[axis]} [N]")
    middle.legend(loc="upper right", fontsize="small")
    bottom.plot(trace.time, trace.ee_velocity[:, axis], color="black", lw=0.8)
    bottom.set(ylabel=f"velocity along {_AXES[axis]} [m/s]", xlabel="time [s]")
    for axes in (top, middle, bottom):
        _shade(axes, trace.time, trace.reacting, "tab:red")
        _shade(axes, trace.time, (trace.speed_scale < _SLOWED) & ~trace.reacting, "tab:blue")
        axes.grid(alpha=0.3)
    bottom.text(0.01, 0.03, "blue: slowed by an obstacle, red: reacting", transform=bottom.transAxes, fontsize="small")
    return figure


def _band(axes: Axes, trace: Trace, axis: int) -> None:
    axes.fill_between(
        trace.time, trace.lower[:, axis], trace.upper[:, axis], color="tab:gray", alpha=0.25, lw=0, label="thresholds"
    )
    axes.plot(trace.time, trace.upper[:, axis], color="tab:gray", lw=0.8)
    axes.plot(trace.time, trace.lower[:, axis], color="tab:gray", lw=0.8)


def _shade(axes: Axes, time: FloatArray, flags: BoolArray, colour: str) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        axes.axvspan(time[start], time[min(end, len(time) - 1)], color=colour, alpha=0.12, lw=0)
