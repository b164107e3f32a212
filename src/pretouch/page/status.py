"""The lines at the top of a page: what the arm does, who limits it and how far, and how well the page keeps up."""

from html import escape
from typing import TYPE_CHECKING

from pretouch.explanation import Doing, Explanation
from pretouch.page import palette
from pretouch.types import Mode

if TYPE_CHECKING:
    from viser import GuiApi

PERIOD_S = 0.2
"""Time between two updates of a page [s], unless what the arm does changes."""
PHONE_PX = 576
"""Width of a window up to which viser puts all controls into a sheet at the bottom [px]."""
_SHEET = 46
"""Share of a phone's height that the sheet takes at most [%]; the scene has the rest, so that none of it is covered."""

_HEIGHT_PX = 118
"""Least height of word and sentence: three lines of it, so that what is below does not move under a person's mouse."""

_STYLE = (
    "<style>"
    "div:has(> #status){position:sticky;top:0;z-index:10;background:var(--mantine-color-body,#fff)}"
    ".mantine-ScrollArea-content div:has(#status){overflow:clip!important;min-width:0!important}"
    ".mantine-ScrollArea-content:has(#status){width:100%!important;min-width:0!important}"
    f"@media (max-width:{PHONE_PX}px){{"
    f".mantine-Paper-root:has(#status){{max-height:{_SHEET}%!important}}"
    "div[style*='width: 20em']:has(#status){width:100%!important}"
    f"div:has(> div > canvas){{height:{100 - _SHEET}dvh!important}}"
    "#status{min-height:92px!important}#word{font-size:22px!important}#reason{font-size:13px!important}}"
    "</style>"
)
"""Keeps the lines above the controls that scroll beneath them; on a phone, the sheet beneath the scene."""

_COLOURS = {
    Doing.MOVING: palette.RECOVERING, Doing.SLOWED: palette.FORCE, Doing.AVOIDING: palette.LIMITING,
    Doing.RETURNING: palette.RECOVERING, Doing.BLOCKED: palette.LIMITING, Doing.YIELDING: palette.REACTING,
    Doing.TOUCHED: palette.REACTING, Doing.CAUGHT: palette.LIMITING, Doing.WAITING: palette.HOLDING,
    Doing.STOPPED: palette.LIMITING,
}  # fmt: skip


class Status:
    """Word and sentence, then mode, time and rates, then the notice for a person."""

    def __init__(self, gui: "GuiApi") -> None:
        gui.add_html(_STYLE)
        self._html = gui.add_html("")
        self._sent = float("-inf")
        self._shown: tuple[object, ...] = ()
        self._page = ""
        self.notice = ""
        """The notice for a person, until another replaces it."""

    def draw(self, mode: Mode, found: Explanation, rates: str, warning: str, now: float) -> None:
        """Show what the arm does, at a time [s]; five times a second at most, unless there is something new to say."""
        news = (mode, found.doing, warning, self.notice)
        if news == self._shown and now - self._sent < PERIOD_S:
            return
        self._sent, self._shown = now, news
        page = _page(mode, found, rates, warning, self.notice)
        if page != self._page:
            self._html.content = self._page = page


def _page(mode: Mode, found: Explanation, rates: str, warning: str, notice: str) -> str:
    colour = palette.css(_COLOURS[found.doing])
    lines = [
        f"<div style='border-left:6px solid {colour};padding:0 0 2px 10px'>"
        f"<div id='word' style='color:{colour};font-weight:800;font-size:27px;line-height:1.15'>"
        f"{found.doing.value.upper()}</div>"
        f"<div id='reason' style='font-size:14px;line-height:1.35'>{escape(found.sentence)}</div></div>",
        f"<div id='rates' style='opacity:.6;margin-top:4px;font-size:11px;font-variant-numeric:tabular-nums'>"
        f"<span id='mode'>{mode.name}</span> · {escape(rates)}</div>",
        _banner("notice", notice, palette.PATH),
        _banner("warning", warning, palette.HOLDING),
    ]
    box = f"box-sizing:border-box;min-height:{_HEIGHT_PX}px;padding:6px 12px"
    return f"<div id='status' style='{box}'>{''.join(lines)}</div>"


def _banner(name: str, said: str, tint: palette.Colour) -> str:
    """A sentence on its own ground, or nothing."""
    if not said:
        return ""
    return (
        f"<div id='{name}' style='margin-top:5px;padding:4px 8px;border-radius:6px;font-size:12px;line-height:1.3;"
        f"max-height:64px;overflow:auto;background:{palette.css(tint)}1f;overflow-wrap:anywhere'>{escape(said)}</div>"
    )


def legend() -> str:
    """What the colours in space mean."""
    paths = [
        ("path", palette.PATH), ("followed", palette.FOLLOWING), ("avoiding", palette.LIMITING),
        ("recovering", palette.RECOVERING), ("reacting", palette.REACTING), ("holding", palette.HOLDING),
        ("force estimate", palette.FORCE), ("true force", palette.TRUE_FORCE),
        ("asked", palette.ASKED), ("allowed", palette.RECOVERING),
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
