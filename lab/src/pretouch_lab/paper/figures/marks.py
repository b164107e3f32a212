"""What several figures draw alike."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.profiles import Profile
from pretouch.recording.run_record import RunRecord
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import spans
from pretouch.types import BoolArray, FloatArray

BLIND, SENSING, OURS = "tab:blue", "tab:red", "tab:green"
AXES = "xyz"
Y = 1
"""The axis the paper's figures show."""
_SLOWED = 0.99
_UNITS = (
    ("black", "-", ""), ("tab:blue", "--", ""), ("tab:orange", "-", "o"), ("tab:green", ":", "s"),
    ("tab:red", "-.", ""), ("tab:purple", "--", "^"), ("tab:gray", "-", ""),
)  # fmt: skip
"""Colour, line and marker of each unit; more units than these begin again."""
_MARKS = 60
"""Markers along a line over the whole of a trace."""


def labels(panels: Iterable[Axes]) -> tuple[list[Any], list[str]]:
    """Handles and labels of all panels, each label once: not every panel has all of them."""
    found = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    return list(found.values()), list(found)


def shade(axes: Axes, time: FloatArray, flags: BoolArray, colour: str, hatch: str = "", label: str = "") -> None:
    """Shade the spans of time (S,) [s] in which flags (S,) hold; a hatch tells it from others in grey."""
    for i, (start, end) in enumerate(spans(flags)):
        axes.axvspan(
            time[start], time[min(end, len(time) - 1)], facecolor=(colour, 0.15), edgecolor=(colour, 0.4), lw=0,
            hatch=hatch, label=label if i == 0 else None, zorder=0,
        )  # fmt: skip


def near(trace: RunRecord, d_max: float) -> BoolArray:
    """Whether anything sensed in each step (S,) is within d_max [m] of the end-effector's origin."""
    distance = np.linalg.norm(trace.sensed_point - trace.ee_position[:, None], axis=2)
    return np.any(distance < d_max, axis=1)


def slowed(trace: RunRecord) -> BoolArray:
    """Whether the arm is slowed in each step (S,)."""
    return trace.speed_scale < _SLOWED


def touching(trace: RunRecord) -> BoolArray:
    """Whether something truly touches the arm in each step (S,)."""
    return np.linalg.norm(trace.true_force, axis=1) > TOUCH_N


def distances(axes: Axes, trace: RunRecord, units: tuple[str, ...]) -> None:
    """Draw the distance each unit reads."""
    for k, unit in enumerate(units):
        colour, style, marker = _UNITS[k % len(_UNITS)]
        axes.plot(
            trace.time, trace.range_distance[:, k], style, color=colour, lw=1.2, marker=marker, ms=4,
            markevery=max(1, len(trace.time) // _MARKS), label=unit.replace("_", " "),
        )  # fmt: skip
    axes.set_ylabel("distance read [m]")


def force_with_thresholds(axes: Axes, trace: RunRecord, axis: int, profile: Profile) -> None:
    """Draw the force estimate along an axis, the value of eq. 8 and the moving thresholds.

    Of a detector without thresholds, the bands in which one sample alone is no contact.
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
    found, force = trace.detected, trace.filtered_force if paper else trace.force
    axes.plot(trace.time[found], force[found, axis], "v", color="tab:red", mec="black", ms=8, label="detected")
    axes.set_ylabel(f"force along {AXES[axis]} [N]")
