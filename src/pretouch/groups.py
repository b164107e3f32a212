"""Groups of arguments that many compiled functions take; see `compiled.entry`.

Each holds fields of a class of the same purpose, under the same names, so that an object of that class can be given.
"""

from typing import NamedTuple

import numpy as np

from pretouch.types import BoolArray, FloatArray, IntArray


class Arm(NamedTuple):
    """What moves what, of `RobotModel`. L links, n joints."""

    moved_by: BoolArray
    """(L, n) whether a joint moves a link."""
    ee: int
    """Index of the end-effector's link."""


class Kinematics(NamedTuple):
    """Where everything is in one posture, base frame. L links (bodies of the MJCF, world first), n joints."""

    position: FloatArray
    """(L, 3) link origins [m]."""
    rotation: FloatArray
    """(L, 3, 3) link orientations R_O_link."""
    anchor: FloatArray
    """(n, 3) a point on each joint's axis [m]."""
    axis: FloatArray
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

    mass: FloatArray
    """(L,) [kg]."""
    com: FloatArray
    """(L, 3) centre of mass, link frame [m]."""
    inertia: FloatArray
    """(L, 3, 3) about it, axes of the link frame [kg m^2]."""
    parts: IntArray
    """(P,) links of the body that joints move."""
    middle: FloatArray
    """(P, 3) the middle of each one's capsules, link frame [m]."""


class Mechanism(NamedTuple):
    """An arm with its masses."""

    arm: Arm
    links: Links


class JointArrays(NamedTuple):
    """The joints (n,), of `RobotState`."""

    q: FloatArray
    """Measured positions [rad]."""
    qd: FloatArray
    """Measured velocities [rad/s]."""
    q_commanded: FloatArray
    """Positions the motion generator is at [rad]."""
    qd_commanded: FloatArray
    """Velocities the motion generator is at [rad/s]."""


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

    link: IntArray
    """(C,) link of each."""
    a: FloatArray
    """(C, 3) one end of the axis [m]."""
    b: FloatArray
    """(C, 3) other end of the axis [m]."""
    radius: FloatArray
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

    kind: IntArray
    """(K,) which kind each is of."""
    edge: FloatArray
    """(T, 3) cosine, sine and tangent of half the angle."""
    range: FloatArray
    """(T, 2) nearest and farthest distance that is measured [m]."""
    rays: FloatArray
    """(T, R, 3) unit vectors that fill the cone, sensor frame, the axis first."""
    spread: FloatArray
    """(T,) standard deviation of the direction a target lies in, beside what is not known of the unit's own [rad]."""


class SkinArrays(NamedTuple):
    """The K units of a `Skin`."""

    link: IntArray
    """(K,) link each sits on."""
    T_link_sensor: FloatArray
    """(K, 4, 4)."""
    position_sigma: FloatArray
    """(K,) standard deviation of its position [m]."""
    orientation_sigma: FloatArray
    """(K,) standard deviation of its orientation [rad]."""
    cones: Cones
    """What each sees."""


class NearArrays(NamedTuple):
    """Where the body has something near, of `Obstacles`."""

    link: IntArray
    """(K,) link that is closest."""
    body_point: FloatArray
    """(K, 3) closest point on it [m]."""
    direction: FloatArray
    """(K, 3) unit vectors from there to the obstacle."""
    body_distance: FloatArray
    """(K,) between them [m]."""


class ObstacleArrays(NamedTuple):
    """What the body has near, of `Obstacles`."""

    unit: IntArray
    """(K,) index of the unit that shows each."""
    link: IntArray
    """(K,) link that is closest."""
    body_point: FloatArray
    """(K, 3) closest point on it [m]."""
    direction: FloatArray
    """(K, 3) unit vectors from there to the obstacle."""
    body_distance: FloatArray
    """(K,) between them [m]."""
    closing_speed: FloatArray
    """(K,) speed of the object itself towards the body [m/s]."""


NOTHING_NEAR = ObstacleArrays(
    np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0)
)
