"""The sliding window of the external force: eq. 8, its mean and standard deviation by running sums, in O(1)."""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.params import WindowParams
from pretouch.records import IntCell
from pretouch.types import FloatArray

_NEWEST, _ORIGIN, _TOTAL, _SQUARES = range(4)


class Window(NamedTuple):
    """A ring of the last N force samples and their running sums. All forces in N, per axis."""

    ring: Annotated[FloatArray, "N", 3]
    """(N, 3), oldest at `next` once full."""
    next: IntCell
    """Where the next value goes."""
    samples: IntCell
    """Values held so far, at most N."""
    sums: Annotated[FloatArray, 4, 3]
    """(4, 3) the value added last, the origin o the sums are taken about, so that a large mean costs no digits, the sum
    of (value - o), and that of its square."""

    @property
    def full(self) -> bool:
        """Whether the window holds N values, so that its statistics mean something."""
        return bool(self.samples[0] == len(self.ring))

    @property
    def newest(self) -> FloatArray:
        """The value added last (3,), zero of an empty window."""
        return self.sums[_NEWEST]

    def mean(self) -> FloatArray:
        """Mean mu (3,), zero of an empty window."""
        return window_mean(self.sums, int(self.samples[0]))

    def std(self) -> FloatArray:
        """Sample standard deviation sigma (3,), zero of fewer than two values."""
        return window_std(self.sums, int(self.samples[0]))


def window_init(samples: int) -> Window:
    """Return an empty window for N samples."""
    return Window(np.zeros((samples, 3)), np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros((4, 3)))


@compiled
def window_mean(sums: FloatArray, count: int) -> FloatArray:
    """Mean (3,) of a window with these sums (4, 3) and so many values; see `Window`."""
    mean = np.empty(3)
    for i in range(3):
        mean[i] = sums[_ORIGIN, i] + sums[_TOTAL, i] / max(count, 1)
    return mean


@compiled
def window_std(sums: FloatArray, count: int) -> FloatArray:
    """Sample standard deviation (3,) of a window with these sums (4, 3) and so many values; see `Window`."""
    std = np.zeros(3)
    if count > 1:
        for i in range(3):
            # (S2 - S1^2 / N) / (N - 1), which rounding may take below 0
            std[i] = np.sqrt(max(0.0, (sums[_SQUARES, i] - sums[_TOTAL, i] ** 2 / count) / (count - 1)))
    return std


@kernel
def weighted_value(
    reading: FloatArray, last: FloatArray, mean: FloatArray, std: FloatArray, p: WindowParams
) -> FloatArray:
    """Value x_t that enters the window, eq. 8 of the paper: an outlier counts with weight alpha. Per axis [N].

    With x the reading: alpha x + (1 - alpha) x_{t-1} if |x - mu_{t-1}| > lambda sigma_{t-1}, else x. With sigma = 0
    every change is an outlier.
    """
    value = reading.copy()
    for i in range(len(value)):
        if abs(reading[i] - mean[i]) > p.lambda_ * std[i]:
            value[i] = p.alpha * reading[i] + (1 - p.alpha) * last[i]  # x_{t-1} as it entered, not as it was read
    return value


def add_force(window: Window, reading: FloatArray | None, p: WindowParams) -> Window:
    """Add a force reading (3,) [N]: as it is until the window is full, through eq. 8 from then on; None: nothing."""
    if reading is None:
        return window
    after = Window._make(part.copy() for part in window)
    add_sample(after, reading, p.numbers)
    return after


@compiled
def add_sample(window: Window, reading: FloatArray, p: WindowParams) -> None:
    """Do what `add_force` says to the window itself."""
    ring, sums, at, count = window.ring, window.sums, window.next[0], window.samples[0]
    # Once a turn the sums are taken afresh, so that rounding errors never add up: O(1) on average. That is before the
    # next value and not after the last one, for what a step says of its window is of the running sums.
    if count == 1 or (count > 0 and at == 0):
        for i in range(3):
            sums[_ORIGIN, i], sums[_TOTAL, i], sums[_SQUARES, i] = sums[_NEWEST, i], 0.0, 0.0
            for k in range(count):
                off = ring[k, i] - sums[_ORIGIN, i]
                sums[_TOTAL, i] += off
                sums[_SQUARES, i] += off**2
    x, full = reading, count == len(ring)
    # not before: the sigma of few values is near 0, and eq. 8 would take most readings for outliers
    if full:
        x = weighted_value(reading, sums[_NEWEST], window_mean(sums, count), window_std(sums, count), p)
    for i in range(3):
        gone, ring[at, i], sums[_NEWEST, i] = ring[at, i], x[i], x[i]
        new, old = x[i] - sums[_ORIGIN, i], gone - sums[_ORIGIN, i] if full else 0.0
        sums[_TOTAL, i] += new - old
        sums[_SQUARES, i] += new**2 - old**2
    window.next[0], window.samples[0] = (at + 1) % len(ring), min(count + 1, len(ring))
