"""Who commands a page: one visitor at a time, named to all. The others look."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from viser import ClientHandle, ViserServer


class Commander:
    """The visitor who commands: the first to act, until somebody else takes the command, or the visitor leaves.

    All methods are called by the server's own thread.
    """

    def __init__(self, server: "ViserServer") -> None:
        self._server = server
        self._who: int | None = None
        self._line = server.gui.add_html("", visible=False)
        self.take = server.gui.add_button("Take command", visible=False, hint="The visitor who has it then looks.")
        """What anybody may press."""
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._dismiss)

    def refusal(self, visitor: int, control: Any = None) -> str:
        """Say why a visitor may not use a control, or ''; who does while nobody commands, commands from now on."""
        there = self._server.get_clients()
        if visitor not in there:
            return "The page has not said where it looks from: wait a moment."
        if self._who not in there or control is self.take:
            self._give(visitor)
        return "" if self._who == visitor else f"{_name(self._who)} commands: press Take command first."

    def holds(self, visitor: int) -> bool:
        """Whether a visitor is there and commands."""
        return self._who == visitor and visitor in self._server.get_clients()

    def _give(self, visitor: int | None) -> None:
        self._who = visitor
        self._show()

    def _show(self) -> None:
        several = len(self._server.get_clients()) > 1
        self._line.content = f"<div id='commander' style='padding:2px 12px;font-size:12px'>{self._sentence()}</div>"
        self._line.visible = self.take.visible = several

    def _sentence(self) -> str:
        return "Nobody commands: the first to act does." if self._who is None else f"{_name(self._who)} commands."

    async def _welcome(self, client: "ClientHandle") -> None:
        self._show()
        if self._who is not None:
            client.add_notification(f"You are {_name(client.client_id)}", self._sentence(), auto_close_seconds=10.0)

    async def _dismiss(self, client: "ClientHandle") -> None:
        self._give(None if self._who == client.client_id else self._who)


def _name(visitor: int | None) -> str:
    return "Nobody" if visitor is None else f"Visitor {visitor + 1}"
