"""Access to a page: whoever has its address may open it. Other sites' pages may not, and nobody can share it.

viser's server asks nobody where they come from, and opens a tunnel to the outside for whoever asks.
"""

import ipaddress
import secrets
import socket
import threading
from collections.abc import Callable
from functools import partial
from html import escape
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from viser import ViserServer
from websockets.asyncio import server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from pretouch.errors import ViewerError

if TYPE_CHECKING:
    from pretouch.page.server import ServeOptions

_ADDRESS = "Open the page at the address that the program printed: each start has its own."
_STARTING = threading.Lock()
_TITLE = b"<title>Viser<"


class GuardedServer(ViserServer):
    """A server of pages that answers whoever has the address, and is shared with nobody."""

    def __init__(self, options: "ServeOptions", title: str) -> None:
        """Begin to serve an empty page.

        viser begins its websockets with a `process_request` of its own, keeps no reference to it, and takes no other:
        so the function that it calls is replaced meanwhile.
        """
        self._token, here = options.token.encode(), socket.gethostname().lower()
        self._title = escape(title).encode()
        self._names = {options.host.lower(), "localhost", here, f"{here}.local"}
        serve, begun = websockets_server.serve, threading.Event()

        def guarded(*place: Any, process_request: Any, **more: Any) -> Any:
            begun.set()
            return serve(*place, process_request=partial(self._answer, process_request), **more)

        with _STARTING:
            setattr(websockets_server, "serve", guarded)  # noqa: B010  # to mypy a class cannot be replaced
            try:
                super().__init__(options.host, options.port, label=title, verbose=False)
            finally:
                setattr(websockets_server, "serve", serve)  # noqa: B010
        if not begun.is_set():
            self.stop()
            raise ViewerError("This version of viser begins its server in another way: install viser 1.1.1.")

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Open no tunnel to the outside, whoever asks."""
        return None

    def _answer(
        self, answer: Callable[..., Response | None], connection: ServerConnection, request: Request
    ) -> Response | None:
        refusal = self._refusal(request)
        if refusal:  # a name in it may be no ASCII, as its lone surrogates say
            refusal = refusal.encode(errors="backslashreplace").decode()
            return connection.respond(HTTPStatus.FORBIDDEN, refusal + "\n")
        request.path = "/" + request.path.partition("?")[0].lstrip("/").partition("/")[2]
        if "Accept-Encoding" in request.headers:
            del request.headers["Accept-Encoding"]  # compressed, the page's title could not be replaced
        response = answer(connection, request)
        if response is not None:
            if _TITLE in (response.body or b""):
                response.body = response.body.replace(_TITLE, b"<title>%b<" % self._title)
                del response.headers["Content-Length"]
                response.headers["Content-Length"] = str(len(response.body))
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
        """Return True if a host is this machine's: a name that somebody else chose may lead here, a number may not."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
            return name in self._names or bool(ipaddress.ip_address(name))
        except ValueError:
            return False
