"""How fast the arm may go where no unit looks: what stands there is met before it is seen.

A place of the surface with outward normal n and velocity v runs into what lies along v, the more often the larger n . v
is. A ball there, as far ahead as the arm brakes in, is in view of a unit or not. Of each rigid body, the fastest n . v
times the share of what it meets unseen is bounded: by a factor on all that is asked, so that the arm stays on its path.
"""

from typing import Any, NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry, flattened
from pretouch.groups import CapsuleArrays, Chain, Cones, Sensors, SkinArrays, SurfaceArrays
from pretouch.params import PerceptionParams, UnseenSpeed
from pretouch.perception.closest import bounds, to_axis
from pretouch.perception.obstacles import poses
from pretouch.perception.scene_filter import Fixtures, Wanted, capsule_return, plane_return
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.surface import surface_of
from pretouch.robot.vectors import dot, placed_capsules, rotate
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

_SPACING_M = 0.05
"""About the distance of neighbouring places on the body: a ball of that radius comes to each [m]."""
_DAMPING = 1e-4
"""Of the joint velocities that stand for a velocity asked of the hand, as everywhere it is brought somewhere [m^2]."""


class _Placed(NamedTuple):
    """Capsules in the base frame."""

    capsules: CapsuleArrays
    spheres: FloatArray
    """Round them, by `bounds`."""


class _Limits(NamedTuple):
    """Numbers of the bound."""

    speed: float
    ahead: float
    radius: float
    margin: float
    """Distance before the arm's or the room's own return from which on nothing else is seen [m]."""


class _Around(NamedTuple):
    """What the units may see in place of a ball, and where no ball can be."""

    arm: CapsuleArrays
    others: CapsuleArrays
    planes: FloatArray


@value
class Unseen:
    """The bound for one arm, skin and surroundings."""

    model: RobotModel
    params: UnseenSpeed
    fields: tuple[Any, ...]
    """Of skin, surface, surroundings and numbers, for compiled code."""


def unseen_on(
    params: UnseenSpeed | None, model: RobotModel, skin: Skin, fixtures: Fixtures, sight: PerceptionParams | None
) -> Unseen | None:
    """Return the bound as it works on an arm; None for none. Without perception nothing is seen anywhere."""
    if params is None:
        return None
    if sight is None:
        skin, sight = Skin((), model), PerceptionParams()
    around = _Around(model.capsules.arrays, fixtures.capsules.arrays, fixtures.planes)
    rest = model.kinematics(model.q_mid)
    places = surface_of(model.body, model.moved_by, rest.position, rest.rotation, _SPACING_M)
    limits = _Limits(params.speed_m_s, params.ahead_m, params.object_radius_m, sight.self_margin_m or 0.0)
    return Unseen(model, params, flattened(skin.arrays, places.arrays, around, limits))


def unseen_scale(bound: Unseen, kin: Kinematics, velocity: FloatArray, qd: FloatArray | None) -> float:
    """Factor in (0, 1] on a velocity (3,) [m/s] asked of the end-effector, or on joint velocities (n,) [rad/s].

    A hand that is asked to move is taken to keep its orientation; what else moves in the null space is left out.
    """
    if qd is None:
        J = bound.model.ee_jacobian(kin)
        qd = J.T @ np.linalg.solve(J @ J.T + _DAMPING * np.eye(6), np.concatenate([velocity, np.zeros(3)]))
    return _scale.flat(*kin, bound.model.moved_by, np.ascontiguousarray(qd, float), *bound.fields)


class _Moving(NamedTuple):
    """How the arm is to move."""

    moved_by: BoolArray
    qd: FloatArray


