"""Ways on which a ball and the arm approach each other, and their visibility to the units."""

from dataclasses import dataclass

import numpy as np

from pretouch.coverage.params import CoverageParams
from pretouch.coverage.sighting import BallWays, View, ways_free, ways_seen
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import Fixtures, bounds, nearest_capsule, plane_return
from pretouch.robot.body import Capsules, Surface, placed
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import Cones, Sensors
from pretouch.sensing.skin import Skin
from pretouch.types import WHOLE, BoolArray, FloatArray, IntArray

_STILL = 1e-9
"""Speed below which a point of the arm counts as at rest, for a hand at 1 m/s."""
_STEP_S = 1e-6
"""Time step of numerical velocities [s]."""
_Postures = tuple[Kinematics, ...]
_Paths = tuple[IntArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Ways:
    """S postures of an arm, with W ways in each on which a ball approaches its surface, or the surface a ball."""

    model: RobotModel
    room: Fixtures
    params: CoverageParams
    surface: Surface
    """P points."""
    postures: _Postures
    """S postures."""
    point: IntArray
    """(W,) index of the surface point of each way, the same in all postures."""
    start: FloatArray
    """(S, W, 3) centre of the ball at the contact, base frame [m]."""
    way: FloatArray
    """(S, W, 3) unit vectors from there against the motion."""
    weight: FloatArray
    """(S, W) relative frequency of each for the same area; 0 for a way that is not free."""

    @property
    def free(self) -> BoolArray:
        """(S, W) flags of the free ways."""
        return self.weight > 0

    @property
    def share(self) -> FloatArray:
        """(S, W) share of each way in all approaches; the sum is 1, or 0 without a free way."""
        frequency = self.surface.area[self.point] * self.weight
        return frequency / max(float(frequency.sum()), 1e-12)


def ways_to(
    model: RobotModel, room: Fixtures, params: CoverageParams, q: FloatArray, point: IntArray,
    rng: np.random.Generator, surface: Surface | None = None,
) -> Ways:  # fmt: skip
    """Draw a way to each of some surface points (W,), in S postures q (S, n) [rad].

    Directions are cosine-weighted about the outward normal, as for objects that are equally likely at all places and in
    all directions. The points are indices of `surface`, by default the arm's own.
    """
    surface = model.surface if surface is None else surface
    postures = tuple(model.kinematics(row) for row in q)
    way = np.array([cosine_weighted(_normals(kin, surface)[point], rng) for kin in postures])
    return _ways(model, room, params, surface, postures, (point, way, np.ones(way.shape[:2])))


def ways_met(model: RobotModel, room: Fixtures, params: CoverageParams, q: FloatArray, to: FloatArray) -> Ways:
    """Return the ways of the moving arm to objects at rest, in S postures q (S, n) [rad]; `params` are of such objects.

    Its hand moves in the directions `to` (S, 3) and does not turn. A surface point of velocity v and outward normal n
    collides along v with a frequency proportional to v . n, or never where that is negative.
    """
    surface, postures = model.surface, tuple(model.kinematics(row) for row in q)
    velocity = np.array([_velocities(model, *at) for at in zip(q, postures, to, strict=True)])
    speed = np.linalg.norm(velocity, axis=2, keepdims=True)
    normal = np.array([_normals(kin, surface) for kin in postures])
    onto = np.einsum("swi,swi->sw", velocity, normal)
    way = np.where(speed > _STILL, velocity / np.maximum(speed, _STILL), normal)
    paths = np.arange(len(surface.link)), way, np.where(onto > _STILL, onto, 0.0)
    return _ways(model, room, params, surface, postures, paths)


def _velocities(model: RobotModel, q: FloatArray, kin: Kinematics, to: FloatArray) -> FloatArray:
    """Return velocities (P, 3) of the arm's surface, with the hand at 1 m/s in a direction (3,) and not turning."""
    J = model.ee_jacobian(kin)
    # damped as in `brought_to`
    qd = J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(6), np.concatenate([to, np.zeros(3)]))
    later = model.kinematics(q + _STEP_S * qd)
    link, point = model.surface.link, model.surface.point
    return (_in_base(later, link, point) - _in_base(kin, link, point)) / _STEP_S


