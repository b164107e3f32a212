"""Signals: noted while an arm moves, raised so that a program ends in order, and left to the parent of a process."""

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from multiprocessing import resource_tracker
from signal import SIGINT
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_STOPPING = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
OF_TERMINAL = frozenset({signal.SIGINT, signal.SIGHUP, *_STOPPING})
"""Signals that a terminal sends to all processes in it."""

Handler = Callable[[int, FrameType | None], object] | signal.Handlers


@contextmanager
def handled(numbers: Iterable[int], handler: Handler) -> Iterator[dict[int, object]]:
    """Handle signals by a handler until the context ends; ignored ones stay ignored, as SIGHUP under nohup.

    Yields the handlers from before. Signals reach the main thread alone: in another thread nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield {}
        return
    ours = [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, handler) for number in ours}
    try:
        yield dict(before)
    finally:
        for number, former in before.items():
            signal.signal(number, former)


@contextmanager
def noted(*numbers: int) -> Iterator[list[int]]:
    """Only note signals, by default all `ENDING` ones, until the context ends; the first one is raised then."""
    came: list[int] = []
    with handled(numbers or ENDING, lambda number, _frame: came.append(number)) as before:
        try:
            yield came
        finally:
            for number in came[:1]:
                signal.signal(number, before[number])  # type: ignore[arg-type]
                signal.raise_signal(number)


@contextmanager
def noted_in_motion() -> Iterator[list[int]]:
    """Only note `ENDING` signals, and ignore those by which a terminal suspends the program: Ctrl-Z."""
    with handled(_STOPPING, signal.SIG_IGN), noted() as came:
        yield came


def ended_in_order() -> AbstractContextManager[object]:
    """Turn SIGTERM and SIGHUP into SystemExit where they would end the process at once."""

    def end(number: int, _frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    at_once = [one for one in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(one) is signal.SIG_DFL]
    return handled(at_once, end)


@contextmanager
def kept_from_children() -> Iterator[None]:
    """Keep a terminal's signals, such as Ctrl-C, from a process started in this context, from its first instruction on.

    The process calls `leave_to_parent` as soon as it can, and its parent ends it.
    """
    with handled((signal.SIGHUP, signal.SIGTSTP), signal.SIG_IGN):  # stays so in what outlives a terminal
        resource_tracker.ensure_running()  # begun with the first process, it would unblock Ctrl-C
    before = signal.pthread_sigmask(signal.SIG_BLOCK, OF_TERMINAL)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def leave_to_parent() -> None:
    """Ignore `OF_TERMINAL` in this process, which was started with them blocked."""
    for number in OF_TERMINAL:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, OF_TERMINAL)


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
    """Return whether a signal has come that ends the command."""
    return bool(_received)


def exit_code() -> int:
    """Exit code after the first signal that came, as shells have it; 0 if none did."""
    return 128 + _received[0] if _received else 0
