"""A figure of what a detector makes of joint torques: each joint's, what free motion leaves of it, and the evidence."""

import numpy as np
from matplotlib.figure import Figure

from pretouch.imported_data.torque_detect import TorqueDecisions
from pretouch.types import FloatArray

_POINTS = 3000
"""Stretches of time that a line is drawn in."""


def torque_figure(d: TorqueDecisions, joints: tuple[str, ...], title: str) -> Figure:
    """Draw one row a joint, and one for the evidence, with the contacts."""
    n = len(joints)
    figure = Figure(figsize=(11, 1.3 * n + 3), layout="constrained")
    panels = figure.subplots(n + 1, 1, sharex=True, height_ratios=(*[1.0] * n, 1.6))
    for j, axes in enumerate(panels[:-1]):
        axes.plot(*_drawn(d.time, d.tau_ext[:, j]), color="0.7", lw=0.7, label="external torque")
        axes.plot(*_drawn(d.time, d.residual[:, j]), color="tab:blue", lw=0.8, label="less what free motion explains")
        axes.set_ylabel(f"{joints[j]}\n[Nm]", fontsize="x-small")
    evidence = panels[-1]
    evidence.plot(*_drawn(d.time, d.evidence), color="black", lw=0.9)
    evidence.axhline(1.0, color="tab:red", lw=0.8, ls="--", label="a contact from here on")
    evidence.set_ylim(bottom=0.0)
    evidence.set_ylabel("evidence", fontsize="x-small")
    evidence.set_xlabel("time [s]")
    for k, contact in enumerate(d.contacts):
        for axes in panels:
            label = "contact" if k == 0 and axes is panels[0] else None
            axes.axvspan(contact.time, max(contact.end, contact.time + 0.01), color="tab:red", alpha=0.25, label=label)
        if len(d.contacts) <= 40:
            evidence.annotate(
                contact.link, (contact.time, 1.0), (1, 2), textcoords="offset points", rotation=90, fontsize=5
            )
    for axes in panels:
        axes.grid(alpha=0.3)
        axes.tick_params(labelsize="x-small")
    panels[0].legend(fontsize="x-small", loc="upper right", ncols=3)
    evidence.legend(fontsize="x-small", loc="upper right")
    figure.suptitle(title, fontsize="medium")
    return figure


def _drawn(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least and greatest value of each stretch of a long course (S,)."""
    every = len(time) // _POINTS
    if every < 2:
        return time, values
    count = len(time) // every
    parts = values[: count * every].reshape(count, every)
    ends = np.stack([parts.min(axis=1), parts.max(axis=1)], axis=1)
    return np.repeat(time[: count * every : every], 2), ends.ravel()
