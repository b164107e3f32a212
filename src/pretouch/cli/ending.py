"""Signals that end a command: raised where it is, so that what is under way can end in order, and noted.

Code that a signal comes by in a callback of a C library may swallow what is raised there; a loop asks `ended` too.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from signal import SIGINT
from types import FrameType

from pretouch.signals import ENDING, handled

_received: list[int] = []


class Terminated(BaseException):
    """SIGTERM, or SIGHUP of a terminal that closed."""


@contextmanager
def ends_raise() -> Iterator[None]:
    """Raise KeyboardInterrupt for Ctrl-C, and `Terminated` for the others, as long as the context lasts."""

    def handle(number: int, _frame: FrameType | None) -> None:
        _received.append(number)
        raise KeyboardInterrupt if number == SIGINT else Terminated

    _received.clear()
    with handled(ENDING, handle):
        yield


def ended() -> bool:
    """Whether a signal has come that ends the command."""
    return bool(_received)


def exit_code() -> int:
    """Exit code after the first signal that came, as shells have it; 0 if none did."""
    return 128 + _received[0] if _received else 0
