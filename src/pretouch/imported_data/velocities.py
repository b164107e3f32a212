"""Joint velocities of a recording that has none, or that are to be smooth."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from pretouch.types import FloatArray

GAP_S = 0.1
"""Time without a sample after which a recording begins anew [s]."""
_OVER_S = 0.04
"""Time over which velocities are averaged, half of it before and half after [s]."""


def pieces(time: FloatArray) -> list[slice]:
    """Stretches without a gap of instants (N,) [s]."""
    ends = np.flatnonzero(np.diff(time) > GAP_S) + 1
    return [slice(int(a), int(b)) for a, b in zip([0, *ends], [*ends, len(time)], strict=True)]


def velocities(time: FloatArray, q: FloatArray) -> FloatArray:
    """Velocities (N, n) [rad/s] of positions (N, n) [rad] at instants (N,) [s], smoothed."""
    found = np.zeros_like(q)
    for piece in pieces(time):
        if piece.stop - piece.start > 1:
            found[piece] = np.gradient(q[piece], time[piece], axis=0)
    return smoothed(time, found)


def smoothed(time: FloatArray, values: FloatArray) -> FloatArray:
    """Means of values (N, n) over `_OVER_S` about each instant, without delay."""
    made = values.copy()
    for piece in pieces(time):
        count = piece.stop - piece.start
        samples = round(_OVER_S * (count - 1) / max(time[piece.stop - 1] - time[piece.start], 1e-9)) if count > 1 else 1
        for _ in range(2):  # twice: a triangle, whose derivative does not jump
            made[piece] = uniform_filter1d(made[piece], max(1, min(samples, count)), axis=0, mode="nearest")
    return made
