"""The last seconds as plots: how near a contact is, what is nearest, speed; and, asked for, each force and unit."""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch.page import palette
from pretouch.types import BoolArray, ControlStep, FloatArray, IntArray

if TYPE_CHECKING:
    from viser import GuiApi, GuiUplotHandle

SPAN_S = 10.0
"""Time that is shown [s]."""
SAMPLE_S = 0.06
"""Time from one shown sample to the next [s]; of the forces in it the one farthest from the mean is shown, and the
most evidence."""
PERIOD_S = 0.125
"""Time between two updates of a page [s]."""
_ROUNDING_S = 1e-6
_NOTHING_M = 9.0
"""Where a unit that shows nothing is drawn [m]: out of sight."""
FORCE_N = 15.0
"""What the axes of force reach to at least, up and down [N]."""
_UNSEEN = "transparent"
_SMALL_PX = 84
"""Height of the plots that are always shown [px]."""
SAMPLES = int(SPAN_S / SAMPLE_S)


class History:
    """Samples of the last `SPAN_S`: time, distance of each mounted unit (B), then what the steps say.

    That is force, upper and lower threshold (3 each), two speeds, the evidence of a contact, and the distance of what
    is nearest to the body.
    """

    def __init__(self, first: IntArray, start: float = 0.0) -> None:
        """Take `Skin.first`, and the stamp of time 0 [s]."""
        self._first, self._units, self._start = first, len(first), start
        self._width = 1 + self._units + 9 + 2 + 2
        self._rows: deque[FloatArray] = deque(maxlen=SAMPLES)
        self._open: FloatArray | None = None

    def __len__(self) -> int:
        return len(self._rows)

    def clear(self) -> None:
        """Forget all samples."""
        self._rows.clear()
        self._open = None

    def add(self, step: ControlStep, late: BoolArray | None = None) -> None:
        """Take a step in; one from before the last begins anew. A `late` unit (K,) shows nothing."""
        time = step.stamp - self._start
        if self._open is not None and time < self._open[0]:
            self.clear()
        thresholds, force = step.thresholds, slice(1 + self._units, 4 + self._units)
        reading = step.range_distance if late is None else np.where(late, np.nan, step.range_distance)
        # of zones the nearest counts
        distance = np.minimum.reduceat(np.nan_to_num(reading, nan=_NOTHING_M), self._first)
        nearest = float(step.obstacles.body_distance.min(initial=_NOTHING_M))
        row = np.concatenate(
            [
                [time], distance, step.force, thresholds.upper, thresholds.lower,
                [np.linalg.norm(step.ee_velocity), np.linalg.norm(step.desired_velocity), step.evidence, nearest],
            ]
        )  # fmt: skip
        if self._open is None:
            self._open = row
        elif time - self._open[0] >= SAMPLE_S - _ROUNDING_S:
            self._rows.append(self._open)
            self._open = row
        else:
            far = np.abs(self._open[force] - thresholds.mean) > np.abs(row[force] - thresholds.mean)
            row[force] = np.where(far, self._open[force], row[force])
            row[12 + self._units] = max(row[12 + self._units], self._open[12 + self._units])
            row[0] = self._open[0]
            self._open = row

    def columns(self) -> FloatArray:
        """All samples, one column after the other (columns, samples); before the first time, nothing (NaN)."""
        if self._open is None:
            return np.vstack([np.arange(2.0), np.full((self._width - 1, 2), np.nan)])
        rows = np.array([*self._rows, self._open])
        if len(rows) < 2:
            rows = np.repeat(rows, 2, axis=0)
            rows[0, 0] -= SAMPLE_S
        return rows.T


