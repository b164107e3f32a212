"""Figures of a report, drawn from the course of a recording as SVG."""

from base64 import b64encode
from collections.abc import Sequence
from contextlib import AbstractContextManager
from html import escape
from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.recording.run_record import MODES
from pretouch.reporting.contacts import AXES
from pretouch.reporting.html import Html, element, html
from pretouch.reporting.measures import d_crit, d_notice
from pretouch.reporting.record import RunCourse
from pretouch.types import Mode

INK, BLUE, RED, GREEN, AMBER, GREY = "#1f2933", "#2b6cb0", "#c53030", "#2f855a", "#b7791f", "#a0aab4"
_SHADES = {Mode.REACT: (RED, 0.16), Mode.HOLD: (GREY, 0.28)}
_LINE_COLOURS = (BLUE, AMBER, GREEN, INK, "#805ad5", "#b83280", "#0b7285", GREY)
_LINES = tuple(zip(_LINE_COLOURS, ("-", "--", "-.", ":", "-", "--", "-.", "-"), strict=True))
"""Colour and style of each of several lines; more lines than these begin again."""
_SWITCHES = 12
"""More changes of the profile than this are not drawn."""
_MARKS = 3
"""Order of what is drawn over the lines, and never as pixels."""
_MOST_DRAWN = 3000
"""Steps beyond which lines are drawn as pixels: an hour of them would be a page of 100 MB."""
_STYLE: Any = {
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.edgecolor": "#616e7c",
    "axes.formatter.useoffset": False,
    "path.simplify_threshold": 0.3,
    "svg.hashsalt": "pretouch",
    "svg.fonttype": "path",
}


def style() -> AbstractContextManager[None]:
    """Context in which the figures of a report are made and drawn."""
    return matplotlib.rc_context(_STYLE)


def picture(figure: Figure, text: str) -> Html:
    """Draw a figure as SVG into the page, with a caption: no file beside it, nothing to fetch."""
    image, metadata = BytesIO(), {"Date": None, "Creator": None}
    figure.savefig(image, format="svg", dpi=160, bbox_inches="tight", pad_inches=0.05, metadata=metadata)
    data = b64encode(image.getvalue()).decode("ascii")
    drawn = Html(f'<img src="data:image/svg+xml;base64,{data}" alt="{escape(text)}">')
    return element("figure", Html(drawn + element("figcaption", html(text))))


def _panels(course: RunCourse, heights: Sequence[float], height: float) -> tuple[Figure, list[Axes]]:
    """Make a figure of panels one below the other that share the time of a course."""
    figure = Figure(figsize=(10, height), layout="constrained")
    panels: list[Axes] = list(figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0])
    switches = course.time[1:][np.diff(course.run) != 0]
    for axes in panels:
        axes.grid(alpha=0.25, lw=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        if len(course) > _MOST_DRAWN:
            axes.set_rasterization_zorder(_MARKS)
        axes.margins(x=0)
        for mode, colour in _SHADES.items():
            flags = course.mode == MODES.index(mode)
            if flags.any():
                until = flags | np.append(False, flags[:-1])  # a mode lasts until the next step
                whole = axes.get_xaxis_transform()
                style: Any = {"transform": whole, "facecolor": colour, "lw": 0, "zorder": 0, "label": mode.name}
                axes.fill_between(course.time, 0.0, 1.0, where=until, **style)
        for time in switches if len(switches) <= _SWITCHES else ():
            axes.axvline(time, color=INK, lw=0.8, ls=(0, (1, 2)))
    panels[-1].set_xlabel("time [s]")
    return figure, panels


def _legend(axes: Axes, columns: int) -> None:
    """Put what a panel shows above it."""
    if axes.get_legend_handles_labels()[0]:
        style: Any = {"ncols": columns, "fontsize": "small", "frameon": False, "columnspacing": 1.2}
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1, handlelength=1.8, **style)


def force_figure(course: RunCourse) -> Figure:
    """One panel an axis: estimate, value of eq. 8, thresholds, true force where it is known, and detections.

    Below them the evidence. Detectors without thresholds have bands in which one sample alone is no contact.
    """
    figure, (*along, evidence) = _panels(course, (1, 1, 1, 0.7), 9.2)
    for k, axes in enumerate(along):
        _along(axes, course, k)
    _legend(along[0], 7)
    evidence.plot(course.time, course.evidence, color=BLUE, lw=1.0)
    evidence.axhline(1.0, color=INK, lw=1.0)
    evidence.set_ylabel("evidence")
    return figure


def _along(axes: Axes, course: RunCourse, k: int) -> None:
    """Draw the force along an axis of the base frame."""
    time, force, filtered = course.time, course.force[:, k], course.filtered_force[:, k]
    if course.truth is not None:
        axes.plot(course.truth.time, course.truth.force[:, k], color=GREEN, lw=0.9, ls="--", label="true force")
    axes.plot(time, force, color=GREY, lw=0.9, label="estimate")
    if course.by_thresholds:
        axes.plot(time, filtered, color=BLUE, lw=1.3, label="value of eq. 8")
    bounds = "thresholds" if course.by_thresholds else "bands of one sample"
    axes.plot(time, course.upper[:, k], color=INK, lw=1.0, label=bounds)
    axes.plot(time, course.lower[:, k], color=INK, lw=1.0)
    at = [i for i, contact, _ in course.contacts if contact.axes[k] or not course.by_thresholds]
    value = filtered if course.by_thresholds else force
    mark: Any = {"color": RED, "mec": "white", "mew": 0.6, "ms": 7, "zorder": _MARKS, "label": "detected"}
    axes.plot(time[at], value[at], "v", **mark)
    axes.set_ylabel(f"force along {AXES[k]} [N]")


def motion_figure(course: RunCourse) -> Figure:
    """Distance of what each unit showed from the body, where proximity was used; speed; speed factor."""
    heights, height = ((1.5, 1, 0.6), 7.6) if course.proximity_used else ((1, 0.6), 4.6)
    figure, (*above, speed, factor) = _panels(course, heights, height)
    for axes in above:
        for k, name in enumerate(course.units):
            colour, dashes = _LINES[k % len(_LINES)]
            axes.plot(course.time, course.body_distance[:, k], color=colour, ls=dashes, lw=1.1, label=_plain(name))
        axes.plot(course.time, d_notice(course), color=INK, lw=0.9, ls=(0, (1, 3)), label="d_notice")
        axes.plot(course.time, d_crit(course), color=RED, lw=0.9, ls=(0, (1, 3)), label="d_crit")
        axes.axhline(0.0, color=INK, lw=0.8)
        axes.set_ylabel("distance from the body [m]")
        _legend(axes, 5)
    speed.plot(course.time, course.speed, color=BLUE, lw=1.0)
    speed.set_ylabel("end-effector [m/s]")
    speed.set_ylim(bottom=0.0)
    factor.plot(course.time, course.speed_scale, color=INK, lw=1.0)
    factor.set(ylabel="speed factor", ylim=(-0.05, 1.1))
    return figure


def _plain(name: str) -> str:
    """Write a name from a file so that Matplotlib shows it as it is: no formula, and not hidden."""
    plain = name.replace("\\", "\\\\").replace("$", r"\$") if "$" in name else name
    return f" {plain}" if plain.startswith("_") else plain
