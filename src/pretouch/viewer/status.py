"""The lines at the top of a page: what the arm does and why, and how well the page keeps up."""

from html import escape
from typing import TYPE_CHECKING

from pretouch.types import ControlStep, Mode
from pretouch.viewer import palette

if TYPE_CHECKING:
    from viser import GuiApi

PERIOD_S = 0.2
"""Time between two updates of a page [s], unless the mode changes."""

_HEIGHT_PX = 222
"""Height of it all: three lines of reason, two of rates, and three of notice and of warning each."""

_STICKY = (
    "<style>div:has(> #status){position:sticky;top:0;z-index:10;background:var(--mantine-color-body,#fff)}"
    ".mantine-ScrollArea-content div:has(#status){overflow:clip!important}</style>"
)
"""Keeps the lines above the controls that scroll beneath them."""


class Status:
    """Mode and reason, then time and rates, then the notice for a person."""

    def __init__(self, gui: "GuiApi") -> None:
        self._html = gui.add_html("")
        self._sent = float("-inf")
        self._shown: tuple[object, ...] = ()
        self.notice = ""
        """The notice for a person, until another replaces it."""

    def draw(self, step: ControlStep, rates: str, warning: str, now: float) -> None:
        """Show a step, at a time [s]; not more often than five times a second unless there is something new to say."""
        news = (step.mode, warning, self.notice)
        if news == self._shown and now - self._sent < PERIOD_S:
            return
        self._sent, self._shown = now, news
        self._html.content = _page(step.mode, step.reason, rates, warning, self.notice)


def _page(mode: Mode, reason: str, rates: str, warning: str, notice: str) -> str:
    colour = palette.css(palette.MODES[mode])
    lines = [
        f"<div style='border-left:5px solid {colour};padding:2px 0 2px 10px'>"
        f"<span id='mode' style='color:{colour};font-weight:700;letter-spacing:.06em'>{mode.name}</span>"
        f"<div id='reason' style='min-height:2.8em;line-height:1.4'>{escape(reason)}</div></div>",
        f"<div id='rates' style='opacity:.65;margin-top:6px;font-variant-numeric:tabular-nums'>{escape(rates)}</div>",
        _banner("notice", notice, palette.PATH),
        _banner("warning", warning, palette.HOLDING),
    ]
    # of fixed height, so that the controls below do not move under a person's mouse
    box = f"box-sizing:border-box;height:{_HEIGHT_PX}px;overflow:auto;padding:6px 12px;font-size:13px"
    return f"{_STICKY}<div id='status' style='{box}'>{''.join(lines)}</div>"


def _banner(name: str, said: str, tint: palette.Colour) -> str:
    """A sentence on its own ground, or nothing."""
    if not said:
        return ""
    return (
        f"<div id='{name}' style='margin-top:5px;padding:4px 8px;border-radius:6px;font-size:12px;line-height:1.3;"
        f"background:{palette.css(tint)}1f;overflow-wrap:anywhere'>{escape(said)}</div>"
    )


def legend() -> str:
    """What the colours in space mean."""
    paths = [
        ("path", palette.PATH), ("followed", palette.FOLLOWING), ("avoiding", palette.AVOIDING),
        ("recovering", palette.RECOVERING), ("reacting", palette.REACTING), ("holding", palette.HOLDING),
        ("force estimate", palette.FORCE), ("true force", palette.TRUE_FORCE),
    ]  # fmt: skip
    marks = "".join(_mark(name, colour, 14, 4, 2) for name, colour in paths)
    marks += _mark("sensed", palette.SENSED, 9, 9, 5) + _mark("closest pair", palette.PAIR, 14, 2, 0)
    marks += _mark("silent unit", palette.UNIT_SILENT, 8, 8, 1)
    ramp = ",".join(palette.css(colour) for colour in palette.EXPECTED)
    return (
        f"<div style='padding:4px 12px 10px;font-size:11px;display:flex;flex-wrap:wrap;gap:3px 12px'>{marks}"
        f"<span style='white-space:nowrap'><span style='display:inline-block;width:46px;height:8px;border-radius:4px;"
        f"background:linear-gradient(90deg,{ramp});margin:0 5px 0 0'></span>contact expected</span></div>"
    )


def _mark(name: str, colour: palette.Colour, width: int, height: int, radius: int) -> str:
    """A colour in a shape [px], and its name."""
    shape = f"width:{width}px;height:{height}px;border-radius:{radius}px;vertical-align:middle"
    return (
        f"<span style='white-space:nowrap'><span style='display:inline-block;{shape};"
        f"background:{palette.css(colour)};margin:0 5px 2px 0'></span>{name}</span>"
    )
