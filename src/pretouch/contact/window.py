"""The sliding window of the external force: eq. 8, its mean and standard deviation by running sums, in O(1)."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.types import FloatArray
from pretouch.values import value

_NEWEST, _ORIGIN, _TOTAL, _SQUARES = range(4)


@value
class WindowState:
    """A ring of the last N force samples and their running sums. All forces in N, per axis."""

    ring: FloatArray
    """(N, 3) values, oldest at `next` once full."""
    next: int
    """Where the next value goes."""
    count: int
    """Values held so far, at most N."""
    sums: FloatArray
    """(4, 3) the value added last, the origin o the sums are taken about, so that a large mean costs no digits, the sum
    of (value - o), and that of its square."""

    @property
    def full(self) -> bool:
        """Whether the window holds N values, so that its statistics mean something."""
        return self.count == len(self.ring)

    @property
    def newest(self) -> FloatArray:
        """The value added last (3,), zero of an empty window."""
        return self.sums[_NEWEST]

    def mean(self) -> FloatArray:
        """Mean mu (3,), zero of an empty window."""
        return window_mean(self.sums, self.count)

    def std(self) -> FloatArray:
        """Sample standard deviation sigma (3,), zero of fewer than two values."""
        return window_std(self.sums, self.count)


def window_init(samples: int) -> WindowState:
    """Return an empty window for N samples."""
    return WindowState(np.zeros((samples, 3)), 0, 0, np.zeros((4, 3)))


@compiled
def window_mean(sums: FloatArray, count: int) -> FloatArray:
    """Mean (3,) of a window with these sums (4, 3) and so many values; see `WindowState`."""
    mean = np.empty(3)
    for i in range(3):
        mean[i] = sums[_ORIGIN, i] + sums[_TOTAL, i] / max(count, 1)
    return mean


@compiled
def window_std(sums: FloatArray, count: int) -> FloatArray:
    """Sample standard deviation (3,) of a window with these sums (4, 3) and so many values; see `WindowState`."""
    std = np.zeros(3)
    if count > 1:
        for i in range(3):
            std[i] = np.sqrt(max(0.0, (sums[_SQUARES, i] - sums[_TOTAL, i] ** 2 / count) / (count - 1)))
    return std


@compiled
def weighted_value(
    reading: FloatArray, last: FloatArray, mean: FloatArray, std: FloatArray, alpha: float, lambda_: float
) -> FloatArray:
    """Value x_t that enters the window, eq. 8 of the paper: an outlier counts with weight alpha. Per axis [N].

    With x the reading: alpha x + (1 - alpha) x_{t-1} if |x - mu_{t-1}| > lambda sigma_{t-1}, else x. With sigma = 0
    every change is an outlier.
    """
    value = reading.copy()
    for i in range(len(value)):
        if abs(reading[i] - mean[i]) > lambda_ * std[i]:
            value[i] = alpha * reading[i] + (1 - alpha) * last[i]
    return value


def add(state: WindowState, reading: FloatArray, alpha: float, lambda_: float) -> WindowState:
    """Add a force reading (3,) [N]: as it is until the window is full, through eq. 8 from then on."""
    ring, sums = state.ring.copy(), state.sums.copy()
    add_to(ring, sums, state.next, state.count, reading, alpha, lambda_)
    return added(state, ring, sums)


def added(state: WindowState, ring: FloatArray, sums: FloatArray) -> WindowState:
    """Return the state after one more value, with a ring and sums that hold it."""
    size = len(ring)
    return WindowState(ring, (state.next + 1) % size, min(state.count + 1, size), sums)


@compiled
def add_to(
    ring: FloatArray, sums: FloatArray, at: int, count: int, reading: FloatArray, alpha: float, lambda_: float
) -> None:
    """Change ring (N, 3) and sums (4, 3) as `add` says."""
    size, x = len(ring), reading
    full = count == size
    if full:
        x = weighted_value(reading, sums[_NEWEST], window_mean(sums, count), window_std(sums, count), alpha, lambda_)
    afresh = at == size - 1 or count == 0
    for i in range(3):
        gone, ring[at, i], sums[_NEWEST, i] = ring[at, i], x[i], x[i]
        if afresh:
            # once a turn the sums are taken anew, so rounding errors never add up; O(1) on average
            sums[_ORIGIN, i], sums[_TOTAL, i], sums[_SQUARES, i] = x[i], 0.0, 0.0
            for m in range(min(count + 1, size)):
                sums[_TOTAL, i] += ring[m, i] - x[i]
                sums[_SQUARES, i] += (ring[m, i] - x[i]) ** 2
        else:
            new, old = x[i] - sums[_ORIGIN, i], gone - sums[_ORIGIN, i] if full else 0.0
            sums[_TOTAL, i] += new - old
            sums[_SQUARES, i] += new**2 - old**2
