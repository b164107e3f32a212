"""The terminal while the arm moves: printing without delaying the loop, the Enter key, and questions."""

import os
import select
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from typing import Self

from pretouch.errors import RobotError

_CLOSE_S = 1.0
"""How long a terminal that takes nothing is waited for at the end [s]."""


class BackgroundPrinter:
    """Prints sentences from a thread of its own: a stopped terminal must not stop an arm's loop."""

    def __init__(self, say: Callable[[str], None]) -> None:
        """Take the function that prints one sentence and may block."""
        self._say = say
        self._sentences: SimpleQueue[str | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._tell, daemon=True)

    def __call__(self, sentence: str) -> None:
        """Queue a sentence."""
        self._sentences.put(sentence)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Wait a moment until all sentences are printed; a second call does nothing."""
        self._sentences.put(None)
        self._thread.join(_CLOSE_S)

    def _tell(self) -> None:
        while (sentence := self._sentences.get()) is not None:
            with suppress(OSError, ValueError):  # the terminal is gone, or closed
                self._say(sentence)


class EnterKey:
    """True if Enter was pressed since the previous call; never without a terminal."""

    def __init__(self, descriptor: int | None = None) -> None:
        """Take the file descriptor to listen at; by default that of the standard input."""
        self._descriptor = _standard_input() if descriptor is None else descriptor
        self.possible = self._descriptor is not None and os.isatty(self._descriptor)
        """True if there is a terminal."""

    def __call__(self) -> bool:
        """Return it without waiting."""
        if not self.possible or self._descriptor is None:
            return False
        try:
            if not select.select([self._descriptor], [], [], 0)[0]:
                return False
            typed = os.read(self._descriptor, 4096)
        except OSError:  # the terminal is gone, or another program has it
            return False
        self.possible = bool(typed)
        return b"\n" in typed


def _standard_input() -> int | None:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # none, or one of a test's
        return None


def say(sentence: str) -> None:
    """Print a sentence at once."""
    print(sentence, flush=True)


def require_yes(question: str, otherwise: str) -> None:
    """Ask a person for yes; a RobotError with `otherwise` if nobody says it."""
    if not sys.stdin.isatty():
        raise RobotError("There is no terminal to ask for permission to move the arm: give --yes.")
    answer = ""
    with suppress(EOFError):  # Ctrl-D is no answer
        answer = input(f"{question} [y/N] ")
    if answer.strip().lower() not in ("y", "yes"):
        raise RobotError(f"{otherwise}: answer y to allow it.")
