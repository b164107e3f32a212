"""True touches: what only a simulation knows of contacts."""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from pretouch.recording.run_record import TrueForces
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import mean_over, spans
from pretouch.types import FloatArray

BOUNCE_S = 0.1
"""Touches with less than this between them are one [s]."""
TRANSIENT_S = 0.5
"""From this long after its beginning a contact counts as quasi-static [s] (ISO/TS 15066)."""
MEAN_S = 0.02
"""Length of the mean that peaks are also given of [s]."""


@dataclass(frozen=True)
class Touch:
    """One true touch: from the true force passing 1 N until it is below for good."""

    start: float
    """[s]"""
    end: float
    """[s]"""
    peak: float
    """Largest true force [N]."""
    peak_20ms: float
    """Largest 20 ms mean of the true force [N]."""
    held: float
    """Largest 20 ms mean that begins 0.5 s after the touch or later [N], NaN if it was over by then."""
    link: str
    """Link that touched first, '' where that is not known."""
    velocity: FloatArray
    """(3,) velocity of the touching point before the contact [m/s], NaN where that is not known."""


def touches_of(truth: TrueForces | None) -> list[Touch]:
    """All true touches in order; none where nothing is known, or what is said to be known cannot be."""
    if truth is None or len(truth.time) < 2 or not np.all(np.isfinite(truth.time)):
        return []
    time, force = truth.time, np.linalg.norm(truth.force, axis=1)
    samples = max(1, round(MEAN_S / max(float(np.median(np.diff(time))), 1e-9)))
    mean = mean_over(force, samples)
    merged = _merged(spans(force > TOUCH_N), time)
    found, before, begun = [], -np.inf, [touched for touched, _, _ in truth.touches]
    for first, past in merged:
        start, end = float(time[first]), float(time[past - 1])
        late = int(np.searchsorted(time, start + TRANSIENT_S))
        link, velocity = _beginning(truth, begun, before, start)
        found.append(
            Touch(
                start, end,
                peak=float(force[first:past].max()),
                peak_20ms=_largest(mean, first - samples + 1, past),
                held=_largest(mean, late, past) if late < past else float("nan"),
                link=link, velocity=velocity,
            )
        )  # fmt: skip
        before = end
    return found


def _merged(flags: list[tuple[int, int]], time: FloatArray) -> list[tuple[int, int]]:
    """Join spans with less than `BOUNCE_S` between them."""
    merged: list[tuple[int, int]] = []
    for first, past in flags:
        if merged and time[first] - time[merged[-1][1] - 1] < BOUNCE_S:
            merged[-1] = (merged[-1][0], past)
        else:
            merged.append((first, past))
    return merged


def _largest(mean: FloatArray, first: int, past: int) -> float:
    """Largest of the moving means that begin from `first` on and before `past`, 0 of none."""
    return float(mean[max(first, 0) : past].max(initial=0.0))


def _beginning(truth: TrueForces, begun: list[float], after: float, start: float) -> tuple[str, FloatArray]:
    """Link and velocity of the last contact that began after one instant and by another [s], as `begun` has them."""
    last = bisect_right(begun, start + 1e-9) - 1
    if last < 0 or not begun[last] > after:
        return "", np.full(3, np.nan)
    _, link, velocity = truth.touches[last]
    return link, velocity
