"""Threshold close-up: objects on opposite sides lower both bounds (paper, Fig. contact_threshold)."""

import numpy as np
from matplotlib.figure import Figure

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.sequential_test import SequentialTest
from pretouch.params import ProximityPriorParams
from pretouch.profiles import Profile
from pretouch.recording.run_record import RunRecord
from pretouch_lab.paper.figures.marks import Y, distances, force_with_thresholds, shade, touching

_BEFORE_S, _AFTER_S = 4.0, 2.5


def close_up_figure(trace: RunRecord, units: tuple[str, ...], profile: Profile) -> Figure:
    """Distances with the region that matters, and force along y with thresholds, about the first touch."""
    figure = Figure(figsize=(9, 6.4), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    distances(top, trace, units)
    detector, near = profile.detect, ProximityPriorParams()
    paper = isinstance(detector, MovingThresholds)
    if isinstance(detector, SequentialTest):
        near = detector.proximity or near
    d_max, name = (detector.d_max_m, "d_max") if isinstance(detector, MovingThresholds) else (near.distance_m, "near")
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
    """First and last instant to show [s]: about the first touch, or all where there is none."""
    touched = np.flatnonzero(touching(trace))
    if len(touched) == 0:
        return float(trace.time[0]), float(trace.time[-1])
    at = float(trace.time[touched[0]])
    return at - _BEFORE_S, at + _AFTER_S
