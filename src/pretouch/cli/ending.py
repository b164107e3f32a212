"""Signals that end a command: raised where it is, so that what is under way can end in order, and noted.

Code that a signal comes by in a callback of a C library may swallow what is raised there; a loop asks `ended` too.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_received: list[int] = []


class Terminated(BaseException):
    """SIGTERM, or SIGHUP of a terminal that closed."""


@contextmanager
def ends_raise() -> Iterator[None]:
    """Raise KeyboardInterrupt for Ctrl-C, and `Terminated` for the others, as long as the context lasts."""

    def handle(number: int, _frame: FrameType | None) -> None:
        _received.append(number)
        raise KeyboardInterrupt if number == signal.SIGINT else Terminated

    _received.clear()
    # nohup has SIGHUP ignored, and wants it so
    ours = [number for number in _SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, handle) for number in ours}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def ended() -> bool:
    """Whether a signal has come that ends the command."""
    return bool(_received)


def exit_code() -> int:
    """Exit code after the first signal that came, as shells have it; 0 if none did."""
    return 128 + _received[0] if _received else 0
