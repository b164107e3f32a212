"""Figures of the paper, drawn from the time courses of trials."""

from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.sequential_test import SequentialTest
from pretouch.params import ProximityPriorParams
from pretouch.profiles import Profile
from pretouch.profiles import profile as find_profile
from pretouch.recording.run_record import RunRecord
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import spans
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.trial import Trace

BLIND, SENSING, OURS = "tab:blue", "tab:red", "tab:green"
AXES = "xyz"
Y = 1
"""Axis in the paper's figures."""
_SLOWED = 0.99
"""Speed factor below which the arm counts as slowed."""
Look = dict[str, Any]
_COLOURS = ("black", "tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:gray")
_LINES, _MARKERS = ("-", "--", "-", ":", "-.", "--", "-"), ("", "", "o", "s", "", "^", "")
"""Colour, line and marker of each unit; the eighth unit has those of the first again."""
_MARKS = 60
"""Number of markers along a line."""


def shade(axes: Axes, time: FloatArray, flags: BoolArray, colour: str, hatch: str = "", label: str = "") -> None:
    """Shade the spans of time (S,) [s] with flags (S,); a hatch distinguishes them in grey."""
    look: Look = {"facecolor": (colour, 0.15), "edgecolor": (colour, 0.4), "lw": 0, "hatch": hatch, "zorder": 0}
    for i, (start, end) in enumerate(spans(flags)):
        axes.axvspan(time[start], time[min(end, len(time) - 1)], label=label if i == 0 else None, **look)


def near(trace: RunRecord, d_max: float) -> BoolArray:
    """Return flags (S,) of the steps with an obstacle within d_max [m] of the end-effector's origin."""
    return np.asarray(np.linalg.norm(trace.nearest_point - trace.ee_position, axis=1) < d_max)


def touching(trace: RunRecord) -> BoolArray:
    """Return flags (S,) of the steps with a true contact."""
    return np.linalg.norm(trace.true_force, axis=1) > TOUCH_N


