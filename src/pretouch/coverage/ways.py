"""Ways on which a ball comes at the arm, and which units see it on them in time."""

from dataclasses import dataclass

import numpy as np

from pretouch.control.braking import tangents_of
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.surface import Surface
from pretouch.groups import CapsuleArrays, Sensors
from pretouch.perception.obstacles import sensor_poses
from pretouch.perception.scene_filter import Fixtures, expected_range
from pretouch.perception.sighting import BallWays, Stretch, View, ways_free, ways_seen
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.vectors import placed
from pretouch.sensing.skin import Skin
from pretouch.types import WHOLE, BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Ways:
    """S postures of an arm and W ways to its surface in each."""

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
    free: BoolArray
    """(S, W) whether it can come this way."""


def ways_to(
    model: RobotModel, room: Fixtures, params: CoverageParams, surface: Surface, q: FloatArray, each: int,
    rng: np.random.Generator,
) -> Ways:  # fmt: skip
    """Draw `each` ways to each surface point in S postures q (S, n) [rad].

    Directions are cosine-weighted about the outward normal: as things come that are equally likely everywhere and in
    all directions.
    """
    point = np.repeat(np.arange(len(surface)), each)
    here = surface.only(point)
    normal, postures = here.normal, tuple(model.kinematics(row) for row in q)
    start, way = np.empty((2, len(q), len(point), 3))
    free = np.empty((len(q), len(point)), np.bool_)
    arm = model.capsules
    centre = here.point + params.object_radius_m * normal
    for s, kin in enumerate(postures):
        R = kin.rotation[here.link]
        start[s] = kin.position[here.link] + np.einsum("wij,wj->wi", R, centre)
        way[s] = np.einsum("wij,wj->wi", R, cosine_weighted(normal, rng))
        a, b = placed(arm, kin)
        about = room.capsules
        capsules = CapsuleArrays(
            np.concatenate([arm.link, about.link]), np.vstack([a, about.a]), np.vstack([b, about.b]),
            np.concatenate([arm.radius, about.radius]),
        )  # fmt: skip
        ball = BallWays(start[s], way[s], params.object_radius_m)
        ways_free(ball, params.way_m, here.capsule, capsules, room.planes, free[s])
    return Ways(model, room, params, surface, postures, point, start, way, free)


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
    seen = np.zeros((len(skin.first), len(ways.postures), len(ways.point)), np.bool_)
    for s, kin in enumerate(ways.postures):
        position, rotation = sensor_poses(skin, kin)
        of_no_link = Sensors(position, rotation, np.full(len(skin), -1, np.int64))
        own_view = expected_range(kin, of_no_link, skin.cones, ways.model.capsules, ways.room)
        limit = np.minimum(farthest, own_view - p.self_margin_m)
        found = np.zeros((len(skin), len(ways.point)), np.bool_)
        ways_seen(
            BallWays(ways.start[s], ways.way[s], p.object_radius_m), ways.free[s], Stretch(p.first, p.last),
            Sensors(position, rotation, skin.link), skin.cones, View(limit, light, run.astype(WHOLE)), found,
        )  # fmt: skip
        seen[:, s] = np.logical_or.reduceat(found, skin.first)
    return seen
