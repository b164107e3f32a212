"""The last seconds as plots: how near a contact is, what is nearest, speed; and, asked for, each force and unit."""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np
from viser import GuiApi, GuiUplotHandle

from pretouch.page import palette
from pretouch.types import BoolArray, ControlStep, FloatArray, IntArray

SPAN_S = 10.0
"""Time that is shown [s]."""
SAMPLE_S = 0.06
"""Time from one shown sample to the next [s]; of the forces in it the one farthest from the mean is shown, and the
most evidence."""
SAMPLES = int(SPAN_S / SAMPLE_S)
PERIOD_S = 0.125
"""Time between two updates of a page [s]."""
FORCE_N = 15.0
"""Least range of the force axes, up and down [N]."""
_ROUNDING_S = 1e-6
_NOTHING_M = 9.0
"""Where a unit that shows nothing is drawn [m]: out of sight."""
_UNSEEN = "transparent"
_GREY, _FORCE, _SPEED = palette.css(palette.FOLLOWING), palette.css(palette.FORCE), palette.css(palette.PATH)
_SENSED = palette.css(palette.SENSED)


class History:
    """Samples of the last `SPAN_S`, each a dictionary of what is plotted.

    That is `time` [s], `distance` (B,) of each mounted unit [m], `force` (3,) with its upper and lower `limits` (2, 3)
    [N], `speeds` (2,), measured and desired [m/s], `evidence` of a contact, and `nearest`, from the body to that [m].
    """

    def __init__(self, first: IntArray, start: float = 0.0) -> None:
        """Take `Skin.first`, and the stamp of time 0 [s]."""
        self._first, self._start = first, start
        self._samples: deque[dict[str, Any]] = deque(maxlen=SAMPLES + 1)

    def clear(self) -> None:
        """Forget all samples."""
        self._samples.clear()

    def add(self, step: ControlStep, late: BoolArray | None = None) -> None:
        """Take a step in; one from before the last begins anew. A `late` unit (K,) shows nothing."""
        time, limits = step.stamp - self._start, step.thresholds
        reading = step.range_distance if late is None else np.where(late, np.nan, step.range_distance)
        sample = {
            "time": time,
            # of zones the nearest counts
            "distance": np.minimum.reduceat(np.nan_to_num(reading, nan=_NOTHING_M), self._first),
            "force": step.force,
            "limits": np.stack([limits.upper, limits.lower]),
            "speeds": np.linalg.norm([step.ee_velocity, step.desired_velocity], axis=1),
            "evidence": step.evidence,
            "nearest": step.obstacles.body_distance.min(initial=_NOTHING_M),
        }
        if self._samples and time < self._samples[-1]["time"]:
            self.clear()
        if self._samples and time - self._samples[-1]["time"] < SAMPLE_S - _ROUNDING_S:
            last = self._samples.pop()
            farther = np.abs(last["force"] - limits.mean) > np.abs(step.force - limits.mean)
            sample["force"] = np.where(farther, last["force"], step.force)
            sample["time"], sample["evidence"] = last["time"], max(last["evidence"], step.evidence)
        self._samples.append(sample)

    def column(self, name: str) -> FloatArray:
        """Data of a plot by name, one row for each sample; two rows for a single sample."""
        rows = [sample[name] for sample in self._samples]
        if len(rows) == 1:
            rows.insert(0, rows[0] - SAMPLE_S if name == "time" else rows[0])
        return np.array(rows, dtype=np.float64)


