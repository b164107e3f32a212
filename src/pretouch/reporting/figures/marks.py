"""What the figures of a report draw alike, and a figure as part of a page: no file beside it, nothing to fetch."""

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
from pretouch.reporting.course import Course
from pretouch.reporting.html import Html, element, html
from pretouch.types import FloatArray, Mode

_MOST_DRAWN = 3000
"""Points of a course beyond which it is drawn as pixels: an hour of lines would be a page of 100 MB."""

INK, BLUE, RED, GREEN, AMBER, GREY = "#1f2933", "#2b6cb0", "#c53030", "#2f855a", "#b7791f", "#a0aab4"
_SHADES = {Mode.REACT: (RED, 0.16), Mode.HOLD: (GREY, 0.28)}
LINES = (
    (BLUE, "-"), (AMBER, "--"), (GREEN, "-."), (INK, ":"), ("#805ad5", "-"), ("#b83280", "--"), ("#0b7285", "-."),
    (GREY, "-"),
)  # fmt: skip
"""Colour and style of each of several lines; more lines than these begin again."""
_SWITCHES = 12
"""More changes of the profile than this are not drawn."""


def panels(count: int, course: Course, heights: Sequence[float], height: float) -> tuple[Figure, list[Axes]]:
    """Make a figure of panels one below the other that share the time of a course."""
    figure = Figure(figsize=(10, height), layout="constrained")
    made: list[Axes] = list(figure.subplots(count, 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0])
    for axes in made:
        axes.grid(alpha=0.25, lw=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0)
        shade_modes(axes, course)
    made[-1].set_xlabel("time [s]")
    return figure, made


def shade_modes(axes: Axes, course: Course) -> None:
    """Shade the time the arm reacts or holds, and mark where another profile or path began."""
    for mode, (colour, alpha) in _SHADES.items():
        flags = course.mode == MODES.index(mode)
        if flags.any():
            until = flags | np.append(False, flags[:-1])  # a mode lasts until the next step
            whole, long = axes.get_xaxis_transform(), len(flags) > _MOST_DRAWN
            axes.fill_between(
                course.time, 0.0, 1.0, where=until, transform=whole, facecolor=(colour, alpha), lw=0, zorder=0,
                label=mode.name, rasterized=long,
            )  # fmt: skip
    switches = course.time[1:][np.diff(course.run) != 0]
    for time in switches if len(switches) <= _SWITCHES else ():
        axes.axvline(time, color=INK, lw=0.8, ls=(0, (1, 2)))


def draw(axes: Axes, time: FloatArray, values: FloatArray, **style: object) -> None:
    """Draw a course (S,) with all its peaks."""
    axes.plot(time, values, rasterized=len(time) > _MOST_DRAWN, **style)  # type: ignore[arg-type]


def legend(axes: Axes, columns: int = 6) -> None:
    """Put what a panel shows above it."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, fontsize="small", frameon=False,
            borderaxespad=0.1, columnspacing=1.2, handlelength=1.8,
        )  # fmt: skip


def plain(name: str) -> str:
    """Write a name from a file so that Matplotlib shows it as it is: no formula, and not hidden."""
    shown = name.replace("\\", "\\\\").replace("$", r"\$") if "$" in name else name
    return f" {shown}" if shown.startswith("_") else shown


_STYLE: Any = {
    "font.size": 9.0, "axes.labelsize": 9.0, "axes.edgecolor": "#616e7c", "svg.hashsalt": "pretouch",
    "svg.fonttype": "path", "path.simplify_threshold": 0.3, "axes.formatter.useoffset": False,
}  # fmt: skip


def style() -> AbstractContextManager[None]:
    """Context in which the figures of a report are made and drawn."""
    return matplotlib.rc_context(_STYLE)


def picture(figure: Figure, text: str) -> Html:
    """Draw a figure as SVG into the page, with a caption."""
    image = BytesIO()
    figure.savefig(
        image, format="svg", dpi=160, bbox_inches="tight", pad_inches=0.05, metadata={"Date": None, "Creator": None}
    )
    data = b64encode(image.getvalue()).decode("ascii")
    shown = Html(f'<img src="data:image/svg+xml;base64,{data}" alt="{escape(text)}">')
    return element("figure", Html(shown + element("figcaption", html(text))))
