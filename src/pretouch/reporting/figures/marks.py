"""What the figures of a report draw alike."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.recording.run_record import MODES
from pretouch.reporting.course import Course
from pretouch.traces import spans
from pretouch.types import BoolArray, FloatArray, IntArray, Mode

BINS = 700
"""Stretches of time that a line is drawn in: more than a printed page shows."""


def envelope(time: FloatArray, values: FloatArray, bins: int = BINS) -> tuple[FloatArray, FloatArray]:
    """Least and greatest of each of so many stretches of a course (S,), in the order they came; a short one as it is.

    A stretch without any number is NaN, so that a line is broken there.
    """
    if len(values) <= 2 * bins:
        return time, values
    edges = np.linspace(0, len(values), bins + 1).astype(np.int64)[:-1]
    length = np.diff(np.append(edges, len(values)))
    bin_of = np.repeat(np.arange(bins), length)
    nan = np.isnan(values)
    low = _first_where(values, np.minimum.reduceat(np.where(nan, np.inf, values), edges), bin_of, edges)
    high = _first_where(values, np.maximum.reduceat(np.where(nan, -np.inf, values), edges), bin_of, edges)
    places = np.sort(np.stack([low, high], axis=1), axis=1).ravel()
    return time[places], values[places]


def _first_where(values: FloatArray, wanted: FloatArray, bin_of: IntArray, edges: IntArray) -> IntArray:
    """Index in each bin (B,) of the first value equal to the one wanted; the first of the bin if there is none."""
    hits = np.flatnonzero(values == wanted[bin_of])
    places = edges.copy()
    bins, first = np.unique(bin_of[hits], return_index=True)
    places[bins] = hits[first]
    return places


def stretches(time: FloatArray, flags: BoolArray, bins: int = BINS) -> list[tuple[float, float]]:
    """Spans of time [s] in which flags (S,) hold, those joined that would touch on paper."""
    if not len(time):
        return []
    close = (time[-1] - time[0]) / bins
    joined: list[tuple[float, float]] = []
    for first, past in spans(flags):
        start, end = float(time[first]), float(time[min(past, len(time) - 1)])
        if joined and start - joined[-1][1] < close:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return joined


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
        spans = stretches(course.time, course.mode == MODES.index(mode))
        for i, (start, end) in enumerate(spans):
            name = mode.name if i == 0 else None
            axes.axvspan(start, end, facecolor=(colour, alpha), lw=0, zorder=0, label=name)
    switches = course.time[1:][np.diff(course.run) != 0]
    for time in switches if len(switches) <= _SWITCHES else ():
        axes.axvline(time, color=INK, lw=0.8, ls=(0, (1, 2)))


def draw(axes: Axes, time: FloatArray, values: FloatArray, **style: object) -> None:
    """Draw a course (S,) with all its peaks."""
    axes.plot(*envelope(time, values), **style)  # type: ignore[arg-type]


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
