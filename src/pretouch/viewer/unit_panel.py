"""How well the real units on a simulated arm are, in the page."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from pretouch.hardware.findings import Finding, findings
from pretouch.hardware.health import HealthParams, UnitHealth, UnitWindow
from pretouch.viewer import palette
from pretouch.viewer.real_units import UnitSource

if TYPE_CHECKING:
    from viser import GuiApi

PERIOD_S = 0.5
"""Time between two updates [s]."""


class UnitPanel:
    """A line for each unit, and below it what is wrong with it."""

    def __init__(self, gui: "GuiApi", source: UnitSource, ids: Sequence[str]) -> None:
        """Put it where the page's controls are being added."""
        self._source, self._params = source, HealthParams()
        self._windows = [UnitWindow(unit, self._params.window_s) for unit in ids]
        self._html = gui.add_html("")
        self._drawn = float("-inf")

    def draw(self, now: float) -> None:
        """Show how the units are at an instant of the machine's monotonic clock [s], twice a second at most."""
        if now - self._drawn < PERIOD_S:
            return
        self._drawn = now
        heard, counted = self._source.take_samples(), self._source.traffic().units
        units = []
        for k, (window, traffic) in enumerate(zip(self._windows, counted, strict=True)):
            window.take(now, [one for one in heard if one.unit == k], traffic)
            units.append(window.health(now, traffic))
        self._html.content = unit_lines(units, findings(units, self._params))


def unit_lines(units: Sequence[UnitHealth], found: Sequence[Finding]) -> str:
    """Write the units and their findings as HTML."""
    lines = []
    for unit in units:
        mine = [f for f in found if f.unit == unit.unit]
        fault = any(f.level == "fault" for f in mine)
        colour = palette.css(palette.UNIT_SILENT if fault else palette.HOLDING if mine else palette.SENSED)
        lines.append(
            f"<div style='margin:6px 0 0;font-size:12px'><span style='display:inline-block;width:8px;height:8px;"
            f"border-radius:4px;background:{colour};margin-right:6px'></span>"
            f"<b>{escape(unit.unit)}</b> {_numbers(unit)}</div>"
        )
        lines += [f"<div style='font-size:11px;opacity:.8;margin-left:14px'>{escape(f.sentence)}</div>" for f in mine]
    return f"<div class='units' style='padding:0 12px 8px'>{''.join(lines)}</div>"


def _numbers(unit: UnitHealth) -> str:
    """Readings a second, what was lost, how old readings are when they come, and the battery."""
    if unit.heard_s <= 0:
        return escape(unit.standing.state)
    parts = [(unit.rate_hz, "{:.0f} Hz"), (100 * unit.loss, "{:.0f} % lost"), (1000 * unit.latency_s, "{:.0f} ms")]
    parts.append((unit.battery_v, "{:.2f} V"))
    return " · ".join(form.format(value) for value, form in parts if value == value)
