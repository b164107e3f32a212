"""How well a page keeps up: simulated against real time, and when to say that it does not."""

WINDOW_S = 1.0
"""Time over which rates are taken [s]."""
SLOW_BELOW, WELL_ABOVE = 0.9, 0.97
"""Share of the wanted speed below which the machine is too slow, and from which on it is no longer."""
PATIENCE = 2
"""Windows for which either has to last before it is said."""


class Pace:
    """Rates of the last window that is over, of calls of `tick`."""

    def __init__(self) -> None:
        self.slow = False
        """Whether the machine has been too slow for a while."""
        self.factor = 0.0
        """Simulated over real time."""
        self.updates = 0.0
        """Ticks a second."""
        self._share, self._windows = 1.0, 0
        self._begin: float | None = None
        self._before = self._simulated = self._wanted = 0.0
        self._ticks = 0

    def tick(self, now: float, advanced: float, speed: float) -> None:
        """Count a tick at a time [s] before which the simulation advanced [s], as it should at a speed.

        With speed 0, time stands still, and all is forgotten.
        """
        if speed == 0.0:
            Pace.__init__(self)
        elif self._begin is None:
            self._begin = self._before = now
        else:
            self._ticks, self._simulated = self._ticks + 1, self._simulated + advanced
            self._wanted, self._before = self._wanted + speed * (now - self._before), now
            if now >= self._begin + WINDOW_S:
                self._judge(now - self._begin)
                self._begin, self._ticks, self._simulated, self._wanted = now, 0, 0.0, 0.0

    def _judge(self, took: float) -> None:
        self.factor, self.updates, share = self._simulated / took, self._ticks / took, self._simulated / self._wanted
        if share < WELL_ABOVE:
            self._share = share
        other = share >= WELL_ABOVE if self.slow else share < SLOW_BELOW
        self._windows = self._windows + 1 if other else 0
        if self._windows == PATIENCE:
            self.slow, self._windows = not self.slow, 0

    def sentence(self) -> str:
        """Say that the machine is too slow, or nothing."""
        if not self.slow:
            return ""
        return (
            f"This machine is too slow for real time: the clock runs at {100 * self._share:.0f} % of the chosen speed,"
            " with the same physics."
        )