class Plots:
    """Three plots of a history, one below the other; with a box for those of each axis and unit."""

    def __init__(self, gui: GuiApi, history: History, ids: Sequence[str]) -> None:
        self._gui, self._history, self._sent = gui, history, -np.inf
        self._caption("Touch", [("a contact from 1 on", _FORCE)])
        self._evidence = self._plot([_FORCE, _GREY], 84, (0.0, 1.5), dashed=1)
        self._caption("Nearest [m]", [("from the arm to what is seen or remembered", _SENSED)])
        self._nearest = self._plot([_SENSED], 84, (0.0, 1.0))
        self._caption("Speed [m/s]", [("of the hand", _SPEED), ("asked for", _GREY)])
        self._speed = self._plot([_SPEED, _GREY], 84, (0.0, 0.4), dashed=1)

        self._more = gui.add_checkbox("More plots", False, hint="Force of each axis, distance of each unit.")
        marks, force, captions = [("force", _FORCE), ("thresholds or bands", _GREY)], [], []
        for axis in "xyz":
            captions.append(self._caption(f"Force {axis} [N]", marks if axis == "x" else ()))
            # a plot whose scale is set stops following the time, so invisible lines keep its range
            force.append(self._plot([_FORCE, _GREY, _GREY, _UNSEEN, _UNSEEN], 96, None, dashed=3))
        colours = [palette.css(palette.UNITS[i % len(palette.UNITS)]) for i in range(len(ids))]
        captions.append(self._caption("Distance [m]", zip(ids, colours, strict=True)))
        self._force, self._distance = force, self._plot(colours, 112, (0.0, 1.0))
        folded = [*captions, *force, self._distance]

        def unfold() -> None:
            for handle in folded:
                handle.visible = self._more.value

        @self._more.on_update
        async def _(_: Any) -> None:
            unfold()

        unfold()

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
        if not self._more.value:
            return
        self._distance.data = (time, *column("distance").T)
        forces = np.concatenate([column("force")[:, None], column("limits")], axis=1)
        for axis, plot in enumerate(self._force):
            reach = np.full(len(time), _reach(forces[:, :, axis]))
            plot.data = (time, *forces[:, :, axis].T, -reach, reach)

    def _plot(
        self, colours: Sequence[str], height: int, values: tuple[float, float] | None, dashed: int = 99
    ) -> GuiUplotHandle:
        """A plot with a line of each colour over time; from the `dashed`th on they are dashed.

        Without `values` it reaches as far as its lines.
        """
        plain: dict[str, Any] = {"width": 1.5, "points": {"show": False}}
        looks = [{"stroke": colour, **plain} for colour in colours]
        lines: Any = ({}, *looks[:dashed], *({**look, "dash": (4, 3)} for look in looks[dashed:]))
        small: dict[str, Any] = {"size": 18, "font": "10px system-ui", "ticks": {"size": 3}, "gap": 2}
        axes: Any = (small, {**small, "size": 34, "space": 15})
        return self._gui.add_uplot(
            _nothing(len(colours)),
            lines,
            height=height,
            scales={"x": {"time": False}, "y": {"range": values} if values else {}},
            legend={"show": False},
            cursor={"show": False},
            axes=axes,
            padding=(6, 8, 0, 0),
        )

    def _caption(self, title: str, marks: Iterable[tuple[str, str]]) -> Any:
        """A title, and what the colours mean."""
        names = "".join(
            f"<span style='white-space:nowrap'><span style='display:inline-block;width:8px;height:8px;"
            f"border-radius:4px;background:{colour};margin-right:4px'></span>{escape(name)}</span>"
            for name, colour in marks
        )
        return self._gui.add_html(
            "<div style='display:flex;flex-wrap:wrap;gap:0 9px;font-size:11px;line-height:1.35;padding:0 12px;"
            f"margin-bottom:-8px'><b>{title}</b>{names}</div>"
        )


def _nothing(lines: int) -> tuple[FloatArray, ...]:
    """Times, and so many lines that are not seen."""
    return np.arange(2.0), *np.full((lines, 2), np.nan)


def _reach(forces: FloatArray) -> float:
    """`FORCE_N`, doubled until the axis holds all forces (lines, samples) [N]."""
    largest = float(np.max(np.abs(forces), initial=0.0, where=np.isfinite(forces)))
    return FORCE_N * 2.0 ** max(0, math.ceil(math.log2(max(largest, FORCE_N) / FORCE_N)))
