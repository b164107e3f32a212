"""A Franka arm through the vendor's own library: one port for both, and connecting with a clear sentence."""

import socket
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Literal, NamedTuple, Protocol, Self

from pretouch.errors import RobotError
from pretouch.extras import FRANKA
from pretouch.hardware.franka.arm_lock import ArmLock
from pretouch.hardware.franka.collision import CollisionBehavior
from pretouch.hardware.franka.state import FrankaState
from pretouch.types import FloatArray

Kind = Literal["panda", "fr3"]
StateCallback = Callable[[FrankaState, float], tuple[FloatArray, bool]]
"""Given a state and the robot time since the one before [s], answers with joint velocities (7,) [rad/s] and whether the
motion is finished; it is then at rest."""

PORT = 1337
"""TCP port of the arm; the vendor's libraries have it built in."""
ANSWER_S = 3.0
"""Longest wait for the arm to take a connection, or to answer on it [s]."""
_REALTIME_KERNEL = Path("/sys/kernel/realtime")


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


class Client(Protocol):
    """One connection to an arm, for one thread; a context manager."""

    kind: Kind

    def read(self) -> FrankaState:
        """Wait for the next state, while no motion runs."""
        ...

    def control(self, on_state: StateCallback) -> None:
        """Run a joint velocity motion, asking `on_state` for a command in each millisecond, until it is finished.

        The library's own rate limiter and low-pass filter are off: what `on_state` answers is what the arm gets. An
        exception of `on_state` stops the arm at once, as hard as it can, and is raised here. Raises MotionAborted
        (`errors`) if the arm ended the motion, and another RobotError if it is in no mode to move.
        """
        ...

    def set_collision_behavior(self, behavior: CollisionBehavior) -> None:
        """Tell the arm from which forces on it reports a contact, and from which it stops by itself."""
        ...

    def set_load(self, mass: float, com: FloatArray, inertia: FloatArray) -> None:
        """Tell the arm what it carries: mass [kg], its centre (3,) [m, flange frame] and inertia (3, 3) [kg m^2]."""
        ...

    def recover(self) -> None:
        """Leave the mode "reflex", as pressing the button in Desk does; a RobotError if no state says that it has."""
        ...

    def stop(self) -> None:
        """End any motion that runs, at once."""
        ...

    def close(self) -> None:
        """Let the arm be used by somebody else."""
        ...

    def __enter__(self) -> Self:
        """Return the client itself."""
        ...

    def __exit__(self, *_: object) -> None:
        """Close it."""
        ...


def need_library(kind: Kind) -> None:
    """Refuse to go on without the vendor's library for an arm, or what our own part needs: a MissingExtraError."""
    FRANKA.need("A Franka arm", LIBRARIES[kind].module, "ruckig")


def connect(address: str, kind: Kind, real_time: bool = False) -> Client:
    """Connect to an arm; what stands in the way is a RobotError.

    A machine that takes the connection and then says nothing is waited for without end: the vendor's libraries know no
    bound. `arm.FrankaArm`, which connects in a process of its own, gives up after half a minute.

    Args:
        address: name or IP address of the arm.
        kind: which arm it is.
        real_time: whether to refuse a kernel without real-time capabilities, as the vendor's libraries do.
    """
    need_library(kind)
    if real_time and not has_real_time_kernel():
        raise RobotError(
            "The kernel of this machine has no real-time capabilities: boot one with PREEMPT_RT, or connect without"
            " demand_real_time (the arm then stops when this machine is late 20 times in a row)."
        )
    lock = ArmLock(reachable(address, kind))
    try:
        opened: Client = import_module(f"pretouch.hardware.franka.{kind}").open_client(address, real_time, lock)
    except BaseException:
        lock.release()
        raise
    return opened


def has_real_time_kernel() -> bool:
    """Whether this machine runs a kernel with PREEMPT_RT, by the sign that libfranka goes by."""
    try:
        return _REALTIME_KERNEL.read_text().startswith("1")
    except OSError:
        return False


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
