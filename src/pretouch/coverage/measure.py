"""One measurement of coverage: what a skin sees in time of ways and surface, for each link and for the arm."""

from dataclasses import dataclass

import numpy as np

from pretouch.coverage.params import CoverageParams
from pretouch.coverage.surface import Surface, surface_of
from pretouch.coverage.ways import Ways, seen_by, ways_met, ways_to
from pretouch.coverage.workspace import postures
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray

COVERED = 0.5
"""Share of the ways to a surface point that has to be seen for the point to count as covered."""


@dataclass(frozen=True)
class LinkShare:
    """What is seen in time of objects that approach one link, or at the whole arm."""

    name: str
    area_m2: float
    """Outer surface that a ball can touch [m^2]."""
    ways: float
    """Share of the ways to it on which the ball is seen in time; NaN where nothing can come at all."""
    surface: float
    """Share of its surface to whose points at least half of the ways are seen."""


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
    total = float((weight * f).sum())
    if total <= 0:
        return LinkShare(name, 0.0, float("nan"), float("nan"))
    return LinkShare(name, float(area.sum()), float((weight * s).sum()) / total, float((weight * good).sum()))


Both = tuple[Coverage, Coverage]
"""Of what comes at the arm, and of what stands in the way of the moving arm."""

POINTS, EACH = 1600, 4
"""Points on the arm's surface, less what is hidden, and ways to each in each posture."""


@dataclass(frozen=True)
class Setting:
    """What is looked at: the seed decides postures, points and ways."""

    model: RobotModel
    room: Fixtures
    params: CoverageParams
    workspace: str = "paths"
    postures: int = 50
    seed: int = 0
    points: int = POINTS

    def ways(self, sample: int = 0) -> Ways:
        """Draw the ways; another `sample` has other postures, points and directions."""
        rng = np.random.default_rng([self.seed, 51, sample])
        q = postures(self.model, self.room, self.workspace, self.postures, rng).q
        surface = surface_of(self.model, self.points, float(rng.uniform()))
        return ways_to(self.model, self.room, self.params, surface, q, EACH, rng)

    def met(self, sample: int = 0) -> Ways:
        """Draw what stands in the arm's way, its hand on its path, either way along it, or in any direction."""
        rng = np.random.default_rng([self.seed, 52, sample])
        at = postures(self.model, self.room, self.workspace, self.postures, rng)
        surface = surface_of(self.model, self.points, float(rng.uniform()))
        sign = rng.choice((-1.0, 1.0), (self.postures, 1))
        if at.along is not None:
            to = sign * at.along
        else:
            drawn = rng.normal(size=(self.postures, 3))
            to = drawn / np.linalg.norm(drawn, axis=1)[:, None]
        return ways_met(self.model, self.room, self.params, surface, at.q, to)


def coverage_of(ways: Ways, skin: Skin) -> tuple[Coverage, BoolArray]:
    """Return what a skin sees, and which of its mounted units (B, S, W) see each way in time."""
    seen = seen_by(ways, skin)
    return covered(ways, seen), seen
