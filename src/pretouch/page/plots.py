"""The last seconds as plots: how near a contact is, what is nearest, and speed."""

from collections import deque
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np
from viser import GuiApi, GuiUplotHandle

from pretouch.page import palette
from pretouch.types import ControlStep, FloatArray

SPAN_S = 10.0
"""Time that is shown [s]."""
SAMPLE_S = 0.06
"""Time from one shown sample to the next [s]; of the evidence in it the most is shown."""
SAMPLES = int(SPAN_S / SAMPLE_S)
PERIOD_S = 0.125
"""Time between two updates of a page [s]."""
_ROUNDING_S = 1e-6
_NOTHING_M = 9.0
"""Where the nearest is drawn of nothing [m]: out of sight."""
_GREY, _FORCE, _SPEED = palette.css(palette.FOLLOWING), palette.css(palette.FORCE), palette.css(palette.PATH)
_SENSED = palette.css(palette.SENSED)


class History:
    """Samples of the last `SPAN_S`, each a dictionary of what is plotted.

    That is `time` [s], `speeds` (2,), measured and desired [m/s], `evidence` of a contact, and `nearest`, from the body
    to that [m].
    """

    def __init__(self, start: float = 0.0) -> None:
        """Take the stamp of time 0 [s]."""
        self._start = start
        self._samples: deque[dict[str, Any]] = deque(maxlen=SAMPLES + 1)

    def clear(self) -> None:
        """Forget all samples."""
        self._samples.clear()

    def add(self, step: ControlStep) -> None:
        """Take a step in; one from before the last begins anew."""
        time = step.stamp - self._start
        sample = {
            "time": time,
            "speeds": np.linalg.norm([step.ee_velocity, step.desired_velocity], axis=1),
            "evidence": step.evidence,
            "nearest": step.obstacles.body_distance.min(initial=_NOTHING_M),
        }
        if self._samples and time < self._samples[-1]["time"]:
            self.clear()
        if self._samples and time - self._samples[-1]["time"] < SAMPLE_S - _ROUNDING_S:
            last = self._samples.pop()
            sample["time"], sample["evidence"] = last["time"], max(last["evidence"], step.evidence)
        self._samples.append(sample)

    def column(self, name: str) -> FloatArray:
        """Data of a plot by name, one row for each sample; two rows for a single sample."""
        rows = [sample[name] for sample in self._samples]
        if len(rows) == 1:
            rows.insert(0, rows[0] - SAMPLE_S if name == "time" else rows[0])
        return np.array(rows, dtype=np.float64)


class Plots:
    """Three plots of a history, one below the other."""

    def __init__(self, gui: GuiApi, history: History) -> None:
        self._gui, self._history, self._sent = gui, history, -np.inf
        self._caption("Touch", [("contact at 1", _FORCE)])
        self._evidence = self._plot([_FORCE, _GREY], 1.5)
        self._caption("Nearest [m]", [("from the arm to what is seen or remembered", _SENSED)])
        self._nearest = self._plot([_SENSED], 1.0)
        self._caption("Speed [m/s]", [("of the hand", _SPEED), ("asked for", _GREY)])
        self._speed = self._plot([_SPEED, _GREY], 0.4)

    def draw(self, now: float) -> None:
        """Send what is shown of the history, at a time [s]; not more often than eight times a second."""
        if now - self._sent < PERIOD_S:
            return
        self._sent, column = now, self._history.column
        time = column("time")
        if not len(time):
            for plot in (self._evidence, self._nearest, self._speed):
                plot.data = _nothing(len(plot.data) - 1)
            return
        self._evidence.data = (time, column("evidence"), np.ones(len(time)))
        self._nearest.data = (time, column("nearest"))
        self._speed.data = (time, *column("speeds").T)

    def _plot(self, colours: Sequence[str], most: float) -> GuiUplotHandle:
        """A plot with a line of each colour over time, from 0 to `most`; all but the first are dashed."""
        plain: dict[str, Any] = {"width": 1.5, "points": {"show": False}}
        looks = [{"stroke": colour, **plain} for colour in colours]
        lines: Any = ({}, looks[0], *({**look, "dash": (4, 3)} for look in looks[1:]))
        small: dict[str, Any] = {"size": 18, "font": "10px system-ui", "ticks": {"size": 3}, "gap": 2}
        axes: Any = (small, {**small, "size": 34, "space": 15})
        return self._gui.add_uplot(
            _nothing(len(colours)),
            lines,
            height=84,
            scales={"x": {"time": False}, "y": {"range": (0.0, most)}},
            legend={"show": False},
            cursor={"show": False},
            axes=axes,
            padding=(6, 8, 0, 0),
        )

    def _caption(self, title: str, marks: Iterable[tuple[str, str]]) -> None:
        """A title, and what the colours mean."""
        names = "".join(
            f"<span style='white-space:nowrap'><span style='display:inline-block;width:8px;height:8px;"
            f"border-radius:4px;background:{colour};margin-right:4px'></span>{escape(name)}</span>"
            for name, colour in marks
        )
        self._gui.add_html(
            "<div style='display:flex;flex-wrap:wrap;gap:0 9px;font-size:11px;line-height:1.35;padding:0 12px;"
            f"margin-bottom:-8px'><b>{title}</b>{names}</div>"
        )


def _nothing(lines: int) -> tuple[FloatArray, ...]:
    """Times, and so many lines that are not seen."""
    return np.arange(2.0), *np.full((lines, 2), np.nan)
