"""Connection to a Franka arm through the vendor's libraries, with a clear sentence for each failure."""

import re
import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple
from importlib import import_module
from typing import Any, Literal, NamedTuple, Self

from pretouch.arms.franka.limits import CollisionBehavior
from pretouch.arms.franka.state import FrankaState, error_names, franka_state
from pretouch.errors import RobotError
from pretouch.extras import FRANKA
from pretouch.types import FloatArray

Kind = Literal["panda", "fr3"]
StateCallback = Callable[[FrankaState, float], tuple[FloatArray, bool]]
"""Given a state and the robot time since the one before [s], answers with joint velocities (7,) [rad/s] and whether the
motion is finished; it is then at rest."""

PORT = 1337
"""TCP port of the arm; the vendor's libraries have it built in."""
ANSWER_S = 3.0
"""Longest wait for the arm to take a connection, or to answer on it [s]."""
_ASK_S = 1.0
"""Longest wait for the number of the process that has an arm [s]: it answers nobody, and so many may ask."""
_STATES_AFTER = 500
"""States, one each millisecond, in which an arm that was told to recover must be seen to have done so."""
_NO_LOW_PASS_HZ = 1000.0
"""Cut-off frequency that libfranka takes for no filter; by default it filters at 100 Hz and limits rates."""
_CREDENTIALS = struct.Struct("3i")
_VERSION = re.compile(r"(?:server|protocol) version:? (\d+)")
"""Pattern of the interface version in both libraries' messages."""


class Library(NamedTuple):
    """A library that speaks with an arm. Two cannot share a process."""

    module: str
    distribution: str
    version: int
    """Version of the Franka Control Interface that it speaks."""
    other: str
    """Library for an arm that speaks another version."""


LIBRARIES: dict[Kind, Library] = {
    "panda": Library("panda_py.libfranka", "panda-python", 5, "fr3 for an FR3"),
    "fr3": Library("pylibfranka", "pylibfranka", 10, "panda for a Panda, or update an FR3 to system 5.9 or later"),
}
"""Library of each kind of arm."""
_RECOVER = "free it from what it touches, then let it recover"
_WAY_OUT = {
    "other": "it is not ready: open the brakes and activate FCI in Desk",
    "move": "another motion is running: end the program that moves it",
    "guiding": "it is being guided by hand: release the buttons at its hand",
    "reflex": _RECOVER,
    "user stopped": "its stop button is pressed: release it",
    "automatic error recovery": "it is recovering from an error: wait a second",
}


class MotionAborted(RobotError):
    """The arm, or the connection to it, ended a motion."""

    def __init__(self, errors: tuple[str, ...], sentence: str) -> None:
        super().__init__(sentence)
        self.errors = errors
        """The vendor's names of what was wrong; none where the connection was lost."""


def need_library(kind: Kind) -> None:
    """Require the vendor's library for an arm and our own extra; a MissingExtraError otherwise."""
    FRANKA.need("A Franka arm", LIBRARIES[kind].module.partition(".")[0], "ruckig")


def check_ready(state: FrankaState, address: str) -> None:
    """Raise a RobotError with the way out if the arm's mode allows no motion."""
    if state.mode != "idle":
        raise RobotError(f"The arm at {address} is in {_mode(state)}; {_WAY_OUT[state.mode]}.")


def _mode(state: FrankaState) -> str:
    after = f" after {', '.join(state.errors)}" if state.errors else ""
    return f'mode "{state.mode}"{after}'


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


def not_connected(address: str, kind: Kind, began: float, error: Exception) -> RobotError:
    """Return the error of an arm that could not be connected to, which was begun at `time.monotonic` `began` [s]."""
    text = _first_line(error)
    if "incompatible" in f"{type(error).__name__} {text}".lower():
        theirs, library = _VERSION.search(text), LIBRARIES[kind]
        return RobotError(
            f"The arm at {address} speaks version {theirs[1] if theirs else 'unknown'} of the Franka Control Interface,"
            f" but the library for kind {kind!r} speaks version {library.version}: choose {library.other}."
        )
    return RobotError(
        f"The arm at {address} accepted the connection but did not continue ({text}; {attempt(kind, began)}): end any"
        " other program that is connected to it, and allow UDP from it through the firewall."
    )


def _first_line(error: Exception) -> str:
    """Return the first line of what a library says, without its name."""
    return str(error).partition("\n")[0].removeprefix("libfranka: ").rstrip(".! ")


