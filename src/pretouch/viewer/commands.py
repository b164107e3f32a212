"""What people ask for in the page, kept until the loop has time for it between two ticks."""

import threading
from collections.abc import Callable

Action = Callable[[], object]


class Commands:
    """Actions in the order they were asked for, from any thread. What is done again and again keeps only the newest."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: dict[object, Action] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, action: Action, kind: str = "") -> None:
        """Ask for an action; it takes the place of one of the same kind that still waits, unless that is ''."""
        with self._lock:
            key: object = kind or object()
            self._waiting.pop(key, None)
            self._waiting[key] = action

    def take(self) -> list[Action]:
        """Return what was asked for since the last time, in order."""
        with self._lock:
            waiting, self._waiting = list(self._waiting.values()), {}
        return waiting
