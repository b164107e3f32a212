"""What a simulated arm truly did, read while it is written: speeds beside their limits, and when it came to rest."""

from pathlib import Path

import numpy as np

_KEPT = 6000
"""Milliseconds of which positions are kept."""
_SPAN = 20
"""Milliseconds over which a speed is taken."""
_RESTS_RAD_S = 0.01
"""Largest joint speed of an arm at rest: it still swings."""


class Truth:
    """Follows the file of `serve-fci --truth`."""

    def __init__(self, place: Path, qd_max: np.ndarray) -> None:
        self._file, self._part, self._qd_max = place.open(), "", qd_max
        self._t, self._q = np.empty(0), np.empty((0, 7))
        self.largest = 0.0
        """Largest joint speed so far, as a share of its limit."""

    def read(self) -> None:
        """Take in what has been written."""
        lines = (self._part + self._file.read()).split("\n")
        self._part = lines.pop()
        rows = np.array([line.split(",") for line in lines if not line.startswith("time")], dtype=np.float64)
        if not len(rows):
            return
        t, q = np.append(self._t[-_SPAN:], rows[:, 0]), np.vstack([self._q[-_SPAN:], rows[:, 4:]])
        self.largest = max(self.largest, float((_speeds(t, q) / self._qd_max).max(initial=0.0)))
        self._t, self._q = np.append(self._t, rows[:, 0])[-_KEPT:], np.vstack([self._q, rows[:, 4:]])[-_KEPT:]

    @property
    def now(self) -> float:
        """The newest time that was written [s]: up to a tenth of a second ago."""
        return float(self._t[-1]) if len(self._t) else -np.inf

    @property
    def moves(self) -> bool:
        """Whether the arm has just moved."""
        return bool((_speeds(self._t[-200:], self._q[-200:]) > 5 * _RESTS_RAD_S).any())

    def rested_after(self, instant: float) -> float:
        """Time from an instant until the arm stayed at rest [s]; infinite if it does not."""
        later = self._t >= instant
        t, fast = self._t[later], (_speeds(self._t[later], self._q[later]) > _RESTS_RAD_S).any(axis=1)
        if len(fast) == 0 or fast[-1]:
            return np.inf
        return float(t[np.flatnonzero(fast)[-1]] - instant) if fast.any() else 0.0

    def close(self) -> None:
        self._file.close()


def _speeds(t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(T - SPAN, 7) joint speeds [rad/s]."""
    if len(t) <= _SPAN:
        return np.empty((0, 7))
    return np.abs(q[_SPAN:] - q[:-_SPAN]) / (t[_SPAN:] - t[:-_SPAN])[:, None]
