"""A queue for the actions of people on a page, which the loop runs between two ticks."""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

Action = Callable[[], object]


@dataclass(frozen=True)
class QueuedAction:
    """An action that waits; calling it runs it."""

    action: Action
    settle: float
    """How long it waits for a newer one of its kind [s]."""
    quiet: bool
    """Whether it leaves the notice on the page."""
    due: float | None = None
    """When it is to be done, in the time of the loop [s]; None before the loop has seen it."""

    def __call__(self) -> None:
        """Do it."""
        self.action()


class ActionQueue:
    """Actions in the order they were asked for, from any thread. What is done again and again keeps only the newest."""

    def __init__(self, admits: Callable[[int], bool] = lambda visitor: True) -> None:
        self.admits = admits
        """Whether a visitor may act."""
        self._lock = threading.Lock()
        self._waiting: dict[object, QueuedAction] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, action: Action, kind: str = "", settle: float = 0.0, quiet: bool = False) -> None:
        """Ask for an action; it takes the place of one of the same kind that still waits, unless that is ''.

        Args:
            action: to be done.
            kind: of the action, or ''.
            settle: how long it waits for a newer one of its kind, as somebody types a number key by key [s].
            quiet: whether it leaves the notice on the page.
        """
        with self._lock:
            key: object = kind or object()
            self._waiting.pop(key, None)
            self._waiting[key] = QueuedAction(action, settle, quiet)

    def is_waiting(self, kind: str) -> bool:
        """Whether an action of a kind is still to be done."""
        with self._lock:
            return kind in self._waiting

    def take(self, now: float = math.inf) -> list[QueuedAction]:
        """Return what is due at a time of the loop [s], in order; without one, all.

        An action that has to settle is also due if a person asked for something else afterwards.
        """
        with self._lock:
            seen = {
                key: replace(asked, due=now + asked.settle) if asked.due is None else asked
                for key, asked in self._waiting.items()
            }
            others = [i for i, asked in enumerate(seen.values()) if not (asked.settle or asked.quiet)]
            last = others[-1] if others else -1
            due = {
                key: asked for i, (key, asked) in enumerate(seen.items())
                if i < last or (asked.due is not None and asked.due <= now)
            }  # fmt: skip
            self._waiting = {key: asked for key, asked in seen.items() if key not in due}
        return list(due.values())
