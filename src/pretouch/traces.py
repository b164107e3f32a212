"""Time series of measurements: arrays by instant."""

from dataclasses import fields, replace
from typing import Self

import numpy as np

from pretouch.types import BoolArray, FloatArray, IntArray
from pretouch.values import value


@value
class ImuTrace:
    """Measurements of one unit's IMU by time. M samples, sensor frame."""

    stamp: FloatArray
    """(M,) [s]."""
    acceleration: FloatArray
    """(M, 3) proper acceleration: at rest, that against gravity [m/s^2]."""
    angular_velocity: FloatArray
    """(M, 3) [rad/s]."""


@value
class JointTrace:
    """Measured joint positions of an arm, by time. T samples of n joints."""

    stamp: FloatArray
    """(T,) [s]."""
    q: FloatArray
    """(T, n) [rad]."""

    def at(self, which: BoolArray | IntArray) -> Self:
        """Return some of the samples, by flags (T,) or indices."""
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(self, **{name: column[which] for name, column in columns.items() if column is not None})


def on_grid(time: FloatArray, begin: float, spacing: float, values: FloatArray) -> FloatArray:
    """Interpolate values (G, ...), which begin at `begin` and have a spacing [s], at instants (N,) [s], linearly."""
    place = np.clip((time - begin) / spacing, 0.0, len(values) - 1.000001)
    left = place.astype(np.int64)
    share = (place - left).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1.0 - share) * values[left] + share * values[np.minimum(left + 1, len(values) - 1)])


def spans(flags: BoolArray) -> list[tuple[int, int]]:
    """First and one past the last index of each run of true flags (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def mean_over(values: FloatArray, samples: int) -> FloatArray:
    """Moving mean (T - samples + 1,) of values (T,); of fewer than `samples` values, their mean (1,)."""
    if len(values) < samples:
        return np.array([float(values.mean())]) if len(values) else np.zeros(0)
    return np.convolve(values, np.full(samples, 1.0 / samples), mode="valid")
