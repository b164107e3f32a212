"""The door of a page: who may come in, what a visitor may say, and how often. Nothing else gets to the page.

viser's server asks nobody where they come from, takes each message as it is, and opens a tunnel to the outside for
whoever asks. So each connection is refused or begun here, and each message is read, checked, and written anew.
"""

import ipaddress
import reprlib
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from functools import partial
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import msgspec
from viser import GuiButtonHandle, GuiCheckboxHandle, GuiDropdownHandle, GuiSliderHandle, GuiTextHandle, ViserServer
from viser import _messages as viser_messages
from viser._messages import (
    GuiUpdateMessage,
    SceneNodeDragMessage,
    SetOrientationMessage,
    SetPositionMessage,
    TransformControlsDragEndMessage,
    TransformControlsDragStartMessage,
    TransformControlsUpdateMessage,
    ViewerCameraMessage,
)
from websockets.asyncio import server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from pretouch.errors import ViewerError
from pretouch.viewer.commander import Commander

if TYPE_CHECKING:
    from pretouch.viewer.server import ServeOptions

RATE_HZ, BURST = 100.0, 200.0
"""Messages a second that a visitor is heard with, and at once; a camera that turns sends fifty a second."""
LONGEST_TEXT = 40
"""Characters of a text that is typed."""
_MOST_BYTES = 4096
_LARGEST = 1e6
"""Largest number in a message: places are in metres, pictures in pixels."""
_TOLD_EVERY_S = 1.0
_HANDLE = TransformControlsUpdateMessage, TransformControlsDragStartMessage, TransformControlsDragEndMessage
"""What is said of a handle in the scene that is dragged."""
_KINDS: dict[str, Any] = {
    kind.__name__: kind for kind in (ViewerCameraMessage, GuiUpdateMessage, SceneNodeDragMessage, *_HANDLE)
}
"""All that a page has to say."""
_ADDRESS = "Open the page at the address that the program printed: each start has its own."
_STARTING = threading.Lock()


class Refused(ViewerError):
    """What a visitor said is not passed on; the sentence is for the visitor."""


class PageServer(ViserServer):
    """A server behind a door."""

    commander: Commander
    """Who of its visitors commands."""


