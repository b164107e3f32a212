"""Controls of a page: each puts an action into the queue of the loop."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from pretouch.page.action_queue import ActionQueue
from pretouch.page.scene import PARTS

if TYPE_CHECKING:
    from viser import GuiApi, ViserServer


PERIOD_S = 1.0 / 30.0
"""Time between two updates of a page [s]."""
SETTLE_S = 0.8
"""Time without a key from which on a number that is typed counts [s]."""
PANEL_PX = 330
"""Width of the panel [px]."""


def style_page(server: "ViserServer") -> None:
    """Give a page its colours, and put its controls to the right."""
    server.gui.configure_theme(brand_color=(49, 104, 196), show_logo=False, show_share_button=False)
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_PX)


def when_changed(
    handle: Any,
    commands: ActionQueue,
    act: Callable[[Any], object],
    kind: str = "",
    settle: float = 0.0,
    quiet: bool = False,
) -> None:
    """Queue an action on each value that a person sets; values set by the program queue nothing.

    A control that a visitor changes who may not act shows again what it showed before.
    """
    before = handle.value

    @handle.on_update
    async def _(event: Any) -> None:
        nonlocal before
        value = event.target.value
        if event.client_id is None:
            before = value
        elif commands.admits(event.client_id):
            before = value
            commands.put(lambda: act(value), kind, settle, quiet)
        else:
            put(handle, before)


def add_button(
    gui: "GuiApi", commands: ActionQueue, label: str, act: Callable[[], object], settle: float = 0.0, **more: Any
) -> Any:
    """Add a button that queues an action, once between two ticks at most, and may have it settle.

    `more` goes to viser's `add_button`, but `icon` is a name.
    """
    from viser import Icon

    icon = more.pop("icon", None)
    button = gui.add_button(label, icon=getattr(Icon, icon) if icon else None, **more)

    @button.on_click
    async def _(event: Any) -> None:
        if commands.admits(event.client_id):
            commands.put(act, f"press {label}", settle)

    return button


def add_view_boxes(gui: "GuiApi", commands: ActionQueue, show: Callable[[str, bool], None]) -> None:
    """Add a box for each part of the scene that can be hidden."""
    for name in PARTS:
        box = gui.add_checkbox(name.capitalize(), True)
        when_changed(box, commands, partial(show, name), f"view {name}", quiet=True)


def put(handle: Any, value: object) -> None:
    """Show a value in a control; mypy takes viser's property for read-only."""
    handle.value = value
