"""Connecting to a Franka arm through the vendor's own library, with a clear sentence where that fails."""

import socket
import time
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Literal, NamedTuple

from pretouch.arms.franka.arm_lock import ArmLock
from pretouch.arms.franka.state import FrankaState
from pretouch.errors import RobotError
from pretouch.extras import FRANKA
from pretouch.types import FloatArray

if TYPE_CHECKING:
    from pretouch.arms.franka.vendor import VendorClient

Kind = Literal["panda", "fr3"]
StateCallback = Callable[[FrankaState, float], tuple[FloatArray, bool]]
"""Given a state and the robot time since the one before [s], answers with joint velocities (7,) [rad/s] and whether the
motion is finished; it is then at rest."""

PORT = 1337
"""TCP port of the arm; the vendor's libraries have it built in."""
ANSWER_S = 3.0
"""Longest wait for the arm to take a connection, or to answer on it [s]."""


class Library(NamedTuple):
    """A library that speaks with an arm; our module of the arm's name calls it. Two cannot share a process."""

    module: str
    distribution: str
    version: int
    """Of the Franka Control Interface that it speaks."""


LIBRARIES: dict[Kind, Library] = {
    "panda": Library("panda_py", "panda-python", 5), "fr3": Library("pylibfranka", "pylibfranka", 10),
}  # fmt: skip
"""That of each arm."""


def need_library(kind: Kind) -> None:
    """Refuse to go on without the vendor's library for an arm, or what our own part needs: a MissingExtraError."""
    FRANKA.need("A Franka arm", LIBRARIES[kind].module, "ruckig")


def connect(address: str, kind: Kind) -> "VendorClient":
    """Connect to an arm; what stands in the way is a RobotError.

    A machine that takes the connection and then says nothing is waited for without end: the vendor's libraries know no
    bound. `arm.FrankaArm`, which connects in a process of its own, gives up after half a minute.

    Args:
        address: name or IP address of the arm.
        kind: which arm it is.
    """
    need_library(kind)
    lock = ArmLock(reachable(address, kind))
    try:
        client: VendorClient = import_module(f"pretouch.arms.franka.{kind}").open_client(address, lock)
    except BaseException:
        lock.release()
        raise
    return client


def attempt(kind: Kind, began: float) -> str:
    """Say in words what was tried to connect to an arm since an instant of `time.monotonic` [s]."""
    library = LIBRARIES[kind]
    return (
        f"tried for {time.monotonic() - began:.1f} s: TCP port {PORT}, for {library.distribution}, which speaks version"
        f" {library.version} of the Franka Control Interface (FCI)"
    )


def reachable(address: str, kind: Kind) -> str:
    """Return the IP address of an arm that takes connections; the vendor's libraries would wait for minutes."""
    began = time.monotonic()
    try:
        with socket.create_connection((address, PORT), ANSWER_S) as tried:
            return str(tried.getpeername()[0])
    except (socket.gaierror, UnicodeError):
        what = "there is no host of that name"
    except TimeoutError:
        what = f"nothing answers within {ANSWER_S:g} s"
    except ConnectionRefusedError:
        what = f"nothing listens on port {PORT} there"
    except OSError as error:
        what = f"it cannot be reached ({error.strerror})"
    raise RobotError(
        f"No Franka arm at {address}: {what} ({attempt(kind, began)}). Check the address and the cable, unlock the"
        " joints and activate FCI in Desk."
    )
