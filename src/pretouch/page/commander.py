"""Who commands a page: one visitor at a time, named to all. The others look."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from viser import ClientHandle, ViserServer


class Commander:
    """The visitor who commands: the first to act, until somebody else takes the command, or the visitor leaves."""

    def __init__(self, server: "ViserServer") -> None:
        self._server = server
        self._visitor: int | None = None
        self._line = server.gui.add_html("", visible=False)
        self._take = server.gui.add_button("Take command", visible=False, hint="The visitor who has it then looks.")
        self._take.on_click(self._taken)
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._dismiss)

    def admits(self, visitor: int) -> bool:
        """Whether a visitor who acts commands; while nobody does, this visitor commands from now on."""
        if self._visitor not in self._server.get_clients():
            self._give(visitor)
        return self._visitor == visitor

    def holds(self, visitor: int) -> bool:
        """Whether a visitor is there and commands."""
        return self._visitor == visitor and visitor in self._server.get_clients()

    def _give(self, visitor: int | None) -> None:
        self._visitor = visitor
        self._show()

    def _show(self) -> None:
        several = len(self._server.get_clients()) > 1
        self._line.content = f"<div id='commander' style='padding:2px 12px;font-size:12px'>{self._sentence()}</div>"
        self._line.visible = self._take.visible = several

    def _sentence(self) -> str:
        return (
            "Nobody commands: the first to act does." if self._visitor is None else f"{_name(self._visitor)} commands."
        )

    async def _taken(self, event: Any) -> None:
        self._give(event.client_id)

    async def _welcome(self, client: "ClientHandle") -> None:
        self._show()
        if self._visitor is not None:
            client.add_notification(f"You are {_name(client.client_id)}", self._sentence(), auto_close_seconds=10.0)

    async def _dismiss(self, client: "ClientHandle") -> None:
        self._give(None if self._visitor == client.client_id else self._visitor)


def _name(visitor: int) -> str:
    return f"Visitor {visitor + 1}"
