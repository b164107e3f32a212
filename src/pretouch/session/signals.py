"""Signals while an arm moves: noted, and raised once it stands."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_STOPPING = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)


@contextmanager
def children_undisturbed() -> Iterator[None]:
    """Let processes that are started meanwhile ignore a terminal that closes, and Ctrl-Z: their parent ends them."""
    before = {int(one): signal.signal(one, signal.SIG_IGN) for one in (signal.SIGHUP, signal.SIGTSTP)}
    try:
        yield  # what is ignored stays so in a program that is started
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def signals_noted() -> Iterator[list[int]]:
    """Only note signals that end the program, until the context ends: the first one comes then, before any other.

    Those of a terminal that would stop the program where it is, as Ctrl-Z, are ignored meanwhile.
    """
    came: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        came.append(number)

    # nohup has SIGHUP ignored, and wants it so
    before = {int(one): signal.signal(one, note) for one in _ENDING if signal.getsignal(one) is not signal.SIG_IGN}
    before |= {int(one): signal.signal(one, signal.SIG_IGN) for one in _STOPPING}
    try:
        yield came
    finally:
        try:
            for number in came[:1]:
                signal.signal(number, before[number])
                signal.raise_signal(number)
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
