"""The TCP side of the server: who is connected, and the requests that come. Nothing here blocks."""

import socket
from dataclasses import dataclass

from pretouch.errors import RobotError
from pretouch.serving.fci.wire import HEADER, REQUEST_MOST, Protocol

_WAITING_MOST = 16
"""So many connections may be open without having asked to be served."""
_READ_MOST = 4096
_UNHEARD_S = 5
"""A client whose machine is gone is given up after about so long [s]."""


class Gone(Exception):
    """A connection is over: closed by its other end, or not to be kept."""


@dataclass(frozen=True, slots=True)
class Request:
    """One request of a client."""

    name: str
    """As of `Protocol.requests`."""
    identifier: int
    body: bytes


class Connection:
    """One TCP connection."""

    def __init__(self, sock: socket.socket, peer: str) -> None:
        self.sock, self.peer = sock, peer
        self._came = b""
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in (("TCP_KEEPIDLE", 1), ("TCP_KEEPINTVL", 1), ("TCP_KEEPCNT", _UNHEARD_S)):
            if hasattr(socket, option):
                sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)

    def requests(self, protocol: Protocol) -> list[Request]:
        """Return the requests that have come; raise Gone if the other end closed, or sends what is none."""
        try:
            data = self.sock.recv(_READ_MOST)
        except BlockingIOError:
            return []
        except OSError as error:
            raise Gone(f"connection lost ({error.strerror})") from None
        if not data:
            raise Gone("closed by the client")
        self._came += data
        found = []
        while (request := self._next(protocol)) is not None:
            found.append(request)
        return found

    def _next(self, protocol: Protocol) -> Request | None:
        if len(self._came) < HEADER.size:
            return None
        number, identifier, size = HEADER.unpack_from(self._came)
        if number >= len(protocol.requests) or not HEADER.size <= size <= REQUEST_MOST:
            raise Gone(f"message {number} of {size} B is none of FCI {protocol.version}")
        name = protocol.requests[number]
        if size - HEADER.size != protocol.sizes[name]:
            raise Gone(f"{name} has {size - HEADER.size} B, and must have {protocol.sizes[name]}")
        if len(self._came) < size:
            return None
        body, self._came = self._came[HEADER.size : size], self._came[size:]
        return Request(name, identifier, body)

    def send(self, message: bytes) -> None:
        """Send; raise Gone if the other end does not take it."""
        try:
            sent = self.sock.send(message)
        except OSError as error:
            raise Gone(f"does not take answers ({error.strerror})") from None
        if sent < len(message):
            raise Gone("does not read its answers")

    def close(self) -> None:
        """Close it."""
        self.sock.close()


class Door:
    """Where clients come in, and wait until they have said what they speak."""

    def __init__(self, host: str, port: int) -> None:
        """Listen; an address that cannot be had is a RobotError."""
        self.sock = socket.socket()
        try:
            self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self.sock.bind((host, port))
            self.sock.listen()
        except (OSError, OverflowError) as error:
            self.sock.close()
            raise RobotError(
                f"Nothing can be served at {host}:{port} ({error}): give another --host, as 127.0.0.2, or end what is"
                " there."
            ) from None
        self.sock.setblocking(False)
        self.waiting: list[Connection] = []
        """Connections that have not asked to be served, the oldest first."""

    def admit(self, taken: bool) -> None:
        """Take in who is at the door; while the robot is taken, turn them away as it does."""
        try:
            sock, (peer, _) = self.sock.accept()
        except OSError:  # gone before it was taken in
            return
        if taken:
            sock.close()
            return
        self.waiting.append(Connection(sock, peer))
        if len(self.waiting) > _WAITING_MOST:
            self.waiting.pop(0).close()

    def clear(self) -> None:
        """Turn away all who wait."""
        while self.waiting:
            self.waiting.pop().close()

    def close(self) -> None:
        """Listen no more."""
        self.clear()
        self.sock.close()
