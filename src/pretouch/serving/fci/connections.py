"""The TCP side of the server: who is connected, and the requests that come. Nothing here blocks."""

import socket
from dataclasses import dataclass

from pretouch.errors import RobotError
from pretouch.serving.fci.wire import HEADER, REQUEST_MOST, Protocol

_WAITING_MOST = 16
"""So many connections may be open without having asked to be served."""
_READ_MOST = 4096
_KEEPALIVE_S = 5
"""A client whose machine is gone is given up after about so long [s]."""


CLOSED = "closed by the client"
"""Why a connection ends that needs no word."""


class Disconnected(Exception):
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
        self._received = b""
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in (("TCP_KEEPIDLE", 1), ("TCP_KEEPINTVL", 1), ("TCP_KEEPCNT", _KEEPALIVE_S)):
            if hasattr(socket, option):
                sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)

    def requests(self, protocol: Protocol) -> list[Request]:
        """Return the requests that have come; raise Disconnected if the other end closed, or sends anything else."""
        try:
            data = self.sock.recv(_READ_MOST)
        except BlockingIOError:
            return []
        except OSError as error:
            raise Disconnected(f"connection lost ({error.strerror})") from None
        if not data:
            raise Disconnected(CLOSED)
        self._received += data
        found = []
        while (request := self._next(protocol)) is not None:
            found.append(request)
        return found

    def _next(self, protocol: Protocol) -> Request | None:
        if len(self._received) < HEADER.size:
            return None
        number, identifier, size = HEADER.unpack_from(self._received)
        if number >= len(protocol.requests) or not HEADER.size <= size <= REQUEST_MOST:
            raise Disconnected(f"message {number} of {size} B is not part of FCI {protocol.version}")
        name = protocol.requests[number]
        if size - HEADER.size != protocol.sizes[name]:
            raise Disconnected(f"{name} has {size - HEADER.size} B instead of {protocol.sizes[name]} B")
        if len(self._received) < size:
            return None
        body, self._received = self._received[HEADER.size : size], self._received[size:]
        return Request(name, identifier, body)

    def send(self, message: bytes) -> None:
        """Send; raise Disconnected if the other end does not accept it."""
        try:
            sent = self.sock.send(message)
        except OSError as error:
            raise Disconnected(f"does not take answers ({error.strerror})") from None
        if sent < len(message):
            raise Disconnected("does not read its answers")

    def close(self) -> None:
        """Close it."""
        self.sock.close()


class Listener:
    """Accepts clients, which wait here until they have named their protocol version."""

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
                f"Listening on {host}:{port} failed ({error}): give another --host, such as 127.0.0.2, or end the"
                " program that uses it."
            ) from None
        self.sock.setblocking(False)
        self.waiting: list[Connection] = []
        """Connections that have not asked to be served, the oldest first."""

    def admit(self, taken: bool) -> None:
        """Accept a connection; while the robot is in use, refuse it as the robot does."""
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
        """Refuse all that wait."""
        while self.waiting:
            self.waiting.pop().close()

    def close(self) -> None:
        """Stop listening."""
        self.clear()
        self.sock.close()
