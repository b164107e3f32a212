"""One measurement of coverage: arm, room, postures, ways, and what a skin sees of them."""

from dataclasses import dataclass

import numpy as np

from pretouch.coverage.measure import Coverage, covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.surface import surface_of
from pretouch.coverage.ways import Ways, seen_by, ways_met, ways_to
from pretouch.coverage.workspace import postures
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray

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
