"""The panel of a page: what the arm does, how well the page keeps up, and controls that queue what people do."""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import Any

from viser import GuiApi, Icon, ViserServer

from pretouch.explanation import Doing, Explanation
from pretouch.page import palette
from pretouch.page.scene import PARTS
from pretouch.types import Mode

PERIOD_S = 1.0 / 30.0
"""Time between two updates of a page [s]."""
SETTLE_S = 0.8
"""Time without a key from which on a number that is typed counts [s]."""
PANEL_PX = 330
"""Width of the panel [px]."""
STATUS_PERIOD_S = 0.2
"""Time between two updates of the status [s], unless what the arm does changes."""
_SHEET = 46
"""Share of a phone's height that the sheet takes at most [%]; the scene has the rest, so that none of it is covered."""
_STYLE = (
    "<style>"
    "div:has(> #status){position:sticky;top:0;z-index:10;background:var(--mantine-color-body,#fff)}"
    ".mantine-ScrollArea-content div:has(#status){overflow:clip!important;min-width:0!important}"
    ".mantine-ScrollArea-content:has(#status){width:100%!important;min-width:0!important}"
    f"@media (max-width:576px){{.mantine-Paper-root:has(#status){{max-height:{_SHEET}%!important}}"
    "div[style*='width: 20em']:has(#status){width:100%!important}"
    f"div:has(> div > canvas){{height:{100 - _SHEET}dvh!important}}"
    "#status{min-height:92px!important}#word{font-size:22px!important}#reason{font-size:13px!important}}"
    "</style>"
)
"""Keeps the status above the controls that scroll beneath it; on a phone, where viser puts all controls into a sheet,
that beneath the scene. It names elements of viser's client, so pyproject.toml pins viser."""
_COLOURS = {
    Doing.MOVING: palette.RECOVERING,
    Doing.SLOWED: palette.FORCE,
    Doing.AVOIDING: palette.LIMITING,
    Doing.RETURNING: palette.RECOVERING,
    Doing.YIELDING: palette.REACTING,
    Doing.TOUCHED: palette.REACTING,
    Doing.CAUGHT: palette.LIMITING,
    Doing.WAITING: palette.HOLDING,
    Doing.STOPPED: palette.LIMITING,
}


class Status:
    """Word and sentence, then mode, time and rates, then the notice for a person."""

    def __init__(self, gui: GuiApi) -> None:
        gui.add_html(_STYLE)
        self._html = gui.add_html("")
        self._sent, self._news = -math.inf, tuple[object, ...]()
        self.notice = ""
        """The notice for a person, until another replaces it."""

    def fail(self, error: Exception, say: Callable[[str], None]) -> None:
        """Say that a page came upon an error that nobody foresaw, on the page and elsewhere, once."""
        sentence = f"The page failed, and holds: {type(error).__name__}: {error}. Please report this."
        if self.notice != sentence:
            self.notice = sentence
            say(sentence)

    def draw(self, mode: Mode, explanation: Explanation, rates: str, warning: str, now: float) -> None:
        """Show what the arm does, at a time [s]; five times a second at most, unless there is something new to say."""
        news = (mode, explanation.doing, warning, self.notice)
        if news == self._news and now - self._sent < STATUS_PERIOD_S:
            return
        self._sent, self._news = now, news
        colour = palette.css(_COLOURS[explanation.doing])
        # three lines of it at least, so that what is below does not move under a person's mouse
        self._html.content = (
            "<div id='status' style='box-sizing:border-box;min-height:118px;padding:6px 12px'>"
            f"<div style='border-left:6px solid {colour};padding:0 0 2px 10px'>"
            f"<div id='word' style='color:{colour};font-weight:800;font-size:27px;line-height:1.15'>"
            f"{explanation.doing.value.upper()}</div>"
            f"<div id='reason' style='font-size:14px;line-height:1.35'>{escape(explanation.sentence)}</div></div>"
            f"<div id='rates' style='opacity:.6;margin-top:4px;font-size:11px;font-variant-numeric:tabular-nums'>"
            f"<span id='mode'>{mode.name}</span> · {escape(rates)}</div>"
            f"{_banner('notice', self.notice, palette.PATH)}{_banner('warning', warning, palette.HOLDING)}</div>"
        )


def _banner(name: str, sentence: str, tint: palette.Colour) -> str:
    """A sentence on its own ground, or nothing."""
    style = (
        "margin-top:5px;padding:4px 8px;border-radius:6px;font-size:12px;line-height:1.3;max-height:64px;"
        f"overflow:auto;background:{palette.css(tint)}1f;overflow-wrap:anywhere"
    )
    return f"<div id='{name}' style='{style}'>{escape(sentence)}</div>" if sentence else ""


