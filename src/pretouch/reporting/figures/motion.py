"""Distances and speeds over time, and the way of the end-effector."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.control.approach import notice_m, of_table_i
from pretouch.recording.run_record import MODES
from pretouch.reporting.course import Course
from pretouch.reporting.figures.marks import BLUE, GREEN, GREY, INK, LINES, RED, draw, legend, panels, plain
from pretouch.types import BoolArray, FloatArray, Mode

_POINTS = 4000
"""Positions of the end-effector that are drawn."""
_SENSED = 400
"""Sensed points that are drawn."""
_LEAST_SIDE_M = 0.4
_COLOURS = {Mode.TRACK: INK, Mode.REACT: RED, Mode.HOLD: GREY}


def motion_figure(course: Course) -> Figure:
    """Distance of what each unit showed from the body, where proximity was used; speed; speed factor."""
    if course.proximity_used:
        figure, (top, *rest) = panels(3, course, (1.5, 1, 0.6), 7.6)
        _distances(top, course)
    else:
        figure, rest = panels(2, course, (1, 0.6), 4.6)
    draw(rest[0], course.time, course.speed, color=BLUE, lw=1.0)
    rest[0].set_ylabel("end-effector [m/s]")
    rest[0].set_ylim(bottom=0.0)
    draw(rest[1], course.time, course.speed_scale, color=INK, lw=1.0)
    rest[1].set(ylabel="speed factor", ylim=(-0.05, 1.1))
    return figure


def _distances(axes: Axes, course: Course) -> None:
    """Draw what the units showed, and the distances from which it matters."""
    for k, unit in enumerate(course.units):
        colour, style = LINES[k % len(LINES)]
        draw(axes, course.time, course.body_distance[:, k], color=colour, ls=style, lw=1.1, label=plain(unit))
    d_crit = course.of_runs(lambda run: of_table_i(run.profile.approach).d_crit_m)
    d_notice = course.of_runs(lambda run: notice_m(run.profile.approach))
    draw(axes, course.time, d_notice, color=INK, lw=0.9, ls=(0, (1, 3)), label="d_notice")
    draw(axes, course.time, d_crit, color=RED, lw=0.9, ls=(0, (1, 3)), label="d_crit")
    axes.axhline(0.0, color=INK, lw=0.8)
    axes.set_ylabel("distance from the body [m]")
    legend(axes, 5)


def path_figure(course: Course) -> Figure:
    """Path, end-effector by mode, and the nearest sensed points, seen from the front (+x)."""
    figure = Figure(figsize=(7.2, 5.6), layout="constrained")
    axes: Axes = figure.subplots()
    every = slice(None, None, max(1, len(course) // _POINTS))
    ee, way, mode = course.ee_position[every], course.path_position[every], course.mode[every]
    axes.plot(way[:, 1], way[:, 2], color=BLUE, lw=6, alpha=0.25, solid_capstyle="round", label="path")
    for i, name in enumerate(MODES):
        if np.any(mode == i):
            axes.plot(*_where(ee, mode == i), color=_COLOURS[name], lw=1.5, label=name.name)
    d_max = course.of_runs(lambda run: run.profile.d_max_m)
    near = np.flatnonzero(course.ee_distance < d_max)
    point = course.nearest_point[near[:: max(1, len(near) // _SENSED)]]
    if len(point):
        style: Any = {"color": GREEN, "alpha": 0.5, "mew": 0, "ms": 3.5, "zorder": 1, "label": "nearest sensed"}
        axes.plot(point[:, 1], point[:, 2], "o", **style)
    axes.set_aspect("equal")
    _widen(axes)
    axes.set(xlabel="y [m]", ylabel="z [m]")
    axes.grid(alpha=0.25, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    return figure


def _where(position: FloatArray, flags: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Split into y and z (S,) [m] where flags hold or held a step before, NaN elsewhere: the line breaks there."""
    shown = flags | np.concatenate([[False], flags[:-1]])
    kept = np.where(shown[:, None], position, np.nan)
    return kept[:, 1], kept[:, 2]


def _widen(axes: Axes) -> None:
    """Show at least `_LEAST_SIDE_M` in either direction: a straight path has no height."""
    for get, put in ((axes.get_xlim, axes.set_xlim), (axes.get_ylim, axes.set_ylim)):
        low, high = get()
        lacking = max(0.0, _LEAST_SIDE_M - (high - low)) / 2
        put(low - lacking, high + lacking)


def joint_figure(course: Course, speed: FloatArray, acceleration: FloatArray) -> Figure:
    """Distance from the position limits by joint; speed and acceleration (S, n) of the worst joint as fractions."""
    figure, (top, bottom) = panels(2, course, (1.2, 1), 5.2)
    for j in range(course.q_margin.shape[1]):
        colour, style = LINES[j % len(LINES)]
        draw(top, course.time, course.q_margin[:, j], color=colour, ls=style, lw=1.1, label=f"joint {j + 1}")
    top.axhline(0.0, color=RED, lw=1.0)
    top.set_ylabel("to position limit [rad]")
    legend(top, 9)
    for values, colour, name in ((acceleration, GREY, "acceleration"), (speed, BLUE, "velocity")):
        worst = np.where(np.isfinite(values), values, -np.inf).max(axis=1, initial=-np.inf)
        draw(bottom, course.time, np.where(worst < 0, np.nan, worst), color=colour, lw=0.9, label=name)
    bottom.axhline(1.0, color=RED, lw=1.0, label="limit")
    bottom.set_ylabel("fraction of limit")
    legend(bottom, 5)
    return figure
