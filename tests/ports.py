"""Ports and addresses for tests that have to name one before anybody listens at it."""

import os
import socket
from itertools import count, islice

PORTS = range(10_000, 12_400)
"""Below those that the system gives to whoever asks for any (of Linux: from 32768), and below those of the tests' DDS
domains."""

# processes that are started one after another begin some way apart
_places = count(os.getpid() * 50)
_addresses = count(1)


def free_port() -> int:
    """A port of 127.0.0.1 that nobody has now, and that no socket is given which does not ask for it by name."""
    for place in islice(_places, len(PORTS)):
        port = PORTS[place % len(PORTS)]
        if all(_free(port, kind) for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM)):
            return port
    raise OSError(f"All ports from {PORTS[0]} to {PORTS[-1]} are taken.")


def loopback() -> str:
    """An address that no other test run on this machine uses at once: the vendor's libraries know one port alone."""
    pid = os.getpid()
    return f"127.{64 + pid // 250 % 128}.{1 + pid % 250}.{1 + next(_addresses) % 250}"


def _free(port: int, kind: socket.SocketKind) -> bool:
    with socket.socket(type=kind) as tried:
        try:
            tried.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True
