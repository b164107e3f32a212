"""Errors of an arm: one sentence each, with the way out."""

import re
from typing import NoReturn

from pretouch.arms.franka.client import LIBRARIES, Kind, attempt
from pretouch.arms.franka.state import FrankaState, error_names
from pretouch.errors import RobotError

_RECOVER = "free it from what it touches, then let it recover"
_WAY_OUT = {
    "other": "it is not ready: open the brakes and activate FCI in Desk",
    "move": "another motion is running: end the program that moves it",
    "guiding": "it is being guided by hand: release the buttons at its hand",
    "reflex": _RECOVER,
    "user stopped": "its stop button is pressed: release it",
    "automatic error recovery": "it is recovering from an error: wait a second",
}

_OTHER = {"panda": "fr3 for an FR3", "fr3": "panda for a Panda, or update an FR3 to system 5.9 or later"}
_VERSION = re.compile(r"(?:server|protocol) version:? (\d+)")
"""Where both libraries say what the arm speaks."""


class MotionAborted(RobotError):
    """The arm, or the connection to it, ended a motion."""

    def __init__(self, errors: tuple[str, ...], sentence: str) -> None:
        super().__init__(sentence)
        self.errors = errors
        """The vendor's names of what was wrong; none where the connection was lost."""


def check_ready(state: FrankaState, address: str) -> None:
    """Raise a RobotError with the way out if the arm is in no mode to begin a motion."""
    if state.mode == "idle":
        return
    raise RobotError(f"The arm at {address} is in {_mode(state)}; {_WAY_OUT[state.mode]}.")


def raise_not_recovered(state: FrankaState, address: str) -> NoReturn:
    """Raise a RobotError for an arm that took the order to recover and still is in a mode that says otherwise."""
    raise RobotError(f"The arm at {address} was told to recover but is still in {_mode(state)}: {_WAY_OUT['reflex']}.")


def raise_not_connected(address: str, kind: Kind, began: float, error: Exception) -> NoReturn:
    """Raise a RobotError for an arm that could not be connected to, which was begun at `time.monotonic` `began` [s]."""
    text = first_line(error)
    if "incompatible" in f"{type(error).__name__} {text}".lower():
        theirs = _VERSION.search(text)
        raise RobotError(
            f"The arm at {address} speaks version {theirs[1] if theirs else 'unknown'} of the Franka Control Interface,"
            f" but the library for kind {kind!r} speaks version {LIBRARIES[kind].version}: choose {_OTHER[kind]}."
        ) from None
    raise RobotError(
        f"The arm at {address} accepted the connection but did not continue ({text}; {attempt(kind, began)}): end any"
        " other program that is connected to it, and allow UDP from it through the firewall."
    ) from None


def raise_aborted(address: str, error: Exception) -> NoReturn:
    """Raise MotionAborted for what ended a motion."""
    text = first_line(error)
    names = error_names(text)
    if names:
        sentence = f"The arm at {address} stopped by itself ({', '.join(names)}): {_RECOVER}."
        raise MotionAborted(names, sentence) from None
    raise MotionAborted((), f"The motion of the arm at {address} was ended: {text}.") from None


def raise_refused(address: str, what: str, error: Exception) -> NoReturn:
    """Raise a RobotError for something that the arm was asked and did not do."""
    raise RobotError(f"The arm at {address} did not {what}: {first_line(error)}.") from None


def first_line(error: Exception) -> str:
    """Return the first line of what a library says, without its name."""
    return str(error).partition("\n")[0].removeprefix("libfranka: ").rstrip(".! ")


def _mode(state: FrankaState) -> str:
    after = f" after {', '.join(state.errors)}" if state.errors else ""
    return f'mode "{state.mode}"{after}'
