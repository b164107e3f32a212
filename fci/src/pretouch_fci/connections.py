"""The TCP side of the server: who is connected, and the requests that come. Nothing here blocks."""

import socket
from collections.abc import Callable
from dataclasses import dataclass

from pretouch.errors import RobotError
from pretouch_fci.wire import CONNECT, REQUEST_MOST, Interface

_WAITING_MOST = 16
"""So many connections may be open without having asked to be served."""
READS_BEFORE_REFUSAL = 8
"""Before another client is refused, the requests of the current one are read so many times."""
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
    """As of `Interface.requests`."""
    identifier: int
    body: bytes


@dataclass(frozen=True, slots=True)
class Greeting:
    """What a client has said that is to be served."""

    udp: tuple[str, int]
    """Where it takes states."""
    requests: list[Request]
    """What it has asked for at once."""


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

    def requests(self, interface: Interface) -> list[Request]:
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
        while (request := self._next(interface)) is not None:
            found.append(request)
        return found

    def _next(self, interface: Interface) -> Request | None:
        header = interface.header
        if len(self._received) < header.size:
            return None
        number, identifier, size = header.unpack_from(self._received)
        if number >= len(interface.requests) or not header.size <= size <= REQUEST_MOST:
            raise Disconnected(f"message {number} of {size} B is not part of {interface.name} {interface.version}")
        name = interface.requests[number]
        if size - header.size != interface.sizes[name]:
            raise Disconnected(f"{name} has {size - header.size} B instead of {interface.sizes[name]} B")
        if len(self._received) < size:
            return None
        body, self._received = self._received[header.size : size], self._received[size:]
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

    def greet(self, connection: Connection, interface: Interface, say: Callable[[str], None]) -> Greeting | None:
        """Read the protocol version of a connection; the first with that of the robot is served, no other waits."""
        if connection not in self.waiting:
            return None
        try:
            requests = connection.requests(interface)
            if not requests:
                return None
            if requests[0].name != "Connect":
                raise Disconnected(f"asks for {requests[0].name} before it has connected")
            version, port = CONNECT.unpack(requests[0].body)
            fits = version == interface.version
            answer = interface.status.pack(not fits) + interface.version.to_bytes(2, "little")
            connection.send(interface.reply("Connect", requests[0].identifier, answer))
            if version == 0:  # asks only whether anybody answers
                raise Disconnected(CLOSED)
            if not fits:
                raise Disconnected(f"speaks {interface.name} {version}, this robot {interface.version}")
        except Disconnected as why:
            self.waiting.remove(connection)
            connection.close()
            if str(why) != CLOSED:
                say(f"Not served: {connection.peer} {why}.")
            return None
        self.waiting.remove(connection)
        self.clear()
        return Greeting((connection.peer, port), requests[1:])

    def clear(self) -> None:
        """Refuse all that wait."""
        while self.waiting:
            self.waiting.pop().close()

    def close(self) -> None:
        """Stop listening."""
        self.clear()
        self.sock.close()
