"""The TCP side of the server: who is connected, and the requests that come. Nothing here blocks."""

import socket
from collections.abc import Callable, Container
from dataclasses import dataclass

from pretouch.errors import RobotError
from pretouch_fci.wire import CONNECT, REQUEST_MOST, WireInterface

_WAITING_MOST = 16
"""So many connections may be open without having asked to be served."""
_READS_BEFORE_REFUSAL = 8
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
    """Name, one of `WireInterface.requests`."""
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

    def requests(self, interface: WireInterface) -> list[Request]:
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
        requests = []
        while (request := self._next(interface)) is not None:
            requests.append(request)
        return requests

    def _next(self, interface: WireInterface) -> Request | None:
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


def _listening(host: str, port: int) -> socket.socket:
    """Listen; an address that cannot be had is a RobotError."""
    sock = socket.socket()
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind((host, port))
        sock.listen()
    except (OSError, OverflowError) as error:
        sock.close()
        raise RobotError(
            f"Listening on {host}:{port} failed ({error}): give another --host, such as 127.0.0.2, or end the"
            " program that uses it."
        ) from None
    sock.setblocking(False)
    return sock


class ClientPort:
    """A TCP port that serves one client at a time, and the UDP socket from which it is sent states.

    Clients wait until they have named their protocol version. Whoever serves says what is done when one has come, asks
    for something, and has gone.
    """

    def __init__(
        self, host: str, port: int, interface: WireInterface, say: Callable[[str], None], of: str = ""
    ) -> None:
        """Listen; an address that cannot be had is a RobotError. `say` is handed a line on each client, of what."""
        self._interface, self._say, self._of = interface, say, of
        self._listening = _listening(host, port)
        self.address: tuple[str, int] = self._listening.getsockname()
        """Address that it listens on."""
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind((self.address[0], 0))
        self._udp.setblocking(False)
        self._waiting: list[Connection] = []
        """Connections that have not asked to be served, the oldest first."""
        self._client: Connection | None = None
        self._client_udp = ("", 0)

    @property
    def sockets(self) -> list[socket.socket]:
        """Sockets that may receive by TCP."""
        client = [] if self._client is None else [self._client.sock]
        return [self._listening, *client, *(waiting.sock for waiting in self._waiting)]

    def close(self) -> None:
        """Disconnect the client and stop listening."""
        if self._client is not None:
            self._client.close()
        self._refuse_waiting()
        self._listening.close()
        self._udp.close()

    def _came(self, client: Connection) -> None:
        """Begin to serve a client."""
        raise NotImplementedError

    def _follow(self, requests: list[Request]) -> None:
        """Do what the client asks for; Disconnected where it is not to be kept."""
        raise NotImplementedError

    def _gone(self) -> None:
        """End what the client has begun."""
        raise NotImplementedError

    def _serve_ready(self, ready: Container[object]) -> None:
        """Serve those sockets at which something has come."""
        if self._client is not None and self._client.sock in ready:
            self._read()
        if self._listening in ready:
            for _ in range(_READS_BEFORE_REFUSAL):  # a client that has gone makes room for the next
                self._read()
            self._admit()
        for connection in [waiting for waiting in self._waiting if waiting.sock in ready]:
            if connection in self._waiting:  # else another one is served now
                self._greet(connection)

    def _read(self) -> None:
        client = self._client
        if client is not None:
            self._attempt(lambda: self._follow(client.requests(self._interface)))

    def _admit(self) -> None:
        """Accept a connection; while the robot is in use, refuse it as the robot does."""
        try:
            sock, (peer, _) = self._listening.accept()
        except OSError:  # gone before it was taken in
            return
        if self._client is not None:
            sock.close()
            return
        self._waiting.append(Connection(sock, peer))
        if len(self._waiting) > _WAITING_MOST:
            self._waiting.pop(0).close()

    def _greet(self, connection: Connection) -> None:
        """Read the protocol version of a connection; the first with that of the robot is served, no other waits."""
        interface = self._interface
        try:
            requests = connection.requests(interface)
            if not requests:
                return
            if requests[0].name != "Connect":
                raise Disconnected(f"asks for {requests[0].name} before it has connected")
            version, udp_port = CONNECT.unpack(requests[0].body)
            fits = version == interface.version
            answer = interface.status.pack(not fits) + interface.version.to_bytes(2, "little")
            connection.send(interface.reply("Connect", requests[0].identifier, answer))
            if not fits:
                raise Disconnected(f"speaks {interface.name} {version}, this robot {interface.version}")
        except Disconnected as why:
            self._waiting.remove(connection)
            connection.close()
            if str(why) != CLOSED:
                self._say(f"Not served: {connection.peer} {why}.")
            return
        self._waiting.remove(connection)
        self._refuse_waiting()
        self._client, self._client_udp = connection, (connection.peer, udp_port)
        self._came(connection)
        self._say(f"Client {connection.peer}{self._of} connected.")
        self._attempt(lambda: self._follow(requests[1:]))

    def _refuse_waiting(self) -> None:
        while self._waiting:
            self._waiting.pop().close()

    def _attempt(self, do: Callable[[], None]) -> None:
        """Do something for the client; disconnect it if that fails."""
        try:
            do()
        except Disconnected as why:
            if self._client is None:
                return
            self._say(f"Client {self._client.peer}{self._of} disconnected: {why}.")
            self._client.close()
            self._client = None
            self._gone()

    def _send(self, state: bytes) -> None:
        """Send the client a state, if there is one."""
        if self._client is not None:
            try:
                self._udp.sendto(state, self._client_udp)
            except OSError:  # nobody there any more: its TCP connection tells
                return
