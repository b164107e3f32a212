"""Somebody at a page without a browser: speaks viser's messages, and may lie."""

import http.client
import itertools
import math
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import msgspec
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from pretouch.page.live import LivePage
from pretouch.page.server import ServeOptions, url_of

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
PATIENCE_S = 20.0
"""Time a page on a busy machine is given [s]."""
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [2.0, 1.0, 1.0], "fov": 0.9, "near": 0.1,
    "far": 100.0, "image_height": 600, "image_width": 800, "look_at": [0.0, 0.0, 0.5], "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip


def until(true: Callable[[], bool]) -> None:
    """Wait until something holds that another thread does."""
    deadline = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline, "it has not come to pass"
        time.sleep(0.01)


def answered(options: ServeOptions, path: bytes = b"", headers: bytes = b"") -> tuple[int, str, str]:
    """Status, text and kind of what is answered at a path and with headers, of any bytes; by default the page's own."""
    path = path or f"/{options.token}/".encode()
    headers = headers or f"Host: {options.host}:{options.port}".encode()
    with socket.create_connection((options.host, options.port), PATIENCE_S) as sock:
        sock.sendall(b"GET " + path + b" HTTP/1.1\r\n" + headers + b"\r\n\r\n")
        answer = http.client.HTTPResponse(sock)
        answer.begin()
        return answer.status, answer.read().decode(errors="replace"), answer.headers["Content-Type"]


class Visitor:
    """One connection to a page that is served, open while the context lasts."""

    def __init__(self, server: viser.ViserServer, options: ServeOptions) -> None:
        self._server, self._stack = server, ExitStack()
        before = set(server.get_clients())
        address = url_of(options).replace("http", "ws", 1).rstrip("/")
        self._socket = self._stack.enter_context(
            connect(address, subprotocols=[PROTOCOL], max_size=None, max_queue=None)
        )
        self.say(CAMERA)  # viser knows a visitor only once he has said where he looks from
        until(lambda: set(server.get_clients()) > before)
        (self.number,) = set(server.get_clients()) - before
        self._marks = itertools.count(1)

    def __enter__(self) -> "Visitor":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
        until(lambda: self.number not in self._server.get_clients())

    def say(self, message: dict[str, Any]) -> None:
        self._socket.send(msgspec.msgpack.encode(message))

    def set(self, handle: Any, value: object) -> None:
        """Give a control a value, as the page does."""
        self.say(update(handle, value=value))

    def type_text(self, handle: Any, text: str) -> None:
        """Type into a field of a form, and press Enter."""
        self.set(handle, text)
        self.say({"type": "GuiFormSubmitMessage", "uuid": handle._impl.parent_container_id})
        self.settle()

    def wait_for_callbacks(self) -> None:
        """Wait until all that viser does in threads of its own for what was said has been done."""
        self._server._thread_executor.submit(int).result(PATIENCE_S)

    def settle(self) -> None:
        """Wait until all that was said has been heard: what is said last is where somebody looks from."""
        near = 0.1 + 0.001 * next(self._marks)

        def heard() -> bool:  # who says too much is not heard at first
            self.say({**CAMERA, "near": near})
            return math.isclose(self._server.get_clients()[self.number].camera.near, near)

        until(heard)


def control(page: LivePage, label: str) -> Any:
    """The first control of a page with a label."""
    handles = page._server.gui._gui_input_handle_from_uuid.values()
    return next(handle for handle in handles if getattr(handle, "label", None) == label)


def update(handle: Any, **updates: object) -> dict[str, Any]:
    """What viser's client sends of a control."""
    return {"type": "GuiUpdateMessage", "uuid": handle._impl.uuid, "updates": updates}


def refusal(options: ServeOptions, path: str = "", origin: str | None = None) -> tuple[int, str]:
    """Status and sentence with which a connection is refused."""
    address = f"ws://{options.host}:{options.port}{path or '/' + options.token}"
    try:
        with connect(address, origin=origin, subprotocols=[PROTOCOL]):
            return 101, ""
    except InvalidStatus as error:
        return error.response.status_code, error.response.body.decode()