def distances(axes: Axes, trace: RunRecord, units: tuple[str, ...]) -> None:
    """Draw the distance that each unit reads, with zones the least."""
    boards = [unit.partition("/")[0] for unit in units]
    for k, unit in enumerate(dict.fromkeys(boards)):
        colour, line, marker = (each[k % len(each)] for each in (_COLOURS, _LINES, _MARKERS))
        marks: Look = {"marker": marker, "ms": 4, "markevery": max(1, len(trace.time) // _MARKS)}
        distance = np.fmin.reduce(trace.range_distance[:, [name == unit for name in boards]], axis=1)
        axes.plot(trace.time, distance, line, color=colour, lw=1.2, label=unit.replace("_", " "), **marks)
    axes.set_ylabel("distance read [m]")


def force_with_thresholds(axes: Axes, trace: RunRecord, axis: int, profile: Profile) -> None:
    """Draw the force estimate along an axis, the value of eq. 8 and the moving thresholds.

    For a detector without thresholds, draw the band in which a single sample is no contact.
    """
    paper = isinstance(profile.detect, MovingThresholds)
    bounds = "thresholds" if paper else "bands of one sample"
    axes.plot(trace.time, trace.upper[:, axis], color="black", lw=1, label=bounds)
    axes.plot(trace.time, trace.lower[:, axis], color="black", lw=1)
    axes.plot(trace.time, trace.force[:, axis], color="0.7", lw=0.8, label="estimate")
    if paper:
        axes.plot(
            trace.time, trace.filtered_force[:, axis], color="tab:blue", lw=1.8, ls=(0, (4, 1)), label="value of eq. 8"
        )
    alarms, force = trace.detected, trace.filtered_force if paper else trace.force
    axes.plot(trace.time[alarms], force[alarms, axis], "v", color="tab:red", mec="black", ms=8, label="detected")
    axes.set_ylabel(f"force along {AXES[axis]} [N]")


_OFF_PATH_M = 0.01
_POINTS = 12
"""One sensed point is drawn for each of these steps."""


def circle(traces: list[Trace], _units: tuple[str, ...]) -> Figure:
    """Draw the end-effector's path: free, avoiding an obstacle (red), recovering (green); and speed over time."""
    trace, profile = _first(traces)
    figure = Figure(figsize=(9, 9), layout="constrained")
    plane, course, aside = figure.subplots(3, 1, height_ratios=[1.9, 0.8, 0.6])
    off = np.linalg.norm(trace.ee_position - trace.path_position, axis=1)
    disturbed = (trace.speed_scale < _SLOWED) | (off > _OFF_PATH_M)
    avoiding = disturbed & near(trace, profile.d_max_m)
    recovering = disturbed & ~avoiding
    _plane(plane, trace, avoiding, recovering, profile)
    course.plot(trace.time, np.linalg.norm(trace.ee_velocity, axis=1), color="black", lw=1, label="speed [m/s]")
    course.plot(trace.time, trace.speed_scale, color="tab:orange", ls="--", lw=1.5, label="speed factor, eqs. 3 and 4")
    course.set(ylabel="speed [m/s], factor", ylim=(0.0, 1.35))
    aside.plot(trace.time, 1000 * off, color="black", lw=1)
    aside.set(xlabel="time [s]", ylabel="off the path [mm]")
    for axes in (course, aside):
        axes.set_xlim(trace.time[0], trace.time[-1])
        shade(axes, trace.time, avoiding, "tab:red", label="avoidance")
        shade(axes, trace.time, recovering, "tab:green", "////", label="recovery")
        axes.grid(alpha=0.3)
    course.legend(loc="upper right", ncols=4, fontsize="small")
    return figure


def _first(traces: list[Trace]) -> tuple[RunRecord, Profile]:
    (cell, trace), *_ = traces
    return trace, find_profile(cell["profile"])


def _plane(axes: Axes, trace: RunRecord, avoiding: BoolArray, recovering: BoolArray, profile: Profile) -> None:
    """Draw path, end-effector and the obstacles nearest to it in the plane of the circle."""
    ee = trace.ee_position
    axes.plot(*trace.path_position[:, 1:].T, color="tab:blue", lw=7, alpha=0.3, label="path")
    axes.plot(*_where(ee, ~avoiding & ~recovering), color="black", lw=0.8, label="free")
    axes.plot(*_where(ee, avoiding), color="tab:red", lw=2.2, zorder=4, label="avoidance")
    axes.plot(*_where(ee, recovering), color="tab:green", lw=2.2, ls=(0, (2, 1)), zorder=3, label="recovery")
    points = trace.nearest_point[near(trace, profile.d_max_m) & avoiding][::_POINTS]
    axes.plot(*points[:, 1:].T, "o", color="limegreen", mec="black", mew=0.4, ms=4, ls="", label="sensed objects")
    axes.set_aspect("equal")
    axes.set(
        xlabel="y [m]", ylabel="z [m]", title=f"End-effector while a hand comes on either side, profile {profile.name}"
    )
    axes.legend(loc="center", fontsize="small")
    axes.grid(alpha=0.3)


def _where(position: FloatArray, flags: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return y and z (S,) [m] where flags hold, else NaN, so that a line of them breaks there."""
    line = np.where(flags[:, None], position, np.nan)
    return line[:, 1], line[:, 2]


def interaction(traces: list[Trace], units: tuple[str, ...]) -> Figure:
    """Draw distances with the activation line, force along y with moving thresholds, and velocity along y."""
    trace, profile = _first(traces)
    figure = Figure(figsize=(10, 8.4), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    distances(top, trace, units)
    d_max = profile.d_max_m
    if profile.slow is not None or isinstance(profile.detect, MovingThresholds):
        top.axhline(d_max, color="black", ls=":", lw=2.5, label=f"activation, d_max {d_max:g} m")
    top.set(ylim=(0.0, 1.4), title=f"Three pushes in thirty seconds, profile {profile.name}")
    force_with_thresholds(middle, trace, Y, profile)
    _name_pushes(middle, trace)
    bottom.plot(trace.time, trace.ee_velocity[:, Y], color="black", lw=1, label="end-effector")
    bottom.set(ylabel=f"velocity along {AXES[Y]} [m/s]", xlabel="time [s]", xlim=(trace.time[0], trace.time[-1]))
    for axes in (top, middle, bottom):
        shade(axes, trace.time, (trace.speed_scale < _SLOWED) & ~trace.reacting, "tab:blue", label="slowed")
        shade(axes, trace.time, trace.reacting | touching(trace), "tab:red", "////", label="contact and reaction")
        axes.grid(alpha=0.3)
    top.legend(loc="upper right", fontsize="x-small", ncols=5)
    middle.legend(loc="upper right", fontsize="x-small", ncols=6)
    bottom.legend(loc="upper right", fontsize="x-small", ncols=3)
    return figure


def _name_pushes(axes: Axes, trace: RunRecord) -> None:
    """Write the direction of each push at the foot of the panel, which shows only one axis of the force."""
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.15 * (high - low), high + 0.2 * (high - low))
    last = -np.inf
    for start, end in spans(touching(trace)):
        force = trace.true_force[start:end].mean(axis=0)
        if trace.time[start] > last + 1.0 and np.abs(force).max() > TOUCH_N:
            axis = int(np.abs(force).argmax())
            text = f"pushed {'-+'[int(force[axis] > 0)]}{AXES[axis]}"
            axes.text(trace.time[start], low - 0.1 * (high - low), text, fontsize="small", ha="center", va="center")
        last = float(trace.time[end - 1])


_BEFORE_S, _AFTER_S = 4.0, 2.5
"""Time shown before and after the first contact [s]."""


def close_up(traces: list[Trace], units: tuple[str, ...]) -> Figure:
    """Draw distances with the region of interest, and force along y with thresholds, around the first contact."""
    trace, profile = _first(traces)
    figure = Figure(figsize=(9, 6.4), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    distances(top, trace, units)
    detector, near = profile.detect, ProximityPriorParams()
    paper = isinstance(detector, MovingThresholds)
    if isinstance(detector, SequentialTest):
        near = detector.proximity or near
    d_max, name = (
        (detector.d_max_m, "d_max") if isinstance(detector, MovingThresholds) else (2.0 * near.error_m, "near")
    )
    top.axhspan(0.0, d_max, facecolor="gold", alpha=0.18, zorder=0)
    top.axhline(d_max, color="black", ls=":", lw=2.5, label=f"{name} {d_max:g} m")
    top.annotate("region of interest", (0.01, d_max), (0, -5), ("axes fraction", "data"), "offset points", va="top")
    top.set(ylim=(0.0, 1.4), title=f"Objects on both sides of the robot's hand, profile {profile.name}")
    force_with_thresholds(bottom, trace, Y, profile)
    if paper:
        without = trace.upper + trace.obstacle_negative, trace.lower - trace.obstacle_positive
        bottom.plot(trace.time, without[0][:, Y], color="black", ls=":", label="thresholds without F_obs")
        bottom.plot(trace.time, without[1][:, Y], color="black", ls=":")
    both = (trace.obstacle_positive[:, Y] > 0) & (trace.obstacle_negative[:, Y] > 0)
    for axes in (top, bottom):
        shade(axes, trace.time, both, "tab:red", label="both bounds lowered")
        shade(axes, trace.time, touching(trace), "black", "////", label="touched")
        axes.grid(alpha=0.3)
    bottom.set(xlabel="time [s]", xlim=_window(trace))
    top.legend(loc="upper right", fontsize="x-small", ncols=5)
    bottom.legend(loc="upper left", fontsize="x-small", ncols=2)
    return figure


def _window(trace: RunRecord) -> tuple[float, float]:
    """Return the first and last instant to show [s]: around the first contact, or all without a contact."""
    touched = np.flatnonzero(touching(trace))
    if len(touched) == 0:
        return float(trace.time[0]), float(trace.time[-1])
    at = float(trace.time[touched[0]])
    return at - _BEFORE_S, at + _AFTER_S


def force_difference(traces: list[Trace], _units: tuple[str, ...]) -> Figure:
    """Draw the force along y with the band between the thresholds, around contact, for each place of the object.

    Blind is blue, the first of the other profiles red, the second green.
    """
    names = list(dict.fromkeys(cell["profile"] for cell, _ in traces))
    others = [name for name in names if name != "blind"]
    styles = {"blind": (BLIND, "...."), **dict(zip(others, ((SENSING, ""), (OURS, "")), strict=False))}
    figure = Figure(figsize=(10, 6.8), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for axes, (trajectory, side) in zip(panels.flat, product(("circle", "line"), ("-y", "+y")), strict=True):
        for cell, trace in traces:
            if (cell["trajectory"], cell["side"]) == (trajectory, side):
                _force(axes, trace, -1.0 if side == "+y" else 1.0, cell["profile"], *styles[cell["profile"]])
        axes.set(title=f"{trajectory}, object at {side}", xlim=(-1.0, 0.6))
        axes.grid(alpha=0.3)
    if panels[0, 0].lines:
        panels[0, 0].legend(loc="upper left", fontsize="small")
    figure.supxlabel("time from first touch [s]")
    figure.supylabel("force along y, away from the object [N]")
    figure.suptitle(f"Contact with a static object: force estimate and contact thresholds, {', '.join(names)}")
    return figure


def _force(axes: Axes, trace: RunRecord, push: float, name: str, colour: str, hatch: str) -> None:
    """Draw the estimate and its detection; for thresholds also their band until then, and the value of eq. 8."""
    style, filtered, marker = ("--", ":", "o") if hatch else ("-", "-.", "s")
    touched = np.flatnonzero(touching(trace))
    if len(touched) == 0:
        return
    time = trace.time - trace.time[touched[0]]
    alarms = np.flatnonzero(trace.detected & (time >= 0))
    before = time <= (time[alarms[0]] if len(alarms) else time[-1])
    if isinstance(find_profile(name).detect, MovingThresholds):
        band = push * trace.lower[before, Y], push * trace.upper[before, Y]
        look: Look = {"facecolor": (colour, 0.15), "edgecolor": (colour, 0.5), "lw": 0.8, "ls": style, "hatch": hatch}
        axes.fill_between(time[before], *band, label=f"{name}: between thresholds", **look)
        axes.plot(time, push * trace.filtered_force[:, Y], color=colour, ls=filtered, lw=1.2, label=f"{name}: eq. 8")
    axes.plot(time, push * trace.force[:, Y], color=colour, ls=style, label=f"{name}: estimate")
    axes.plot(time[alarms], push * trace.force[alarms, Y], marker, color=colour, mec="black", label=f"{name}: detected")