class ArmLock:
    """Holds an arm for this process; the system lets go of it when the process ends, however it does.

    A second process would fight over the arm, or be kept waiting. An abstract socket of Linux: unlike a file it is
    nobody's to leave behind, and all users of the machine see it.
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
        """Release the arm for other processes."""
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


class FrankaClient:
    """One connection to an arm by one of the vendor's libraries, for one thread; a context manager.

    The libraries hold the interpreter's lock while they wait, so no other thread of the process runs during a motion.
    """

    _failures: tuple[type[Exception], ...] = (RuntimeError,)
    """Exceptions that the library raises."""

    def __init__(self, address: str, kind: Kind) -> None:
        """Connect; a failure is a RobotError.

        A machine that takes the connection and then says nothing is waited for without end: the libraries know no
        bound. `arm.FrankaArm`, which connects in a process of its own, gives up after half a minute.

        Args:
            address: name or IP address of the arm.
            kind: which arm it is.
        """
        need_library(kind)
        self.kind, self._address = kind, address
        self._library: Any = import_module(LIBRARIES[kind].module)
        self._failures = RuntimeError, getattr(self._library, "FrankaException", RuntimeError)
        self._lock = ArmLock(reachable(address, kind))
        began = time.monotonic()
        try:
            self._robot: Any = self._library.Robot(address, self._library.RealtimeConfig.kIgnore)
        except Exception as error:
            self._lock.release()
            raise not_connected(address, kind, began, error) from None

    def read(self) -> FrankaState:
        """Wait for the next state, while no motion runs."""
        with self._translated_errors("send its state"):
            return franka_state(self._robot.read_once())

    def control(self, on_state: StateCallback) -> None:
        """Run a joint velocity motion, asking `on_state` for a command in each millisecond, until it is finished.

        The library's own rate limiter and low-pass filter are off: what `on_state` answers is what the arm gets. An
        exception of `on_state` stops the arm at once, as hard as it can, and is raised here. Raises MotionAborted if
        the arm ended the motion, and another RobotError if it is in no mode to move.
        """
        check_ready(self.read(), self._address)
        raised: list[BaseException] = []

        def answer(raw: Any, since: Any) -> Any:
            try:
                qd, finished = on_state(franka_state(raw), since.to_sec())
            except BaseException as error:
                raised.append(error)
                raise
            command = self._library.JointVelocities(qd.tolist())
            command.motion_finished = finished
            return command

        try:
            if self.kind == "panda":  # libfranka 0.9 calls back in each millisecond
                mode = self._library.ControllerMode.kJointImpedance
                self._robot.control_joint_velocity(answer, mode, False, _NO_LOW_PASS_HZ)
            else:
                self._move_fr3(answer)
        except self._failures as error:
            if raised:
                raise raised[0] from None
            text = _first_line(error)
            names = error_names(text)
            if names:
                sentence = f"The arm at {self._address} stopped by itself ({', '.join(names)}): {_RECOVER}."
                raise MotionAborted(names, sentence) from None
            raise MotionAborted((), f"The motion of the arm at {self._address} was ended: {text}.") from None
        finally:
            raised.clear()  # the exception holds this frame, and with it the motion

    def _move_fr3(self, answer: Callable[[Any, Any], Any]) -> None:
        """Run a motion through pylibfranka, which is asked for each state and given each command.

        That way libfranka neither limits nor filters what it is given: it does so for callbacks alone.
        """
        motion = self._robot.start_joint_velocity_control(self._library.ControllerMode.JointImpedance)
        finished = False
        try:
            while not finished:
                command = answer(*motion.readOnce())
                finished = command.motion_finished
                motion.writeOnce(command)
        finally:
            # the library stops the arm when it forgets a motion that has not ended; an exception would remember it
            del motion

    def set_collision_behavior(self, behavior: CollisionBehavior) -> None:
        """Tell the arm from which forces on it reports a contact, and from which it stops."""
        with self._translated_errors("accept the collision behaviour"):
            self._robot.set_collision_behavior(*(part.tolist() for part in astuple(behavior)))

    def recover(self) -> None:
        """Leave the mode "reflex", as pressing the button in Desk does; a RobotError if no state says that it has.

        The answer may overtake states.
        """
        with self._translated_errors("recover"):
            self._robot.automatic_error_recovery()
        for _ in range(_STATES_AFTER):
            if (state := self.read()).mode not in ("reflex", "automatic error recovery"):
                return
        raise RobotError(
            f"The arm at {self._address} was told to recover but is still in {_mode(state)}: {_WAY_OUT['reflex']}."
        )

    def close(self) -> None:
        """Close the connection."""
        self._robot = None
        self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @contextmanager
    def _translated_errors(self, what: str) -> Iterator[None]:
        """Translate the library's errors into a RobotError that says what the arm did not do."""
        try:
            yield
        except self._failures as error:
            raise RobotError(f"The arm at {self._address} did not {what}: {_first_line(error)}.") from None
