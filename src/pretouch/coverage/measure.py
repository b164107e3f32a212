"""One measurement of coverage: shares of ways and surface that a skin sees in time, for each link and for the arm.

It is averaged over postures of a workspace: on the paper's paths, or in the joints' whole range.
"""

from dataclasses import dataclass, replace

import numpy as np

from pretouch.coverage.params import CoverageParams
from pretouch.coverage.ways import Ways, ways_met, ways_to
from pretouch.errors import ExperimentError
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to, capsule_ends, ever_apart, kinematics_of, self_distances
from pretouch.sim.paper_scenes import placement_for
from pretouch.types import BoolArray, FloatArray

_EACH = 4
"""Ways to each point of the surface in each posture."""
KINDS = ("circle", "line", "paths", "joints")
_DRAWN = 40
"""Random postures for each accepted one, at most: in many the arm collides with itself or the floor."""


@dataclass(frozen=True)
class LinkShare:
    """Coverage of one link, or of the whole arm."""

    name: str
    area_m2: float
    """Outer surface that a ball can touch [m^2]."""
    ways: float
    """Share of the ways to it on which the ball is seen in time; NaN without a free way."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """Coverage of a skin by surface point."""

    free: FloatArray
    """(P,) weight of the ways to each point, in all postures."""
    visible: FloatArray
    """(P,) weight of those on which the ball is seen in time."""
    links: tuple[LinkShare, ...]
    """Links with a free way, in the arm's order."""
    arm: LinkShare

    @property
    def point_share(self) -> FloatArray:
        """Share of the ways to each point seen in time (P,), NaN without a free way."""
        return np.divide(self.visible, self.free, out=np.full(len(self.free), np.nan), where=self.free > 0)


def covered(ways: Ways, sees: BoolArray) -> Coverage:
    """Return the coverage by point and by link, from the ways that B mounted units (B, S, W) see in time."""
    surface, visible = ways.surface, np.where(np.logical_or.reduce(sees), ways.weight, 0.0)
    count, names = len(surface.link), ways.model.links
    free, visible = (
        np.bincount(ways.point, weight.sum(axis=0), count).astype(np.float64) for weight in (ways.weight, visible)
    )
    reached = free > 0

    def shares(name: str, points: BoolArray) -> LinkShare:
        area = surface.area[points]  # the weight of a point: the areas differ slightly
        share = float(area @ visible[points] / (area @ free[points])) if points.any() else float("nan")
        return LinkShare(name, float(area.sum()), share)

    links = (shares(names[i], (surface.link == i) & reached) for i in np.unique(surface.link[reached]))
    return Coverage(free, visible, tuple(links), shares("whole arm", reached))


@dataclass(frozen=True)
class CoverageSetting:
    """Setting of a measurement; the seed determines postures and ways."""

    model: RobotModel
    room: Fixtures
    params: CoverageParams
    workspace: str = "paths"
    postures: int = 50
    seed: int = 0

    def draw(self, sample: int = 0) -> tuple[Ways, Ways, Ways]:
        """Draw ways of what comes, of what the moving arm meets, and of what its hand meets; another `sample` differs.

        What is met is at rest. The hand moves either way on its path, or in any direction. The last are its ways
        both ways along three random axes at right angles in each posture, with the same weight for each direction.
        """
        model, room, rng = self.model, self.room, np.random.default_rng([self.seed, 51, sample])
        q, along = postures(model, room, self.workspace, self.postures, rng)
        ways = ways_to(model, room, self.params, q, np.repeat(np.arange(len(model.surface.link)), _EACH), rng)
        to = rng.normal(size=(self.postures, 3))
        to = to / np.linalg.norm(to, axis=1, keepdims=True) if along is None else np.sign(to[:, :1]) * along
        axes = np.linalg.qr(rng.normal(size=(self.postures, 3, 3)))[0]
        axes = np.concatenate([axes, -axes], axis=1).reshape(-1, 3)
        hand = ways_met(model, room, self.params.standing(), np.repeat(q, 6, axis=0), axes)
        weight = np.where(model.rigid[hand.surface.link] == model.rigid[model.ee], hand.weight, 0.0)
        weight /= np.maximum(weight @ hand.surface.area, 1e-12)[:, None]
        return ways, ways_met(model, room, self.params.standing(), q, to), replace(hand, weight=weight)


def postures(
    model: RobotModel, room: Fixtures, workspace: str, count: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray | None]:
    """Draw postures of a workspace (S, n) [rad], and unit tangents of the hand's path there (S, 3), base frame.

    `circle` and `line` are the paper's paths, `paths` both, the hand upright; `joints` is the whole range of the
    joints, where the arm is free of collisions, without a path: None. Raises ExperimentError for any other workspace,
    and for a path out of reach.
    """
    if count < 2:
        raise ExperimentError(f"The number of postures is {count}: give at least 2.")
    if workspace == "joints":
        return _anywhere(model, room, count, rng), None
    if workspace not in KINDS:
        raise ExperimentError(f"The workspace is {workspace!r}: give {', '.join(KINDS)}.")
    place = placement_for(model)
    paths = [place.path(name, 1.0) for name in (("circle", "line") if workspace == "paths" else (workspace,))]
    parts = np.array_split((np.arange(count) + rng.uniform(size=count)) / count, len(paths))
    at = [(path, p * len(paths) % 1.0 * path.length) for path, part in zip(paths, parts, strict=True) for p in part]
    q = np.array([brought_to(model, path.point(phase)) for path, phase in at])
    return q, np.array([path.tangent(phase) for path, phase in at])


def _anywhere(model: RobotModel, room: Fixtures, count: int, rng: np.random.Generator) -> FloatArray:
    """Return postures (S, n) without self-collision, with the moving part on the free side of all planes."""
    half, apart = np.minimum((model.q_max - model.q_min) / 2, np.pi), ever_apart(model)
    moving = np.isin(model.capsules.link, model.parts)
    samples = model.q_mid + half * rng.uniform(-1, 1, (_DRAWN * count, model.n))
    free = list[FloatArray]()
    for q in samples:
        ends = capsule_ends(model, kinematics_of(model, q[None]))
        heights = ends[0, moving] @ room.planes[:, :3].T - room.planes[:, 3] - model.body.radius[:, None, None]
        if self_distances(model, ends)[0, apart].min(initial=np.inf) > 0 and heights.min(initial=np.inf) > 0:
            free.append(q)
        if len(free) == count:
            return np.array(free)
    raise ExperimentError(
        f"{model.description.name} is free of itself and the floor in too few postures: choose another workspace."
    )
