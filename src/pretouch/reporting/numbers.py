"""Small measures that every section shares: each leaves out NaN and says None of nothing."""

from dataclasses import dataclass

import numpy as np

from pretouch.types import BoolArray, FloatArray


@dataclass(frozen=True)
class Spread:
    """How some numbers are spread."""

    median: float
    p99: float
    max: float


def spread(values: FloatArray) -> Spread | None:
    """Median, 99 % and largest of the finite ones of some values."""
    kept = values[np.isfinite(values)]
    if not kept.size:
        return None
    median, p99 = np.percentile(kept, [50, 99])
    return Spread(float(median), float(p99), float(kept.max()))


def least(values: FloatArray) -> tuple[float, int] | None:
    """Least of some values (S,) and where it is."""
    if not np.any(np.isfinite(values)):
        return None
    place = int(np.argmin(np.where(np.isfinite(values), values, np.inf)))
    return float(values[place]), place


def least_of_each(values: FloatArray) -> FloatArray:
    """Least of each row (S,) of values (S, K), NaN where a row has none."""
    lowest = np.where(np.isnan(values), np.inf, values).min(axis=1, initial=np.inf)
    return np.where(np.isinf(lowest), np.nan, lowest)


def durations(time: FloatArray) -> FloatArray:
    """How long each step (S,) lasted: until the next one; the last as long as is usual [s]."""
    if len(time) < 2:
        return np.zeros(len(time))
    steps = np.maximum(np.diff(time), 0.0)
    return np.append(steps, np.median(steps))


def share(flags: BoolArray) -> float | None:
    """Share of true flags."""
    return float(np.mean(flags)) if len(flags) else None
