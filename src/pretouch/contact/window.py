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
    """Index of the next value."""
    samples: IntCell
    """Number of values, at most N."""
    sums: Annotated[FloatArray, 4, 3]
    """(4, 3) last value; origin o of the sums, so that a large mean costs no digits; sum of (value - o); sum of its
    square."""

    @property
    def full(self) -> bool:
        """True if the window has N values, so that its statistics are meaningful."""
        return bool(self.samples[0] == len(self.ring))

    @property
    def newest(self) -> FloatArray:
        """Last value (3,), zero for an empty window."""
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
    """Return the mean (3,) of a window with these sums (4, 3) and a number of values; see `Window`."""
    mean = np.empty(3)
    for i in range(3):
        mean[i] = sums[_ORIGIN, i] + sums[_TOTAL, i] / max(count, 1)
    return mean


@compiled
def window_std(sums: FloatArray, count: int) -> FloatArray:
    """Return the sample standard deviation (3,) of a window with these sums (4, 3) and a number of values."""
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
    """Return the value x_t that enters the window, eq. 8 of the paper: an outlier has the weight alpha. Per axis [N].

    With x the reading: alpha x + (1 - alpha) x_{t-1} if |x - mu_{t-1}| > lambda sigma_{t-1}, else x. With sigma = 0
    every change is an outlier.
    """
    value = reading.copy()
    for i in range(len(value)):
        if abs(reading[i] - mean[i]) > p.lambda_ * std[i]:
            # x_{t-1} as it entered the window, not the reading
            value[i] = p.alpha * reading[i] + (1 - p.alpha) * last[i]
    return value


def add_force(window: Window, reading: FloatArray | None, p: WindowParams) -> Window:
    """Add a force reading (3,) [N]: unchanged until the window is full, then through eq. 8; None adds nothing."""
    if reading is None:
        return window
    after = Window._make(part.copy() for part in window)
    add_sample(after, reading, p.numbers)
    return after


@compiled
def add_sample(window: Window, reading: FloatArray, p: WindowParams) -> None:
    """Add a reading as `add_force` does, to the window itself."""
    ring, sums, at, count = window.ring, window.sums, window.next[0], window.samples[0]
    # Once a turn the sums are computed anew, so that rounding errors do not accumulate: O(1) on average. That is before
    # the next value, not after the last one, because a step reports the running sums.
    if count == 1 or (count > 0 and at == 0):
        for i in range(3):
            sums[_ORIGIN, i], sums[_TOTAL, i], sums[_SQUARES, i] = sums[_NEWEST, i], 0.0, 0.0
            for k in range(count):
                off = ring[k, i] - sums[_ORIGIN, i]
                sums[_TOTAL, i] += off
                sums[_SQUARES, i] += off**2
    x, full = reading, count == len(ring)
    # not before: the sigma of few values is near 0, and for eq. 8 most readings would be outliers
    if full:
        x = weighted_value(reading, sums[_NEWEST], window_mean(sums, count), window_std(sums, count), p)
    for i in range(3):
        oldest, ring[at, i], sums[_NEWEST, i] = ring[at, i], x[i], x[i]
        new, old = x[i] - sums[_ORIGIN, i], oldest - sums[_ORIGIN, i] if full else 0.0
        sums[_TOTAL, i] += new - old
        sums[_SQUARES, i] += new**2 - old**2
    window.next[0], window.samples[0] = (at + 1) % len(ring), min(count + 1, len(ring))
