"""Thirty seconds of interaction in three panels (paper, Fig. dynamic_obstacle_collision)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.profiles import Profile
from pretouch.recording.run_record import RunRecord
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import spans
from pretouch_lab.paper.figures.marks import AXES, Y, distances, force_with_thresholds, shade, slowed, touching


def interaction_figure(trace: RunRecord, units: tuple[str, ...], profile: Profile) -> Figure:
    """Distances with the activation line, force along y with moving thresholds, end-effector velocity along y."""
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
        shade(axes, trace.time, slowed(trace) & ~trace.reacting, "tab:blue", label="slowed")
        shade(axes, trace.time, trace.reacting | touching(trace), "tab:red", "////", label="contact and reaction")
        axes.grid(alpha=0.3)
    top.legend(loc="upper right", fontsize="x-small", ncols=5)
    middle.legend(loc="upper right", fontsize="x-small", ncols=6)
    bottom.legend(loc="upper right", fontsize="x-small", ncols=3)
    return figure


def _name_pushes(axes: Axes, trace: RunRecord) -> None:
    """Say at the foot of the panel which way each push went, as only one axis of the force is drawn."""
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
