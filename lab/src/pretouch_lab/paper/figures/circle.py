"""End-effector on the circle with avoidance and recovery (paper, Fig. ee_trajectory)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.profiles import Profile
from pretouch.recording.run_record import RunRecord
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.paper.figures.marks import near, shade, slowed

_OFF_PATH_M = 0.01
_POINTS = 12
"""One in so many sensed points is drawn."""


def circle_figure(trace: RunRecord, profile: Profile) -> Figure:
    """End-effector path: free, avoiding what is sensed (red), recovering (green); and its course in time."""
    figure = Figure(figsize=(9, 9), layout="constrained")
    plane, course, aside = figure.subplots(3, 1, height_ratios=[1.9, 0.8, 0.6])
    off = np.linalg.norm(trace.ee_position - trace.path_position, axis=1)
    disturbed = slowed(trace) | (off > _OFF_PATH_M)
    avoiding = disturbed & near(trace, profile.d_max_m)
    recovering = disturbed & ~avoiding
    _plane(plane, trace, avoiding, recovering, profile)
    course.plot(trace.time, np.linalg.norm(trace.ee_velocity, axis=1), color="black", lw=1, label="speed [m/s]")
    course.plot(trace.time, trace.speed_scale, color="tab:orange", ls="--", lw=1.5, label="speed factor, eqs. 3 and 4")
    course.set(ylabel="speed [m/s], factor", ylim=(0.0, 1.35), xlim=(trace.time[0], trace.time[-1]))
    aside.plot(trace.time, 1000 * off, color="black", lw=1)
    aside.set(xlabel="time [s]", ylabel="off the path [mm]", xlim=(trace.time[0], trace.time[-1]))
    for axes in (course, aside):
        shade(axes, trace.time, avoiding, "tab:red", label="avoidance")
        shade(axes, trace.time, recovering, "tab:green", "////", label="recovery")
        axes.grid(alpha=0.3)
    course.legend(loc="upper right", ncols=4, fontsize="small")
    return figure


def _plane(axes: Axes, trace: RunRecord, avoiding: BoolArray, recovering: BoolArray, profile: Profile) -> None:
    """Draw path, end-effector and sensed points in the plane of the circle."""
    ee = trace.ee_position
    axes.plot(*trace.path_position[:, 1:].T, color="tab:blue", lw=7, alpha=0.3, label="path")
    axes.plot(*_where(ee, ~avoiding & ~recovering), color="black", lw=0.8, label="free")
    axes.plot(*_where(ee, avoiding), color="tab:red", lw=2.2, zorder=4, label="avoidance")
    axes.plot(*_where(ee, recovering), color="tab:green", lw=2.2, ls=(0, (2, 1)), zorder=3, label="recovery")
    within = np.linalg.norm(trace.sensed_point - ee[:, None], axis=2) < profile.d_max_m
    points = trace.sensed_point[within & avoiding[:, None]][::_POINTS]
    axes.plot(*points[:, 1:].T, "o", color="limegreen", mec="black", mew=0.4, ms=4, ls="", label="sensed objects")
    axes.set_aspect("equal")
    axes.set(
        xlabel="y [m]", ylabel="z [m]", title=f"End-effector while a hand comes on either side, profile {profile.name}"
    )
    axes.legend(loc="center", fontsize="small")
    axes.grid(alpha=0.3)


def _where(position: FloatArray, flags: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Split into y and z (S,) [m] where flags hold, NaN elsewhere, so that a line drawn of them is broken there."""
    kept = np.where(flags[:, None], position, np.nan)
    return kept[:, 1], kept[:, 2]
