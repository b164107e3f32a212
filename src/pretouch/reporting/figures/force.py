"""Force estimate with the moving thresholds of each axis, and the detector's evidence of a contact."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.reporting.course import Course
from pretouch.reporting.figures.marks import BLUE, GREEN, GREY, INK, RED, draw, legend, panels
from pretouch.types import FloatArray

AXES = "xyz"
_BEFORE_S, _AFTER_S = 0.3, 0.7
"""Time shown about a contact [s]."""


def force_figure(course: Course) -> Figure:
    """One panel an axis: estimate, value of eq. 8, thresholds, true force where it is known, and detections.

    Below them the evidence. Detectors without thresholds have bands in which one sample alone is no contact.
    """
    figure, made = panels(4, course, (1, 1, 1, 0.7), 9.2)
    for k, axes in enumerate(made[:3]):
        _along(axes, course, k, slice(None), slice(None))
    legend(made[0], 7)
    draw(made[3], course.time, course.evidence, color=BLUE, lw=1.0)
    made[3].axhline(1.0, color=INK, lw=1.0)
    made[3].set_ylabel("evidence")
    return figure


def close_up_figure(course: Course, time: float, force: FloatArray) -> Figure:
    """The same about one contact [s], along the axis to which its force (3,) points most."""
    span = time - _BEFORE_S, time + _AFTER_S
    truth = np.zeros(0) if course.truth is None else course.truth.time
    figure, (axes,) = panels(1, course, (1,), 3.2)
    _along(axes, course, int(np.abs(np.nan_to_num(force)).argmax()), _within(course.time, span), _within(truth, span))
    axes.set_xlim(span)
    legend(axes, 7)
    return figure


def _along(axes: Axes, course: Course, k: int, shown: slice, known: slice) -> None:
    """Draw the force along an axis of the base frame, of some steps and some instants of the physics."""
    time = course.time[shown]
    if course.truth is not None:
        draw(
            axes, course.truth.time[known], course.truth.force[known, k], color=GREEN, lw=0.9, ls="--",
            label="true force",
        )  # fmt: skip
    draw(axes, time, course.force[shown, k], color=GREY, lw=0.9, label="estimate")
    if course.by_thresholds:
        draw(axes, time, course.filtered_force[shown, k], color=BLUE, lw=1.3, label="value of eq. 8")
    draw(axes, time, course.upper[shown, k], color=INK, lw=1.0, label=bounds(course))
    draw(axes, time, course.lower[shown, k], color=INK, lw=1.0)
    first, past, _ = shown.indices(len(course))
    detected = [i for i, contact, _ in course.contacts if contact.axes[k] or not course.by_thresholds]
    at = np.array([i for i in detected if first <= i < past], dtype=np.int64)
    found = course.filtered_force if course.by_thresholds else course.force
    axes.plot(course.time[at], found[at, k], "v", color=RED, mec="white", mew=0.6, ms=7, label="detected")
    axes.set_ylabel(f"force along {AXES[k]} [N]")


def bounds(course: Course) -> str:
    """What the two lines about a force are called."""
    return "thresholds" if course.by_thresholds else "bands of one sample"


def _within(time: FloatArray, span: tuple[float, float]) -> slice:
    """Which of some instants (S,) [s] lie in a span."""
    first, past = np.searchsorted(time, span).tolist()
    return slice(first, past)