def _in_base(kin: Kinematics, link: IntArray, point: FloatArray) -> FloatArray:
    """Return points (N, 3) of links (N,) in the base frame [m]."""
    return kin.position[link] + np.einsum("nij,nj->ni", kin.rotation[link], point)


def _normals(kin: Kinematics, surface: Surface) -> FloatArray:
    """Return outward normals (P, 3) in the base frame."""
    return np.asarray(np.einsum("nij,nj->ni", kin.rotation[surface.link], surface.normal))


def _ways(
    model: RobotModel, room: Fixtures, params: CoverageParams, surface: Surface, postures: _Postures, paths: _Paths
) -> Ways:
    """Return the ways of the ball for points (W,), directions (S, W, 3) and weights (S, W); 0 for ways not free."""
    point, way, weight = paths
    arm, about, r = model.capsules, room.capsules, params.object_radius_m
    centre = (surface.point + r * surface.normal)[point]
    start = np.array([_in_base(kin, surface.link[point], centre) for kin in postures])
    free = np.empty(weight.shape, np.bool_)
    for s, kin in enumerate(postures):
        around = Capsules(*(np.concatenate(pair) for pair in zip(placed(arm, kin), about, strict=True)))
        free[s] = ways_free(BallWays(start[s], way[s], r), params.way_m, around, room.planes)
    return Ways(model, room, params, surface, postures, point, start, way, np.where(free, weight, 0.0))


def cosine_weighted(normal: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw a unit vector (N, 3) about each of N unit vectors, with a density proportional to the cosine between them.

    The sum of a unit vector and a random one, uniform on the sphere, has such a direction.
    """
    vector = rng.normal(size=normal.shape)
    vector = normal + vector / np.linalg.norm(vector, axis=1, keepdims=True)
    return np.asarray(vector / np.linalg.norm(vector, axis=1, keepdims=True))


def seen_by(ways: Ways, skin: Skin) -> BoolArray:
    """Return whether (B, S, W) each mounted unit of a skin sees the ball of each way in time, in any of its zones.

    A unit sees nothing behind the arm or the room in its own view, its own link included.
    """
    p = ways.params
    farthest, light, run = np.array([p.seen_by(unit.sensor) for unit in skin.units]).reshape(-1, 3).T.copy()
    free, visible = ways.free, np.zeros((len(skin.first), len(ways.postures), len(ways.point)), np.bool_)
    for s, kin in enumerate(ways.postures):
        position, rotation, _ = placed_sensors(skin.arrays, kin)
        sensors = Sensors(position, rotation, np.full(len(skin), -1, np.int64))
        own_view = expected_range(kin, sensors, skin.cones, ways.model.capsules, ways.room)
        view = View(np.minimum(farthest, own_view - p.self_margin_m), light, run.astype(WHOLE))
        by_zone = np.zeros((len(skin), len(ways.point)), np.bool_)
        ball = BallWays(ways.start[s], ways.way[s], p.object_radius_m)
        ways_seen(ball, free[s], p.first, p.last, sensors, skin.cones, view, by_zone)
        visible[:, s] = np.logical_or.reduceat(by_zone, skin.first)
    return visible


def expected_range(kin: Kinematics, sensors: Sensors, cones: Cones, body: Capsules, fixtures: Fixtures) -> FloatArray:
    """Return the distance (K,) [m] at which each sensor would see the arm or a fixture, infinite without a return.

    It is the least over rays that fill the placed sensor's cone. A unit does not see its own link. `body` is the arm
    as capsules, base included.
    """
    near = np.array([plane_return(sensors, k, fixtures.planes, cones, np.inf) for k in range(len(sensors.link))])
    for part in (body, fixtures.capsules):
        capsules = placed(part, kin)
        spheres = bounds(capsules)
        for k in range(len(near)):
            near[k] = min(near[k], nearest_capsule(sensors, k, capsules, spheres, cones))
    return near
