"""How well a page keeps up: simulated against real time, and when to say that it does not."""

from collections import deque

WINDOW_S = 1.0
"""Time over which rates are taken [s]."""
SLOW_BELOW, WELL_ABOVE = 0.9, 0.97
"""Share of the wanted speed below which the machine is too slow, and from which on it is no longer."""
PATIENCE_S = 2.0
"""Time either has to last before it is said [s]."""


class Pace:
    """Rates of the last second, of calls of `tick`."""

    def __init__(self) -> None:
        self._ticks: deque[tuple[float, float, float]] = deque()
        self._speed = 0.0
        self._slow_share = 1.0
        self._other_since: float | None = None
        self.slow = False
        """Whether the machine has been too slow for a while."""

    def tick(self, now: float, advanced: float, speed: float) -> None:
        """Count a tick at a time [s] before which the simulation advanced [s]; from now on it should at a speed.

        With speed 0, time stands still and nothing is judged.
        """
        if speed == 0.0:
            self._ticks.clear()
            self._speed, self._other_since, self.slow = 0.0, None, False
            return
        before, total, wanted = self._ticks[-1] if self._ticks else (now, 0.0, 0.0)
        wanted += self._speed * (now - before)
        self._speed = speed
        self._ticks.append((now, total + advanced, wanted))
        while len(self._ticks) > 2 and now - self._ticks[1][0] >= WINDOW_S:
            self._ticks.popleft()
        self._judge(now)

    def _judge(self, now: float) -> None:
        share = self.share
        if share is not None and share < WELL_ABOVE:
            self._slow_share = share
        other = share is not None and (share >= WELL_ABOVE if self.slow else share < SLOW_BELOW)
        if not other:
            self._other_since = None
        elif self._other_since is None:
            self._other_since = now
        elif now - self._other_since >= PATIENCE_S:
            self.slow, self._other_since = not self.slow, None

    def _over(self, column: int) -> tuple[float, float]:
        """What came together over the window, and the time of it [s]."""
        if len(self._ticks) < 2:
            return 0.0, 0.0
        first, last = self._ticks[0], self._ticks[-1]
        return last[column] - first[column], last[0] - first[0]

    @property
    def factor(self) -> float:
        """Simulated over real time."""
        advanced, time = self._over(1)
        return advanced / time if time > 0 else 0.0

    @property
    def share(self) -> float | None:
        """Simulated time over what it should be; None where no time should pass."""
        advanced, wanted = self._over(1)[0], self._over(2)[0]
        return advanced / wanted if wanted > 0 else None

    @property
    def updates(self) -> float:
        """Ticks a second."""
        time = self._over(1)[1]
        return (len(self._ticks) - 1) / time if time > 0 else 0.0

    def sentence(self) -> str:
        """Say that the machine is too slow, or nothing."""
        if not self.slow:
            return ""
        return (
            f"This machine is too slow for real time: the clock runs at {100 * self._slow_share:.0f} % of the chosen"
            " speed, with the same physics."
        )
