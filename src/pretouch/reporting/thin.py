"""Long courses made short enough to draw, with all their peaks."""

import numpy as np

from pretouch.types import BoolArray, FloatArray, IntArray

BINS = 700
"""Stretches of time that a line is drawn in: more than a printed page shows."""


def envelope(time: FloatArray, values: FloatArray, bins: int = BINS) -> tuple[FloatArray, FloatArray]:
    """Least and greatest of each of so many stretches of a course (S,), in the order they came; a short one as it is.

    A stretch without any number is NaN, so that a line is broken there.
    """
    if len(values) <= 2 * bins:
        return time, values
    edges = np.linspace(0, len(values), bins + 1).astype(np.int64)[:-1]
    length = np.diff(np.append(edges, len(values)))
    bin_of = np.repeat(np.arange(bins), length)
    nan = np.isnan(values)
    low = _first_where(values, np.minimum.reduceat(np.where(nan, np.inf, values), edges), bin_of, edges)
    high = _first_where(values, np.maximum.reduceat(np.where(nan, -np.inf, values), edges), bin_of, edges)
    places = np.sort(np.stack([low, high], axis=1), axis=1).ravel()
    return time[places], values[places]


def _first_where(values: FloatArray, wanted: FloatArray, bin_of: IntArray, edges: IntArray) -> IntArray:
    """Index in each bin (B,) of the first value equal to the one wanted; the first of the bin if there is none."""
    hits = np.flatnonzero(values == wanted[bin_of])
    places = edges.copy()
    bins, first = np.unique(bin_of[hits], return_index=True)
    places[bins] = hits[first]
    return places


def stretches(time: FloatArray, flags: BoolArray, bins: int = BINS) -> list[tuple[float, float]]:
    """Spans of time [s] in which flags (S,) hold, those joined that would touch on paper."""
    if not len(time):
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    close = (time[-1] - time[0]) / bins
    joined: list[tuple[float, float]] = []
    for first, past in zip(edges[::2], edges[1::2], strict=True):
        start, end = float(time[first]), float(time[min(past, len(time) - 1)])
        if joined and start - joined[-1][1] < close:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return joined