class Pace:
    """Simulated against real time, by windows of a second."""

    def __init__(self) -> None:
        self.slow = False
        """True if the machine was too slow for two seconds, and has not kept up for one since."""
        self._shares = (1.0, 1.0)
        """Simulated over real time, of the last two windows."""
        self._begin, self._simulated = -math.inf, 0.0

    def tick(self, now: float, advanced: float) -> None:
        """Count an update at a time [s] before which the simulation advanced [s]."""
        if math.isinf(self._begin):
            self._begin = now
            return
        self._simulated, lasted = self._simulated + advanced, now - self._begin
        if lasted >= 1.0:
            self._shares = (self._shares[1], self._simulated / lasted)
            self.slow = max(self._shares) < (0.97 if self.slow else 0.9)
            self._begin, self._simulated = now, 0.0

    def sentence(self) -> str:
        """Say that the machine is too slow, or nothing."""
        if not self.slow:
            return ""
        return (
            f"This machine is too slow for real time: the clock runs at {100 * self._shares[1]:.0f} % of it,"
            " with the same physics."
        )


@dataclass
class QueuedAction:
    """An action that waits."""

    run: Callable[[], object]
    settle: float
    """Time that it waits for a newer action of its kind [s]."""
    quiet: bool
    """True if it leaves the notice on the page."""
    due: float | None = None
    """Time to run it, on the loop's clock [s]; None before the loop has seen it."""


class ActionQueue:
    """Actions of people, from any thread, for the loop to do in order between two ticks; the newest of each kind."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: dict[object, QueuedAction] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, action: Callable[[], object], kind: str = "", settle: float = 0.0, quiet: bool = False) -> None:
        """Request an action; it replaces a waiting one of the same kind, unless that is ''.

        `settle` is the time to wait for a newer one of its kind [s], as somebody types a number key by key; `quiet`
        leaves the notice on the page.
        """
        with self._lock:
            key: object = kind or object()
            self._waiting.pop(key, None)
            self._waiting[key] = QueuedAction(action, settle, quiet)

    def is_waiting(self, kind: str) -> bool:
        """Return True if an action of a kind is still to be done."""
        with self._lock:
            return kind in self._waiting

    def take(self, now: float = math.inf) -> list[QueuedAction]:
        """Return what is due at a time of the loop [s], in order; without one, all.

        An action that has to settle is also due if a person asked for something else afterwards.
        """
        with self._lock:
            for action in self._waiting.values():
                action.due = now + action.settle if action.due is None else action.due
            last = max((i for i, one in enumerate(self._waiting.values()) if not (one.settle or one.quiet)), default=0)
            items = enumerate(self._waiting.items())
            due = {key: one for i, (key, one) in items if i < last or (one.due or 0.0) <= now}
            self._waiting = {key: action for key, action in self._waiting.items() if key not in due}
        return list(due.values())


def style_page(server: ViserServer) -> None:
    """Give a page its colours, and put its controls to the right."""
    server.gui.configure_theme(brand_color=palette.PATH, show_logo=False, show_share_button=False)
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_PX)


def when_changed(
    handle: Any,
    actions: ActionQueue,
    act: Callable[[Any], object],
    kind: str = "",
    settle: float = 0.0,
    quiet: bool = False,
) -> None:
    """Queue an action on each value that a person sets; values set by the program queue nothing."""

    @handle.on_update
    async def _(event: Any) -> None:
        value = event.target.value
        if event.client_id is not None:
            actions.put(lambda: act(value), kind, settle, quiet)


def add_button(
    gui: GuiApi,
    actions: ActionQueue,
    label: str,
    act: Callable[[], object],
    icon: str = "",
    settle: float = 0.0,
    **more: Any,
) -> Any:
    """Add a button that queues an action, once between two ticks at most, and may have it settle.

    `icon` is the name of one of viser's; `more` goes to its `add_button`.
    """
    button = gui.add_button(label, icon=getattr(Icon, icon) if icon else None, **more)

    @button.on_click
    async def _(_: Any) -> None:
        actions.put(act, f"press {label}", settle)

    return button


def add_view_boxes(gui: GuiApi, actions: ActionQueue, show: Callable[[str, bool], None]) -> None:
    """Add a box for each part of the scene that can be hidden, and what the colours mean."""
    for name in PARTS:
        box = gui.add_checkbox(name.capitalize(), True)
        when_changed(box, actions, partial(show, name), f"view {name}", quiet=True)
    gui.add_html(palette.legend())


def put(handle: Any, value: object) -> None:
    """Show a value in a control; mypy takes viser's property for read-only."""
    handle.value = value