class Plots:
    """Three plots of a history, one below the other; with a box for those of each axis and unit."""

    def __init__(self, gui: "GuiApi", history: History, ids: Sequence[str]) -> None:
        self._history, self._units = history, len(ids)
        self._sent = -np.inf
        grey, force = palette.css(palette.FOLLOWING), palette.css(palette.FORCE)
        blue, green = palette.css(palette.PATH), palette.css(palette.SENSED)
        gui.add_html(_caption("Touch", [("a contact from 1 on", force)]))
        self._evidence = _plot(gui, [force, grey], _SMALL_PX, (0.0, 1.5), dashed=1)
        gui.add_html(_caption("Nearest [m]", [("from the arm to what a unit sees", green)]))
        self._nearest = _plot(gui, [green], _SMALL_PX, (0.0, 1.0))
        gui.add_html(_caption("Speed [m/s]", [("of the hand", blue), ("asked for", grey)]))
        self._speed = _plot(gui, [blue, grey], _SMALL_PX, (0.0, 0.4), dashed=1)

        self._more = gui.add_checkbox("More plots", False, hint="Force of each axis, distance of each unit.")
        colours = [palette.css(palette.UNITS[i % len(palette.UNITS)]) for i in range(len(ids))]
        marks = [("force", force), ("thresholds or bands", grey)]
        self._force, captions = [], []
        for axis in "xyz":
            captions.append(gui.add_html(_caption(f"Force {axis} [N]", marks if axis == "x" else ())))
            # a page whose scale is changed no longer follows the time: unseen lines hold it open
            self._force.append(_plot(gui, [force, grey, grey, _UNSEEN, _UNSEEN], 96, None, dashed=3))
        captions.append(gui.add_html(_caption("Distance [m]", zip(ids, colours, strict=True))))
        self._distance = _plot(gui, colours, 112, (0.0, 1.0))
        self._folded: list[Any] = [*captions, *self._force, self._distance]
        self._unfold()

        @self._more.on_update
        async def _(_: Any) -> None:
            self._unfold()

    def _unfold(self) -> None:
        """Show the plots of each axis and unit, or hide them."""
        for handle in self._folded:
            handle.visible = self._more.value

    def draw(self, now: float) -> None:
        """Send what is shown of the history, at a time [s]; not more often than eight times a second."""
        if now - self._sent < PERIOD_S:
            return
        self._sent = now
        rows, k = self._history.columns(), self._units
        time = rows[0]
        self._evidence.data = (time, rows[12 + k], np.ones(len(time)))
        self._nearest.data = (time, rows[13 + k])
        self._speed.data = (time, *rows[10 + k : 12 + k])
        if not self._more.value:
            return
        self._distance.data = (time, *rows[1 : 1 + k])
        for axis, plot in enumerate(self._force):
            at = [1 + k + axis, 4 + k + axis, 7 + k + axis]
            reach = np.full(len(time), _reach(rows[at]))
            plot.data = (time, *rows[at], -reach, reach)


def _plot(
    gui: "GuiApi", colours: Sequence[str], height: int, values: tuple[float, float] | None, dashed: int | None = None
) -> "GuiUplotHandle":
    """A plot with a line of each colour over time; from the `dashed`th on they are dashed.

    Without `values` it reaches as far as its lines.
    """
    lines: list[Any] = [{}]
    for i, colour in enumerate(colours):
        late = dashed is not None and i >= dashed
        lines.append({"stroke": colour, "width": 1.5, "points": {"show": False}, **({"dash": (4, 3)} if late else {})})
    small: dict[str, Any] = {"size": 18, "font": "10px system-ui", "ticks": {"size": 3}, "gap": 2}
    axes: Any = (small, {**small, "size": 34, "space": 15})
    return gui.add_uplot(
        tuple(np.full(2, np.nan) if i else np.arange(2.0) for i in range(len(colours) + 1)), tuple(lines),
        height=height, scales={"x": {"time": False}, "y": {"range": values} if values else {}},
        legend={"show": False}, cursor={"show": False},
        axes=axes, padding=(6, 8, 0, 0),
    )  # fmt: skip


def _reach(forces: FloatArray) -> float:
    """`FORCE_N`, doubled until the axis holds all forces (lines, samples) [N]."""
    largest = float(np.max(np.abs(forces), initial=0.0, where=np.isfinite(forces)))
    return FORCE_N * 2.0 ** max(0, math.ceil(math.log2(max(largest, FORCE_N) / FORCE_N)))


def _caption(title: str, marks: Iterable[tuple[str, str]]) -> str:
    """A title, and what the colours mean."""
    shown = "".join(
        f"<span style='white-space:nowrap'><span style='display:inline-block;width:8px;height:8px;border-radius:4px;"
        f"background:{colour};margin-right:4px'></span>{escape(name)}</span>"
        for name, colour in marks
    )
    return (
        "<div style='display:flex;flex-wrap:wrap;gap:0 9px;font-size:11px;line-height:1.35;padding:0 12px;"
        f"margin-bottom:-8px'><b>{title}</b>{shown}</div>"
    )
