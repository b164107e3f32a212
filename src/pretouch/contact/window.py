"""The sliding window of the external force: eq. 8, its mean and standard deviation by running sums, in O(1)."""

from dataclasses import dataclass

import numpy as np

from pretouch.types import FloatArray


@dataclass(frozen=True, slots=True)
class WindowState:
    """A ring of the last N force samples and their running sums. All forces in N, per axis."""

    ring: FloatArray
    """(N, 3) values, oldest at `next` once full."""
    next: int
    """Where the next value goes."""
    count: int
    """Values held so far, at most N."""
    newest: FloatArray
    """(3,) the value added last."""
    origin: FloatArray
    """(3,) value the sums are taken about, so that a large mean costs no digits."""
    total: FloatArray
    """(3,) sum of (value - origin)."""
    squares: FloatArray
    """(3,) sum of (value - origin)^2."""

    @property
    def full(self) -> bool:
        """Whether the window holds N values, so that its statistics mean something."""
        return self.count == len(self.ring)

    def mean(self) -> FloatArray:
        """Mean mu (3,), zero of an empty window."""
        return self.origin + self.total / self.count if self.count else np.zeros(3)

    def std(self) -> FloatArray:
        """Sample standard deviation sigma (3,), zero of fewer than two values."""
        if self.count < 2:
            return np.zeros(3)
        variance = (self.squares - self.total**2 / self.count) / (self.count - 1)
        return np.sqrt(np.maximum(variance, 0.0))


def window_init(samples: int) -> WindowState:
    """Return an empty window for N samples."""
    zero = np.zeros(3)
    return WindowState(np.zeros((samples, 3)), 0, 0, zero, zero, zero, zero)


def weighted_value(
    reading: FloatArray, last: FloatArray, mean: FloatArray, std: FloatArray, alpha: float, lambda_: float
) -> FloatArray:
    """Value x_t that enters the window, eq. 8 of the paper: an outlier counts with weight alpha. Per axis [N].

    With x the reading: alpha x + (1 - alpha) x_{t-1} if |x - mu_{t-1}| > lambda sigma_{t-1}, else x. With sigma = 0
    every change is an outlier.
    """
    outlier = np.abs(reading - mean) > lambda_ * std
    return np.where(outlier, alpha * reading + (1 - alpha) * last, reading)


def add(state: WindowState, reading: FloatArray, alpha: float, lambda_: float) -> WindowState:
    """Add a force reading (3,) [N]: as it is until the window is full, through eq. 8 from then on."""
    x = weighted_value(reading, state.newest, state.mean(), state.std(), alpha, lambda_) if state.full else reading
    ring = state.ring.copy()
    gone = state.ring[state.next] if state.full else None
    ring[state.next] = x
    following = (state.next + 1) % len(ring)
    count = min(state.count + 1, len(ring))
    if following == 0 or state.count == 0:
        # once a turn the sums are taken afresh, so rounding errors never add up; O(1) on average
        origin = x.copy()
        values = ring[:count] - origin
        return WindowState(ring, following, count, x, origin, values.sum(axis=0), (values**2).sum(axis=0))
    new, old = x - state.origin, np.zeros(3) if gone is None else gone - state.origin
    total, squares = state.total + new, state.squares + new**2
    if gone is not None:
        total, squares = total - old, squares - old**2
    return WindowState(ring, following, count, x, state.origin, total, squares)
