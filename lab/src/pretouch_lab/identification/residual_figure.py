"""A figure of an identified arm: each joint's residual over time with what is explained, and its autocorrelation."""

import numpy as np
from matplotlib.figure import Figure

from pretouch.robot.model import RobotModel
from pretouch_lab.identification.identify import Identified

_MOST_POINTS = 4000


def residual_figure(found: Identified, model: RobotModel, title: str) -> Figure:
    """Draw one row a joint."""
    figure = Figure(figsize=(11, 1.6 * model.n + 1), layout="constrained")
    panels = figure.subplots(model.n, 2, sharex="col", squeeze=False, width_ratios=(3, 1))
    time, every = found.time - found.time[0], max(1, len(found.time) // _MOST_POINTS)
    lags = found.noise.period_s * np.arange(len(found.noise.autocorrelation))
    for j, (left, right) in enumerate(panels):
        left.plot(time[::every], found.tau[::every, j], color="0.7", lw=0.6, label="residual")
        left.plot(time[::every], found.fit.expected[::every, j], color="tab:blue", lw=0.9, label="explained")
        for k, (begin, end) in enumerate(found.spans):
            label = "left out" if k == 0 else None
            left.axvspan(begin - found.time[0], end - found.time[0], color="tab:red", alpha=0.2, label=label)
        left.set_ylabel(f"{model.joints[j]}\n[Nm]", fontsize="small")
        right.plot(lags, found.noise.autocorrelation[:, j], color="0.5", marker=".", label="about the mean")
        right.plot(
            lags, found.noise.left_autocorrelation[:, j], color="tab:blue", marker=".",
            label="less the velocities' noise",
        )  # fmt: skip
        right.axhline(0.0, color="black", lw=0.5)
    panels[-1][0].set_xlabel("time [s]")
    panels[-1][1].set_xlabel("lag [s]")
    panels[0][0].legend(fontsize="x-small", loc="upper right")
    panels[0][1].legend(fontsize="x-small")
    panels[0][1].set_title("autocorrelation", fontsize="small")
    figure.suptitle(title, fontsize="medium")
    return figure
