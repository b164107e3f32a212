"""Records that many compiled functions take, see `records`."""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.values import BoolArray, FloatArray, IntArray


class Arm(NamedTuple):
    """What moves what, of `RobotModel`. L links, n joints."""

    moved_by: Annotated[BoolArray, "L", "n"]
    """(L, n) whether a joint moves a link."""
    ee: int
    """Index of the end-effector's link."""


class Kinematics(NamedTuple):
    """Where everything is in one posture, base frame. L links (bodies of the MJCF, world first), n joints."""

    position: Annotated[FloatArray, "L", 3]
    """(L, 3) link origins [m]."""
    rotation: Annotated[FloatArray, "L", 3, 3]
    """(L, 3, 3) link orientations R_O_link."""
    anchor: Annotated[FloatArray, "n", 3]
    """(n, 3) a point on each joint's axis [m]."""
    axis: Annotated[FloatArray, "n", 3]
    """(n, 3) unit vectors of the joint axes."""


class Chain(NamedTuple):
    """The moving joints (n,) in one posture: what a point's Jacobian and its speed are made of."""

    anchor: FloatArray
    """(n, 3) a point on each axis [m]."""
    axis: FloatArray
    """(n, 3) its direction."""
    moved_by: BoolArray
    """(L, n) whether a joint moves a link."""
    qd: FloatArray
    """(n,) joint velocities [rad/s]."""


class Links(NamedTuple):
    """Masses and places of the links, of `RobotModel`."""

    mass: Annotated[FloatArray, "L"]
    """(L,) [kg]."""
    com: Annotated[FloatArray, "L", 3]
    """(L, 3) centre of mass, link frame [m]."""
    inertia: Annotated[FloatArray, "L", 3, 3]
    """(L, 3, 3) about it, axes of the link frame [kg m^2]."""
    parts: Annotated[IntArray, "P"]
    """(P,) links of the body that joints move."""
    middle: Annotated[FloatArray, "P", 3]
    """(P, 3) the middle of each one's capsules, link frame [m]."""


class Mechanism(NamedTuple):
    """An arm with its masses."""

    arm: Arm
    links: Links


class SurfaceArrays(NamedTuple):
    """N places on the arm, of `Surface`."""

    link: IntArray
    """(N,) link of each."""
    point: FloatArray
    """(N, 3) link frame [m]."""
    normal: FloatArray
    """(N, 3) outwards, link frame."""
    area: FloatArray
    """(N,) it stands for [m^2]."""
    body: IntArray
    """(N,) rigid body of each."""
    first: IntArray
    """(B + 1,) where the places of each rigid body begin, and N."""


class CapsuleArrays(NamedTuple):
    """C capsules on links, of `Capsules`; or placed in the base frame."""

    link: Annotated[IntArray, "C"]
    """(C,) link of each."""
    a: Annotated[FloatArray, "C", 3]
    """(C, 3) one end of the axis [m]."""
    b: Annotated[FloatArray, "C", 3]
    """(C, 3) other end of the axis [m]."""
    radius: Annotated[FloatArray, "C"]
    """(C,) [m]."""


class Sensors(NamedTuple):
    """K sensors, placed in the base frame."""

    position: FloatArray
    """(K, 3) [m]."""
    rotation: FloatArray
    """(K, 3, 3), z along the beam."""
    link: IntArray
    """(K,) link each sits on."""


class Cones(NamedTuple):
    """What K sensors of T kinds see: a cone about the axis of each."""

    kind: Annotated[IntArray, "K"]
    """(K,) which kind each is of."""
    edge: Annotated[FloatArray, "T", 3]
    """(T, 3) cosine, sine and tangent of half the angle."""
    range: Annotated[FloatArray, "T", 2]
    """(T, 2) nearest and farthest distance that is measured [m]."""
    rays: Annotated[FloatArray, "T", "R", 3]
    """(T, R, 3) unit vectors that fill the cone, sensor frame, the axis first."""
    spread: Annotated[FloatArray, "T"]
    """(T,) standard deviation of the direction a target lies in, beside what is not known of the unit's own [rad]."""


class SkinArrays(NamedTuple):
    """The K units of a `Skin`."""

    link: Annotated[IntArray, "K"]
    """(K,) link each sits on."""
    T_link_sensor: Annotated[FloatArray, "K", 4, 4]
    """(K, 4, 4)."""
    position_sigma: Annotated[FloatArray, "K"]
    """(K,) standard deviation of its position [m]."""
    orientation_sigma: Annotated[FloatArray, "K"]
    """(K,) standard deviation of its orientation [rad]."""
    cones: Cones
    """What each sees."""


class Obstacles(NamedTuple):
    """K sensed points, each with its closest point on the robot's body. Base frame."""

    unit: Annotated[IntArray, "K"]
    """(K,) index of the sensing unit in the skin; from their number on, of an outside point, then a moving fixture."""
    point: Annotated[FloatArray, "K", 3]
    """(K, 3) obstacle positions, eq. 1 [m]."""
    ee_distance: Annotated[FloatArray, "K"]
    """(K,) distance from the end-effector origin, less the spread, at least 0 [m] (eqs. 3, 11); inf: moving fixture."""
    body_point: Annotated[FloatArray, "K", 3]
    """(K, 3) closest points on the surface of the body [m]."""
    link: Annotated[IntArray, "K"]
    """(K,) index of the link that carries the closest point."""
    direction: Annotated[FloatArray, "K", 3]
    """(K, 3) unit vectors from body to obstacle, defined in penetration too."""
    body_distance: Annotated[FloatArray, "K"]
    """(K,) signed distance from the body's surface, less the point's spread [m] (eqs. 5-7)."""
    closing_speed: Annotated[FloatArray, "K"]
    """(K,) estimated speed of the object itself towards the closest body point [m/s]; 0 where it is not estimated."""


def no_obstacles(count: int = 0) -> Obstacles:
    """Return no obstacles, with room for so many."""
    of_each, points = np.zeros(count), np.zeros((count, 3))
    return Obstacles(
        np.zeros(count, np.int64), points, of_each, points.copy(), np.zeros(count, np.int64), points.copy(),
        of_each.copy(), of_each.copy(),
    )  # fmt: skip


@compiled
def first_of(obstacles: Obstacles, count: int) -> Obstacles:
    """Return the first of the obstacles, as views."""
    o = obstacles
    return Obstacles(
        o.unit[:count], o.point[:count], o.ee_distance[:count], o.body_point[:count], o.link[:count],
        o.direction[:count], o.body_distance[:count], o.closing_speed[:count],
    )  # fmt: skip
