"""The sliding window of the external force: eq. 8, its mean and standard deviation by running sums, in O(1)."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.params import WindowParams
from pretouch.types import FloatArray
from pretouch.values import value

_NEWEST, _ORIGIN, _TOTAL, _SQUARES = range(4)

_CHUNK = 64
"""Values that are copied for one more: a window at 1 kHz holds a thousand."""


@value
class WindowState:
    """A ring of the last N force samples and their running sums. All forces in N, per axis."""

    chunks: tuple[FloatArray, ...]
    """(up to 64, 3) each, together the N values of the ring, oldest at `next` once full."""
    next: int
    """Where the next value goes."""
    count: int
    """Values held so far, at most N."""
    size: int
    """N."""
    sums: FloatArray
    """(4, 3) the value added last, the origin o the sums are taken about, so that a large mean costs no digits, the sum
    of (value - o), and that of its square."""

    @property
    def ring(self) -> FloatArray:
        """The values (N, 3), in the order of their places."""
        return np.concatenate(self.chunks)

    @property
    def full(self) -> bool:
        """Whether the window holds N values, so that its statistics mean something."""
        return self.count == self.size

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
    chunks = tuple(np.zeros((min(_CHUNK, samples - start), 3)) for start in range(0, samples, _CHUNK))
    return WindowState(chunks, 0, 0, samples, np.zeros((4, 3)))


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
            # (S2 - S1^2 / N) / (N - 1), which rounding may take below 0
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
            value[i] = alpha * reading[i] + (1 - alpha) * last[i]  # x_{t-1} as it entered, not as it was read
    return value


def add_force(state: WindowState, reading: FloatArray | None, p: WindowParams) -> WindowState:
    """Add a force reading (3,) [N]: as it is until the window is full, through eq. 8 from then on; None: nothing."""
    if reading is None:
        return state
    k, at = divmod(state.next, _CHUNK)
    # the step is pure, and copies of the ring only what it writes to
    chunk, size = state.chunks[k].copy(), state.size
    # Once a turn the sums are taken afresh, so that rounding errors never add up: O(1) on average. That is before the
    # next value and not after the last one, for what a step says of its window is of the running sums.
    sums = _afresh(state) if state.count == 1 or (state.count and state.next == 0) else state.sums.copy()
    add_to(chunk, at, sums, state.count, state.full, reading, p.alpha, p.lambda_)
    chunks = (*state.chunks[:k], chunk, *state.chunks[k + 1 :])
    return WindowState(chunks, (state.next + 1) % size, min(state.count + 1, size), size, sums)


def _afresh(state: WindowState) -> FloatArray:
    """Sums (4, 3) of the values of a window, about the newest of them."""
    origin = state.newest.copy()
    values = state.ring[: state.count] - origin
    return np.array([origin, origin, values.sum(axis=0), (values**2).sum(axis=0)])


@compiled
def add_to(
    chunk: FloatArray, at: int, sums: FloatArray, count: int, full: bool, reading: FloatArray, alpha: float,
    lambda_: float,
) -> None:  # fmt: skip
    """Change the chunk, at an index, and the sums (4, 3) as `add_force` says, for a window of `count` values so far."""
    x = reading
    # not before: the sigma of few values is near 0, and eq. 8 would take most readings for outliers
    if full:
        x = weighted_value(reading, sums[_NEWEST], window_mean(sums, count), window_std(sums, count), alpha, lambda_)
    for i in range(3):
        gone, chunk[at, i], sums[_NEWEST, i] = chunk[at, i], x[i], x[i]
        new, old = x[i] - sums[_ORIGIN, i], gone - sums[_ORIGIN, i] if full else 0.0
        sums[_TOTAL, i] += new - old
        sums[_SQUARES, i] += new**2 - old**2
