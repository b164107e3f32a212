"""Ways on which a ball and the arm come together, and which units see the ball in time."""

from dataclasses import dataclass

import numpy as np

from pretouch.control.braking import tangents_of
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.sighting import BallWays, Stretch, View, ways_free, ways_seen
from pretouch.coverage.surface import Surface
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import Fixtures, expected_range
from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import Sensors
from pretouch.sensing.skin import Skin
from pretouch.types import WHOLE, BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Ways:
    """S postures of an arm and W ways on which a ball comes to its surface in each, or the surface to a ball."""

    model: RobotModel
    room: Fixtures
    params: CoverageParams
    surface: Surface
    postures: tuple[Kinematics, ...]
    """S of them."""
    point: IntArray
    """(W,) index of the surface point that each way leads to, the same in all postures."""
    start: FloatArray
    """(S, W, 3) centre of the ball at the contact, base frame [m]."""
    way: FloatArray
    """(S, W, 3) unit vectors from there to where it comes from."""
    weight: FloatArray
    """(S, W) how often it comes on each, for the same area; 0 where it cannot."""

    @property
    def free(self) -> BoolArray:
        """(S, W) whether it can come this way."""
        return self.weight > 0

    @property
    def share(self) -> FloatArray:
        """(S, W) of all that comes, what comes on each way; they sum to 1, or to 0 where nothing can come."""
        often = self.surface.area[self.point] * self.weight
        return often / max(float(often.sum()), 1e-12)


def ways_to(
    model: RobotModel, room: Fixtures, params: CoverageParams, surface: Surface, q: FloatArray, each: int,
    rng: np.random.Generator,
) -> Ways:  # fmt: skip
    """Draw `each` ways to each surface point in S postures q (S, n) [rad].

    Directions are cosine-weighted about the outward normal: as things come that are equally likely everywhere and in
    all directions.
    """
    point = np.repeat(np.arange(len(surface)), each)
    here, postures = surface.only(point), tuple(model.kinematics(row) for row in q)
    way = np.array(
        [np.einsum("wij,wj->wi", kin.rotation[here.link], cosine_weighted(here.normal, rng)) for kin in postures]
    )
    return _ways(model, room, params, surface, postures, (point, way, np.ones(way.shape[:2])))


def ways_met(
    model: RobotModel, room: Fixtures, params: CoverageParams, surface: Surface, q: FloatArray, to: FloatArray
) -> Ways:
    """Return on which ways the arm itself runs into what stands about it, in S postures q (S, n) [rad].

    Its hand moves in the directions `to` (S, 3) and does not turn. A surface point of velocity v and outward normal n
    meets what stands along v as often as v . n says, and nothing where that is negative.
    """
    postures = tuple(model.kinematics(row) for row in q)
    velocity = np.array([_velocities(model, kin, surface, u) for kin, u in zip(postures, to, strict=True)])
    speed = np.linalg.norm(velocity, axis=2)
    normal = np.array([np.einsum("wij,wj->wi", kin.rotation[surface.link], surface.normal) for kin in postures])
    onto = np.einsum("swi,swi->sw", velocity, normal)
    way = np.where(speed[..., None] > _STILL, velocity / np.maximum(speed, _STILL)[..., None], normal)
    met = (np.arange(len(surface)), way, np.where(onto > _STILL, onto, 0.0))
    return _ways(model, room, params.standing(), surface, postures, met)


_STILL = 1e-9
"""Speed, for a hand at 1 m/s, below which a point of the arm counts as at rest."""


def _velocities(model: RobotModel, kin: Kinematics, surface: Surface, to: FloatArray) -> FloatArray:
    """Velocities (P, 3) of surface points with the hand at 1 m/s in a direction (3,), not turning."""
    J = model.ee_jacobian(kin)
    # damped as in `brought_to`
    qd = J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(6), np.concatenate([to, np.zeros(3)]))
    twist = np.array([model.jacobian(kin, i, kin.position[i]) @ qd for i in range(len(model.links))])[surface.link]
    offset = np.einsum("pij,pj->pi", kin.rotation[surface.link], surface.point)
    return twist[:, :3] + np.cross(twist[:, 3:], offset)


def _ways(
    model: RobotModel, room: Fixtures, params: CoverageParams, surface: Surface, postures: tuple[Kinematics, ...],
    drawn: tuple[IntArray, FloatArray, FloatArray],
) -> Ways:  # fmt: skip
    """Put the ball on ways drawn as point (W,), way (S, W, 3) and weight (S, W), which is 0 of those not free."""
    point, way, weight = drawn
    here, arm, about = surface.only(point), model.capsules, room.capsules
    start, free = np.empty_like(way), np.empty(weight.shape, np.bool_)
    centre = here.point + params.object_radius_m * here.normal
    for s, kin in enumerate(postures):
        start[s] = kin.position[here.link] + np.einsum("wij,wj->wi", kin.rotation[here.link], centre)
        _, a, b, _ = placed(arm, kin)
        capsules = Capsules(
            np.concatenate([arm.link, about.link]), np.vstack([a, about.a]), np.vstack([b, about.b]),
            np.concatenate([arm.radius, about.radius]),
        )  # fmt: skip
        ball = BallWays(start[s], way[s], params.object_radius_m)
        ways_free(ball, params.way_m, here.capsule, capsules, room.planes, free[s])
    return Ways(model, room, params, surface, postures, point, start, way, np.where(free, weight, 0.0))


def cosine_weighted(normal: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw a unit vector (N, 3) about each of N unit vectors, with a density that goes with the cosine between them."""
    across = np.empty((2, 3))
    u, turn = rng.uniform(size=len(normal)), 2 * np.pi * rng.uniform(size=len(normal))
    drawn = np.sqrt(1.0 - u)[:, None] * normal
    for i, n in enumerate(normal):
        tangents_of(n, across)
        drawn[i] += np.sqrt(u[i]) * (np.cos(turn[i]) * across[0] + np.sin(turn[i]) * across[1])
    return drawn


def seen_by(ways: Ways, skin: Skin) -> BoolArray:
    """Whether (B, S, W) each of the B mounted units of a skin sees the ball of each way in time, in any of its zones.

    A unit sees nothing behind the arm or the room in its own view, its own link included.
    """
    p = ways.params
    farthest, light, run = np.array([p.seen_by(unit.sensor) for unit in skin.units]).reshape(-1, 3).T.copy()
    free, seen = ways.free, np.zeros((len(skin.first), len(ways.postures), len(ways.point)), np.bool_)
    for s, kin in enumerate(ways.postures):
        position, rotation, _ = placed_sensors(skin.arrays, kin)
        of_no_link = Sensors(position, rotation, np.full(len(skin), -1, np.int64))
        own_view = expected_range(kin, of_no_link, skin.cones, ways.model.capsules, ways.room)
        limit = np.minimum(farthest, own_view - p.self_margin_m)
        found = np.zeros((len(skin), len(ways.point)), np.bool_)
        ways_seen(
            BallWays(ways.start[s], ways.way[s], p.object_radius_m), free[s], Stretch(p.first, p.last),
            Sensors(position, rotation, skin.link), skin.cones, View(limit, light, run.astype(WHOLE)), found,
        )  # fmt: skip
        seen[:, s] = np.logical_or.reduceat(found, skin.first)
    return seen