class _Visit(ServerConnection):
    """A connection whose messages come through the door."""

    def __init__(self, door: "Door", *given: Any, **more: Any) -> None:
        super().__init__(*given, **more)
        self._door = door
        self._left, self._since, self._told = BURST, time.monotonic(), -_TOLD_EVERY_S

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next message that is passed on."""
        while (passed := self._door.admitted(self, await super().recv(decode))) is None:
            pass
        return passed

    def spend(self) -> None:
        """Count a message; refuse one too many."""
        now = time.monotonic()
        self._left, self._since = min(BURST, self._left + RATE_HZ * (now - self._since)), now
        if self._left < 1.0:
            raise Refused(f"More than {RATE_HZ:.0f} messages a second: those beyond are left out.")
        self._left -= 1.0

    def to_be_told(self) -> bool:
        """Whether the last refusal was told long enough ago for another."""
        late = self._since - self._told >= _TOLD_EVERY_S
        self._told = self._since if late else self._told
        return late


class Door:
    """Stands between a server of pages and everybody."""

    def __init__(self, options: "ServeOptions") -> None:
        self._token = options.token.encode()
        here = socket.gethostname().lower()
        self._names = {options.host.lower(), "localhost", here, f"{here}.local"}
        self._server: PageServer | None = None
        self._built = False

    @contextmanager
    def built(self) -> Iterator[None]:
        """Give this door to the server that is begun in the context: viser offers no other way."""
        theirs = websockets_server.serve

        def serve(*place: Any, process_request: Any, **more: Any) -> Any:
            self._built = True
            more |= {"max_size": _MOST_BYTES, "create_connection": partial(_Visit, self)}
            return theirs(*place, process_request=partial(self._answer, process_request), **more)

        with _STARTING:
            setattr(websockets_server, "serve", serve)  # noqa: B010  # to mypy a class cannot be replaced
            try:
                yield
            finally:
                setattr(websockets_server, "serve", theirs)  # noqa: B010

    def keep(self, server: PageServer) -> None:
        """Let people in to a server, which no longer shares its page; one without this door is a ViewerError."""
        if not self._built:
            raise ViewerError("This version of viser goes round the checks of the page: install viser 1.1.1.")
        for kind in (viser_messages.ShareUrlRequest, viser_messages.ShareUrlDisconnect):
            server._websock_server.unregister_handler(kind)
        server.commander = Commander(server)
        self._server = server

    # who may come in

    def _answer(
        self, theirs: Callable[..., Response | None], connection: ServerConnection, request: Request
    ) -> Response | None:
        refusal = self._refusal(request)
        if refusal:  # a name in it may be no ASCII, as its lone surrogates say
            refusal = refusal.encode(errors="backslashreplace").decode()
            return connection.respond(HTTPStatus.FORBIDDEN, refusal + "\n")
        request.path = "/" + request.path.partition("?")[0].lstrip("/").partition("/")[2]
        response = theirs(connection, request)
        if response is not None:
            response.headers["Referrer-Policy"] = "no-referrer"  # it would tell the token
        return response

    def _refusal(self, request: Request) -> str:
        """Say why a request is not answered, or ''."""
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or not self._is_own(hosts[0]):
            return f"This page is not at {' and '.join(hosts)}. {_ADDRESS}"
        if any(origin.partition("//")[2] != hosts[0] for origin in origins):
            return f"Pages of {' and '.join(origins)} may not use this one. {_ADDRESS}"
        token = request.path.partition("?")[0].lstrip("/").partition("/")[0]
        return "" if secrets.compare_digest(token.encode(errors="surrogateescape"), self._token) else _ADDRESS

    def _is_own(self, host: str) -> bool:
        """Whether a name is this machine's: one that somebody else chose may lead here, a number may not."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
            return name in self._names or bool(ipaddress.ip_address(name))
        except ValueError:
            return False

    # what may be said

    def admitted(self, visit: _Visit, raw: Any) -> bytes | None:
        """Return what viser is to hear of a message; None: nothing, and the visitor is told why."""
        server = self._server
        if server is None:
            return None
        connections = server._websock_server._live_connections
        number = next((number for number, known in connections.items() if known is visit), -1)
        try:
            visit.spend()
            heard = _understood(raw)
            if isinstance(heard, GuiUpdateMessage):
                heard = self._change(server, number, heard)
            elif isinstance(heard, _HANDLE):
                self._check_drag(server, number, heard.name)
            elif not isinstance(heard, ViewerCameraMessage):
                self._check_command(server, number)
            said = {field.name: getattr(heard, field.name) for field in fields(heard)}
            return msgspec.msgpack.encode(said | {"type": type(heard).__name__})
        except Refused as refused:
            client = server.get_clients().get(number)
            if client and visit.to_be_told():
                client.add_notification("Not done", str(refused), auto_close_seconds=6.0)
            return None

    def _check_command(self, server: PageServer, number: int, control: Any = None) -> None:
        refusal = server.commander.refusal(number, control)
        if refusal:
            raise Refused(refusal)

    def _check_drag(self, server: PageServer, number: int, name: str) -> None:
        """Check a drag of a handle in the scene; a visitor whose drag is refused is shown again where it is."""
        try:
            self._check_command(server, number)
        except Refused:
            client, handle = server.get_clients().get(number), server.scene.get_handle_by_name(name)
            if client and handle:
                queue = client._websock_connection.queue_message
                queue(SetPositionMessage(handle.name, tuple(map(float, handle.position))))  # type: ignore[arg-type]
                queue(SetOrientationMessage(handle.name, tuple(map(float, handle.wxyz))))  # type: ignore[arg-type]
            raise

    def _change(self, server: PageServer, number: int, heard: GuiUpdateMessage) -> GuiUpdateMessage:
        """Check a change of a control; a visitor whose change is refused is shown again what holds."""
        handle = server.gui._gui_input_handle_from_uuid.get(heard.uuid)
        if handle is None:
            raise Refused("This control is gone: load the page again.")
        try:
            value = _checked(handle, heard.updates)
            self._check_command(server, number, handle)
            return replace(heard, updates={"value": value})
        except Refused:
            client = server.get_clients().get(number)
            if client and not handle._impl.is_button:
                shown = GuiUpdateMessage(heard.uuid, {"value": handle.value})
                client._websock_connection.queue_message(shown)
            raise


def _understood(raw: Any) -> Any:
    """Read a message; refuse what a page does not say."""
    try:
        mapping = msgspec.msgpack.decode(raw)
        heard = msgspec.convert(mapping, _KINDS[mapping["type"]])
    except (msgspec.MsgspecError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise Refused("The page does not know what to do with this message: load it again.") from error
    if not _bounded(mapping.values()):
        raise Refused("A number in this message is none, or too large.")
    return heard


def _bounded(values: Iterable[object]) -> bool:
    """Whether no number of a message, in lists too, is NaN, infinite or too large."""
    left = list(values)
    while left:
        value = left.pop()
        if isinstance(value, list):
            left += value
        elif isinstance(value, int | float) and not -_LARGEST <= value <= _LARGEST:
            return False
    return True


def _checked(handle: Any, updates: dict[str, Any]) -> object:
    """Return the value that a control is to have; refuse one it cannot have, and all that is no value."""
    props, value = handle._impl.props, updates.get("value")
    if list(updates) != ["value"] or props.disabled or not props.visible:
        raise Refused(f"{props.label} cannot be changed now.")
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if isinstance(handle, GuiSliderHandle) and number and _bounded([value]):
        return float(min(max(value, props.min), props.max))  # who types 0.5 begins with 0
    fits, way_out = _rule(handle, value)
    if not fits:
        text = value if isinstance(value, str) else reprlib.repr(value)  # who nests lists deeply is not followed there
        raise Refused(f"{props.label} cannot be {text[:LONGEST_TEXT]}: {way_out}.")
    return value


def _rule(handle: Any, value: object) -> tuple[bool, str]:
    """Whether a control can have a value, and which it can have."""
    match handle:
        case GuiButtonHandle():
            return value is True, "press it"
        case GuiCheckboxHandle():
            return isinstance(value, bool), "tick it, or leave it empty"
        case GuiDropdownHandle():
            return value in handle.options, f"choose {', '.join(handle.options)}"
        case GuiTextHandle():
            return isinstance(value, str) and len(value) <= LONGEST_TEXT, f"write at most {LONGEST_TEXT} characters"
        case _:
            return False, "give a number"
