"""A UDP socket with as long a queue as the system gives."""

import errno
import socket
import sys

from pretouch.errors import HardwareError

HOST = "127.0.0.1"
"""Where sensor units send to, unless somebody says otherwise: only what runs on this machine is heard there, real units
need `EVERYWHERE`."""
PORT = 29470
"""UDP port of the receiver: of those that IANA has assigned to nobody, and below those that a system gives to whoever
asks for any (of Linux: from 32768), which may be taken when the receiver starts."""
EVERYWHERE = "0.0.0.0"  # noqa: S104
"""All addresses of this machine."""
_SO_RCVBUFFORCE = 33
"""Of Linux."""


def demand_port(host: str, port: int) -> None:
    """Raise a HardwareError for what is no port."""
    if type(port) is not int or not 0 <= port <= 0xFFFF:
        raise HardwareError(
            f"The port {port!r} for {host} is not valid: choose one from 1 to 65535, or 0 for any free port."
        )


def bind(host: str, port: int, buffer_bytes: int) -> socket.socket:
    """Open a socket that never blocks, at this address; one that cannot be had is a HardwareError."""
    demand_port(host, port)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE
        )[0]
        opened = socket.socket(family, kind, protocol)
    except (OSError, UnicodeError) as error:
        raise HardwareError(f"The address {host}, port {port}, cannot be listened on: {error}.") from None
    try:
        opened.setblocking(False)
        _widen(opened, buffer_bytes)
        opened.bind(address)
    except OSError as error:
        opened.close()
        if error.errno == errno.EADDRINUSE:
            raise HardwareError(
                f"Port {port} of {host} is in use: end the program that listens there, or choose another port."
            ) from None
        raise HardwareError(f"Listening on {host}, port {port}, failed: {error.strerror}.") from None
    return opened


def _widen(opened: socket.socket, buffer_bytes: int) -> None:
    """Ask for a long queue: past the system's limit if that is allowed."""
    if sys.platform == "linux":
        try:
            opened.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, buffer_bytes)
        except PermissionError:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)
    else:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)
