"""One process to an arm: a second one would fight with it over the arm, or be kept waiting by it."""

import socket
import struct

from pretouch.errors import RobotError

_CREDENTIALS = struct.Struct("3i")
_ASK_S = 1.0
"""Longest wait for the holder's number [s]: it answers nobody, and so many may ask."""


class ArmLock:
    """Holds an arm for this process; the system lets go of it when the process ends, however it does.

    An abstract socket of Linux: unlike a file it is nobody's to leave behind, and all users of the machine see it.
    """

    def __init__(self, address: str) -> None:
        """Take the arm at an IP address; if another process has it, that is a RobotError with its number."""
        self._socket = socket.socket(socket.AF_UNIX)
        name = f"\0pretouch-franka-{address}"
        try:
            self._socket.bind(name)
            self._socket.listen()
        except OSError:
            self._socket.close()
            raise RobotError(
                f"The arm at {address} is in use by {_holder(name)} on this machine: end that program first."
            ) from None

    def release(self) -> None:
        """Let another process have the arm."""
        self._socket.close()


def _holder(name: str) -> str:
    """Name the process that listens at an abstract address."""
    try:
        with socket.socket(socket.AF_UNIX) as asking:
            asking.settimeout(_ASK_S)
            asking.connect(name)
            pid, _, _ = _CREDENTIALS.unpack(asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
    except OSError:
        return "another process"
    return f"process {pid}"
