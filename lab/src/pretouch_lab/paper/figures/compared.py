"""The same experiment with several profiles, one over the other: how fast each arm was, and how hard it was touched."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.recording.run_record import RunRecord
from pretouch.types import FloatArray
from pretouch_lab.paper.figures.marks import BLIND, OURS, SENSING, labels

_STYLES = ((BLIND, "--", "o"), (SENSING, "-", "s"), (OURS, "-.", "v"))
"""Colour, line and mark of each profile, in the order in which they are shown; more profiles than these begin again."""


def compared_figure(scenes: Mapping[str, Mapping[str, RunRecord]]) -> Figure:
    """Speed of the end-effector and true force on the arm over time, one column a scene.

    Args:
        scenes: by the scene's title, the course with each profile by its name.
    """
    figure = Figure(figsize=(10, 5.2), layout="constrained")
    panels = figure.subplots(2, len(scenes), sharex="col", sharey="row", squeeze=False)
    for (title, courses), (above, below) in zip(scenes.items(), panels.T, strict=True):
        above.set_title(title)
        below.set_xlabel("time [s]")
        for order, (name, course) in enumerate(courses.items()):
            style = _STYLES[order % len(_STYLES)]
            _line(above, course, course.speed, style, name)
            _line(below, course, np.linalg.norm(course.true_force, axis=1), style, name)
        for axes in (above, below):
            axes.grid(alpha=0.3)
    panels[0, 0].set_ylabel("speed of the end-effector [m/s]")
    panels[1, 0].set_ylabel("true force, mean of a step [N]")
    handles, names = labels(panels.ravel())
    figure.legend(handles, names, loc="outside lower center", ncols=2 * len(_STYLES), fontsize="small")
    return figure


def _line(axes: Axes, course: RunRecord, values: FloatArray, style: tuple[str, str, str], name: str) -> None:
    """Draw one course, with a mark where a contact was detected."""
    (colour, dashes, mark), found = style, course.detected
    axes.plot(course.time, values, color=colour, ls=dashes, lw=1.2, label=name)
    axes.plot(
        course.time[found], values[found], mark, ls="", color=colour, mec="black", ms=7, label=f"{name}: detected"
    )
