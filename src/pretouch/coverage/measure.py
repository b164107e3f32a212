"""Shares of ways and of surface that are seen in time, with bounds, for each link and for the arm."""

from dataclasses import dataclass

import numpy as np

from pretouch.coverage.surface import Surface
from pretouch.coverage.ways import Ways
from pretouch.types import BoolArray, FloatArray

COVERED = 0.5
"""Share of the ways to a surface point that has to be seen for the point to count as covered."""
_NORMAL_95 = 1.96


@dataclass(frozen=True)
class Share:
    """A share and its 95 % bounds; no numbers where nothing can come at all."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class LinkShare:
    """What is seen in time of objects that approach one link, or at the whole arm."""

    name: str
    area_m2: float
    """Outer surface that a ball can touch [m^2]."""
    ways: Share
    """Of the ways to it, those on which the ball is seen in time."""
    surface: Share
    """Of its surface, the points to which at least half of the ways are seen."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """What a skin sees in time, by posture and surface point."""

    surface: Surface
    free: FloatArray
    """(S, P) weight of the ways to each point in each posture."""
    seen: FloatArray
    """(S, P) weight of those on which the ball is seen in time."""
    links: tuple[LinkShare, ...]
    """Each link, in the arm's order."""
    arm: LinkShare

    @property
    def point_share(self) -> FloatArray:
        """Share of the ways to each point that are seen (P,), NaN where nothing can come."""
        free = self.free.sum(axis=0)
        return np.where(free > 0, self.seen.sum(axis=0) / np.where(free > 0, free, 1.0), np.nan)


def covered(ways: Ways, sees: BoolArray) -> Coverage:
    """Bring together, by point and by link, what each of B mounted units (B, S, W) sees in time."""
    count, seen = len(ways.surface), np.logical_or.reduce(sees)
    free = np.array([np.bincount(ways.point, row, count) for row in ways.weight])
    found = np.array([np.bincount(ways.point, row, count) for row in np.where(seen, ways.weight, 0.0)])
    reached, link = free.sum(axis=0) > 0, ways.surface.link
    links = tuple(
        _of(ways.model.links[i], ways.surface, free, found, (link == i) & reached)
        for i in np.unique(link)
        if np.any((link == i) & reached)
    )
    return Coverage(ways.surface, free, found, links, _of("whole arm", ways.surface, free, found, reached))


def _of(name: str, surface: Surface, free: FloatArray, seen: FloatArray, points: BoolArray) -> LinkShare:
    area, f, s = surface.area[points], free[:, points], seen[:, points]
    # each point weighs as its area: capsules' points differ a little in what they stand for
    weight = area / area.sum()
    good = s.sum(axis=0) >= COVERED * f.sum(axis=0)
    return LinkShare(name, float(area.sum()), ratio(weight * s, weight * f), ratio((weight * good)[None], weight[None]))


def ratio(seen: FloatArray, free: FloatArray) -> Share:
    """Return sum(seen) / sum(free) of (S, P) with 95 % bounds, by the spread over postures and that over points, added.

    The usual linearised variance of a ratio, once with postures and once with points as what was drawn: safe where
    they vary together. Where all or none are seen nothing spreads, and the bound is that of as many trials as there are
    points or postures, whichever are fewer (Clopper and Pearson); with one posture, of the points.
    """
    total = float(free.sum())
    if total <= 0:
        return Share(float("nan"), float("nan"), float("nan"))
    value = float(seen.sum()) / total
    rest = seen - value * free
    variance = sum(_spread(rest.sum(axis=axis)) for axis in (0, 1)) / total**2
    few = 1.0 - 0.025 ** (1.0 / (free.shape[1] if len(free) == 1 else min(free.shape)))
    if value <= 0.0 or value >= 1.0 - 1e-12:
        return Share(value, 0.0 if value <= 0.0 else 1.0 - few, few if value <= 0.0 else 1.0)
    half = _NORMAL_95 * float(np.sqrt(variance))
    return Share(value, max(0.0, value - half), min(1.0, value + half))


def _spread(parts: FloatArray) -> float:
    """Variance of a sum of independent parts (N,), by their scatter about 0."""
    n = len(parts)
    return float((parts**2).sum()) * (n / (n - 1) if n > 1 else 1.0)
