"""Messages that were sent and not received yet."""

import heapq
from collections.abc import Iterator
from itertools import count
from typing import Generic, TypeVar

ROUNDING_S = 1e-9
"""The plant's time is a sum of steps: what is due at an instant is taken this much early [s]."""

Sent = TypeVar("Sent")


class UnderWay(Generic[Sent]):
    """Messages on their way, each with an arrival of its own: one may overtake another."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Sent]] = []
        # of two that arrive at once the one sent first; messages themselves need no order
        self._number = count()

    def send(self, arrival: float, sent: Sent) -> None:
        """Let something arrive at an instant [s]."""
        heapq.heappush(self._heap, (arrival, next(self._number), sent))

    def arrived(self, time: float) -> Iterator[Sent]:
        """Take what has arrived by an instant [s], in the order of arrival."""
        while self._heap and self._heap[0][0] <= time:
            yield heapq.heappop(self._heap)[2]
