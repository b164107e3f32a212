"""Figures of what detectors made of a recording: a force between thresholds, and joint torques with the evidence."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.imported_data.results import TorqueCourse
from pretouch.recording.compare import Decisions

_AXES = "xyz"


def decisions_figure(columns: Sequence[Decisions], title: str) -> Figure:
    """Draw force, value of eq. 8, thresholds and contacts of each detector, on one scale."""
    figure = Figure(figsize=(3 + 5 * len(columns), 8), layout="constrained")
    panels = figure.subplots(3, len(columns), sharex=True, sharey="row", squeeze=False)
    for column, decisions in zip(panels.T, columns, strict=True):
        name = decisions.name.replace(":", "\n")
        column[0].set_title(f"{name}\ncontacts: {len(decisions.contacts)}", fontsize="medium")
        for axis, axes in enumerate(column):
            _panel(axes, decisions, axis)
        column[-1].set_xlabel("time [s]")
    for axis, axes in enumerate(panels[:, 0]):
        axes.set_ylabel(f"force along {_AXES[axis]} [N]")
    panels[0, 0].legend(fontsize="x-small", ncols=2)
    figure.suptitle(title, fontsize="medium")
    return figure


def _panel(axes: Axes, d: Decisions, axis: int) -> None:
    axes.plot(d.time, d.force[:, axis], color="0.7", lw=0.8, label="estimate")
    axes.plot(d.time, d.compared[:, axis], color="tab:blue", lw=1.2, label="held against the thresholds")
    for bound, label in ((d.upper, "thresholds"), (d.lower, None)):
        armed = np.where(d.armed, bound[:, axis], np.nan)  # before the window is full it detects nothing
        axes.plot(d.time, armed, color="black", lw=1, label=label)
    for i, contact in enumerate(d.contacts):
        crossed = _AXES[axis] in contact.axes
        label = "contact (filled: this axis)" if i == 0 else None
        axes.axvline(contact.time_s, color="tab:red", lw=1, ls="-" if crossed else ":")
        force, fill = d.compared[d.time == contact.time_s, axis][0], "tab:red" if crossed else "white"
        axes.plot(contact.time_s, force, "v", color="tab:red", mec="black", ms=7, mfc=fill, label=label)
    axes.grid(alpha=0.3)


def torque_figure(d: TorqueCourse, joints: tuple[str, ...], title: str) -> Figure:
    """Draw one row a joint, and one for the evidence, with the contacts."""
    n = len(joints)
    figure = Figure(figsize=(11, 1.3 * n + 3), layout="constrained")
    panels = figure.subplots(n + 1, 1, sharex=True, height_ratios=(*[1.0] * n, 1.6))
    for j, axes in enumerate(panels[:-1]):
        axes.plot(d.time, d.tau_ext[:, j], color="0.7", lw=0.7, label="external torque")
        axes.plot(d.time, d.residual[:, j], color="tab:blue", lw=0.8, label="less what free motion explains")
        axes.set_ylabel(f"{joints[j]}\n[Nm]", fontsize="x-small")
    evidence = panels[-1]
    evidence.plot(d.time, d.evidence, color="black", lw=0.9)
    evidence.axhline(1.0, color="tab:red", lw=0.8, ls="--", label="a contact from here on")
    evidence.set_ylim(bottom=0.0)
    evidence.set_ylabel("evidence", fontsize="x-small")
    evidence.set_xlabel("time [s]")
    for k, contact in enumerate(d.contacts):
        for axes in panels:
            label = "contact" if k == 0 and axes is panels[0] else None
            end = max(contact.end_s or 0.0, contact.time_s + 0.01)
            axes.axvspan(contact.time_s, end, color="tab:red", alpha=0.25, label=label)
        if len(d.contacts) <= 40:
            where, link = (contact.time_s, 1.0), contact.link or ""  # names of several are longer than a panel is high
            evidence.annotate(link, where, (1, 2), textcoords="offset points", rotation=90, fontsize=5)
    for axes in panels:
        axes.set_rasterization_zorder(3)  # an hour as lines would be a page of 100 MB
        axes.grid(alpha=0.3)
        axes.tick_params(labelsize="x-small")
    panels[0].legend(fontsize="x-small", loc="upper right", ncols=3)
    evidence.legend(fontsize="x-small", loc="upper right")
    figure.suptitle(title, fontsize="medium")
    return figure