@entry
def _scale(
    kin: Kinematics, moving: _Moving, skin: SkinArrays, surface: SurfaceArrays, around: _Around, p: _Limits
) -> float:
    chain = Chain(kin.anchor, kin.axis, moving.moved_by, moving.qd)
    sensors = Sensors(*poses(kin.position, kin.rotation, skin.link, skin.T_link_sensor), skin.link)
    room = _placed(around.arm, kin), _placed(around.others, kin)
    point, normal, velocity, ball = np.empty(3), np.empty(3), np.empty(3), np.empty((1, 3))
    least = 1.0
    for body in range(len(surface.first) - 1):
        fastest, met, blind = 0.0, 0.0, 0.0
        for i in range(surface.first[body], surface.first[body + 1]):
            link = surface.link[i]
            rotate(kin.rotation[link], surface.point[i], point)
            point += kin.position[link]
            _velocity(chain, link, point, velocity)
            rotate(kin.rotation[link], surface.normal[i], normal)
            onto = dot(velocity, normal)
            if onto <= p.speed:
                continue
            away = p.ahead / np.sqrt(dot(velocity, velocity))
            for k in range(3):
                ball[0, k] = point[k] + p.radius * normal[k] + away * velocity[k]
            if _fits(ball, room, around.planes):
                weight = surface.area[i] * (onto - p.speed)
                met += weight
                blind += weight * (1.0 - _seen(ball[0], sensors, skin.cones, room, around.planes, p))
                fastest = max(fastest, onto)
        # n . v times the share of what the body meets that is not seen is at most the bound
        if fastest * blind > p.speed * met:
            least = min(least, p.speed * met / (fastest * blind))
    return least


@compiled
def _placed(capsules: CapsuleArrays, kin: Kinematics) -> _Placed:
    placed = placed_capsules(capsules, kin)
    return _Placed(placed, bounds(placed.a, placed.b, placed.radius))


@compiled
def _velocity(chain: Chain, link: int, point: FloatArray, velocity: FloatArray) -> None:
    """Write the velocity (3,) [m/s] of a point (3,) of a link: the sum of a x (p - p_j) qd_j."""
    velocity[:] = 0.0
    for j in range(len(chain.anchor)):
        if chain.moved_by[link, j]:
            a, qd = chain.axis[j], chain.qd[j]
            x, y, z = point[0] - chain.anchor[j, 0], point[1] - chain.anchor[j, 1], point[2] - chain.anchor[j, 2]
            velocity[0] += qd * (a[1] * z - a[2] * y)
            velocity[1] += qd * (a[2] * x - a[0] * z)
            velocity[2] += qd * (a[0] * y - a[1] * x)


@compiled
def _fits(ball: FloatArray, room: tuple[_Placed, _Placed], planes: FloatArray) -> bool:
    """Whether a ball (1, 3) can be there: its centre in neither the arm nor what is known to stand around it."""
    for placed in room:
        a, b, radius = placed.capsules.a, placed.capsules.b, placed.capsules.radius
        for c in range(len(radius)):
            if to_axis(ball, 0, a, b, c)[1] < radius[c]:
                return False
    height = np.inf
    for m in range(len(planes)):
        height = min(height, dot(planes[m], ball[0]) - planes[m, 3])
    return bool(height >= 0.0)


@compiled
def _seen(
    ball: FloatArray, sensors: Sensors, cones: Cones, room: tuple[_Placed, _Placed], planes: FloatArray, p: _Limits
) -> float:
    """How much of a ball's radius any unit sees: 1 with its centre in a cone, 0 with all of it outside of all cones."""
    most = 0.0
    for k in range(len(sensors.link)):
        edge, farthest = cones.edge[cones.kind[k]], cones.range[cones.kind[k], 1]
        R, position = sensors.rotation, sensors.position
        x, y, z = ball[0] - position[k, 0], ball[1] - position[k, 1], ball[2] - position[k, 2]
        away, depth = np.sqrt(x * x + y * y + z * z), x * R[k, 0, 2] + y * R[k, 1, 2] + z * R[k, 2, 2]
        if depth <= 0.0 or away - p.radius > farthest:
            continue
        # how far the centre lies outside the cone
        aside = np.sqrt(max(0.0, away * away - depth * depth)) * edge[0] - depth * edge[1]
        share = min(1.0, 1.0 - aside / p.radius)
        if share > most and not _hidden(sensors, k, cones, room, planes, away - p.radius + p.margin):
            most = share
            if most >= 1.0:
                break
    return most


@compiled
def _hidden(
    sensors: Sensors, k: int, cones: Cones, room: tuple[_Placed, _Placed], planes: FloatArray, end: float
) -> bool:
    """Whether unit k has the arm or what stands around it in view nearer than `end` [m]."""
    wanted = Wanted(0.0, -np.inf, end, end)
    for placed in room:
        if capsule_return(sensors, k, placed.capsules, placed.spheres, cones, wanted) < end:
            return True
    return plane_return(sensors, k, planes, cones, end) < end
