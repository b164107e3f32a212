"""The web server of a page: for this machine alone by default, at the port of its options, and quiet."""

import errno
import ipaddress
import logging
import os
import secrets
import socket
import sys
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING

from pretouch.errors import ViewerError
from pretouch.extras import LIVE

if TYPE_CHECKING:
    from viser import ViserServer

_EVERYWHERE = {"0.0.0.0": "localhost", "::": "localhost"}  # noqa: S104  # named to be replaced


@dataclass(frozen=True)
class ServeOptions:
    """Address of a page."""

    host: str = "127.0.0.1"
    """Address to listen on: by default this machine alone can open the page, 0.0.0.0 lets everybody."""
    port: int = 8080
    """Port to listen on."""
    opened: bool = False
    """Open the page in this machine's browser."""
    token: str = field(default_factory=secrets.token_urlsafe, repr=False)
    """Secret part of the address, without which the server does not answer; new at each start."""


def url_of(options: ServeOptions) -> str:
    """Address to open in a browser; whoever has it may use the page."""
    host = _EVERYWHERE.get(options.host, options.host)
    return f"http://{f'[{host}]' if ':' in host else host}:{options.port}/{options.token}/"


def announce(options: ServeOptions, what: str, exposed: str, say: Callable[[str], None]) -> None:
    """Print a page's address, and what is `exposed` beyond this machine; open it if requested."""
    say(f"{what} is at {url_of(options)} (Ctrl-C ends it).")
    if not _stays_here(options.host):
        say(f"Mind: other machines reach this page, unencrypted. Whoever has the address can {exposed}.")
    if options.opened:
        webbrowser.open(url_of(options))


def browser_here() -> bool:
    """Return True if somebody sits at this machine's terminal and has a screen to open a page on."""
    return sys.stdout.isatty() and not os.environ.keys().isdisjoint({"DISPLAY", "WAYLAND_DISPLAY"})


def _stays_here(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@contextmanager
def served(options: ServeOptions, title: str) -> Iterator["ViserServer"]:
    """Serve an empty page while the context lasts; a ViewerError names what is missing or in the way."""
    LIVE.need("The page")
    check_port(options)
    from pretouch.page.door import GuardedServer

    with _quiet():
        server = GuardedServer(options, title)
        try:
            if server.get_port() != options.port:
                raise _busy(options)
            yield server
        finally:
            server.stop()


@contextmanager
def begun(
    options: ServeOptions, title: str, what: str, exposed: str, say: Callable[[str], None]
) -> Iterator[Callable[[], "ViserServer"]]:
    """Serve a page that says it is being made, and announce it: reading and compiling may take a while.

    Gives what takes the notice away and returns the server, for when there is something to see.
    """
    with served(options, title) as server:
        notice = server.gui.add_html(f"<div style='padding:12px'>{escape(what)} is being read.</div>")
        announce(options, what, exposed, say)

        def ready() -> "ViserServer":
            notice.remove()
            return server

        yield ready


def check_port(options: ServeOptions) -> None:
    """Refuse a port that is taken, or may not be opened, and a host that is not this machine's."""
    if not 1 <= options.port <= 65535:
        raise ViewerError(f"The port is {options.port}: give one from 1 to 65535.")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(options.host, options.port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except PermissionError as error:
        raise ViewerError(
            f"This user may not open port {options.port}: choose one from 1024 on with --port."
        ) from error
    except OSError as error:
        if isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL:
            raise ViewerError(
                f"The host {options.host!r} is not an address of this machine: leave it out, or give one."
            ) from error
        raise _busy(options) from error


def _busy(options: ServeOptions) -> ViewerError:
    return ViewerError(
        f"Port {options.port} on {options.host} is in use, perhaps by another page: choose another with --port."
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the server from printing its banner, and errors of visitors with another protocol."""
    import rich

    console, log = rich.get_console(), logging.getLogger("websockets")
    before, console.quiet = console.quiet, True
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        console.quiet = before
        log.setLevel(level)
