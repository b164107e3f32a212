"""Kinematics of chains of hinges, which may branch: poses, Jacobians, the mass matrix, and velocities of points."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.types import BoolArray, FloatArray, IntArray

G_M_S2 = 9.81
"""Acceleration by gravity, MuJoCo's default [m/s^2]."""


class Hinges(NamedTuple):
    """Tree of the links: each link is fixed to its parent by its joints, in the order of q."""

    parent: Annotated[IntArray, "L"]
    """(L,) parent of each link, with a smaller index; that of the world is 0."""
    first: Annotated[IntArray, "L + 1"]
    """(L + 1,) index of the first joint of each link, and n."""
    T_parent_link: Annotated[FloatArray, "L", 3, 4]
    """(L, 3, 4) rotation and origin [m] of each link in its parent's frame, with its joints at rest."""
    joint: Annotated[FloatArray, "n", 7]
    """(n, 7) of each joint a point on its axis [m] and the axis, frame of its link, and q at rest [rad]."""


class ArmTopology(NamedTuple):
    """Joints that move each link, of `RobotModel`. L links, n joints."""

    moved_by: Annotated[BoolArray, "L", "n"]
    """(L, n) whether a joint moves a link."""
    ee: int
    """Index of the end-effector's link."""


class Links(NamedTuple):
    """Masses and centres of the links, of `RobotModel`."""

    mass: Annotated[FloatArray, "L"]
    """(L,) [kg]."""
    com: Annotated[FloatArray, "L", 3]
    """(L, 3) centre of mass, link frame [m]."""
    inertia: Annotated[FloatArray, "L", 3, 3]
    """(L, 3, 3) about it, axes of the link frame [kg m^2]."""
    parts: Annotated[IntArray, "P"]
    """(P,) links of the body that joints move."""
    middle: Annotated[FloatArray, "P", 3]
    """(P, 3) centre of the capsules of each, link frame [m]."""


class Mechanism(NamedTuple):
    """An arm with its masses."""

    arm: ArmTopology
    links: Links
    upright: Annotated[FloatArray, 3, 3]
    """(3, 3) turns vectors of the base frame into one whose z points against gravity: unity for an arm that stands."""


class Kinematics(NamedTuple):
    """Poses of links and joint axes in one posture, base frame. L links (bodies of the MJCF, world first), n joints."""

    position: Annotated[FloatArray, "L", 3]
    """(L, 3) link origins [m]."""
    rotation: Annotated[FloatArray, "L", 3, 3]
    """(L, 3, 3) link orientations R_O_link."""
    anchor: Annotated[FloatArray, "n", 3]
    """(n, 3) a point on each joint's axis [m]."""
    axis: Annotated[FloatArray, "n", 3]
    """(n, 3) unit vectors of the joint axes."""


class Chain(NamedTuple):
    """The moving joints (n,) in one posture, for Jacobians and velocities of points."""

    anchor: FloatArray
    """(n, 3) a point on each axis [m]."""
    axis: FloatArray
    """(n, 3) its direction."""
    moved_by: BoolArray
    """(L, n) whether a joint moves a link."""
    qd: FloatArray
    """(n,) joint velocities [rad/s]."""


@compiled
def place(hinges: Hinges, q: FloatArray, kin: Kinematics) -> None:
    """Write poses and joint axes at joint positions q (n,) [rad] to `kin`."""
    parent, first, T, joint = hinges.parent, hinges.first, hinges.T_parent_link, hinges.joint
    position, rotation, anchor, axis = kin.position, kin.rotation, kin.anchor, kin.axis
    for i in range(3):
        position[0, i] = 0.0
        for k in range(3):
            rotation[0, i, k] = 1.0 if i == k else 0.0
    for m in range(1, len(parent)):
        p = parent[m]
        for i in range(3):  # T_O_link = T_O_parent T_parent_link, row by row
            a, b, c = rotation[p, i, 0], rotation[p, i, 1], rotation[p, i, 2]
            for k in range(3):
                rotation[m, i, k] = a * T[m, 0, k] + b * T[m, 1, k] + c * T[m, 2, k]
            position[m, i] = position[p, i] + a * T[m, 0, 3] + b * T[m, 1, 3] + c * T[m, 2, 3]
        for j in range(first[m], first[m + 1]):
            x, y, z = joint[j, 0], joint[j, 1], joint[j, 2]
            u, v, w = joint[j, 3], joint[j, 4], joint[j, 5]
            angle = q[j] - joint[j, 6]
            sine, cosine = math.sin(angle), math.cos(angle)
            for i in range(3):
                a, b, c = rotation[m, i, 0], rotation[m, i, 1], rotation[m, i, 2]
                along = a * u + b * v + c * w
                axis[j, i] = along
                anchor[j, i] = position[m, i] + a * x + b * y + c * z
                # Rodrigues: a row r of R becomes cos r + (1 - cos) (r u) u^T + sin r x u
                along *= 1.0 - cosine
                rotation[m, i, 0] = cosine * a + along * u + sine * (b * w - c * v)
                rotation[m, i, 1] = cosine * b + along * v + sine * (c * u - a * w)
                rotation[m, i, 2] = cosine * c + along * w + sine * (a * v - b * u)
                # the axis stays where it is
                a, b, c = rotation[m, i, 0], rotation[m, i, 1], rotation[m, i, 2]
                position[m, i] = anchor[j, i] - a * x - b * y - c * z


@kernel
def column(anchor: FloatArray, axis: FloatArray, j: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Velocity a_j x (p - p_j) [m/s] of a point p = (x, y, z) [m] that hinge j moves at 1 rad/s."""
    x, y, z = x - anchor[j, 0], y - anchor[j, 1], z - anchor[j, 2]
    return axis[j, 1] * z - axis[j, 2] * y, axis[j, 2] * x - axis[j, 0] * z, axis[j, 0] * y - axis[j, 1] * x


@kernel
def point_velocity(chain: Chain, link: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Velocity [m/s] of a point (x, y, z) [m] of a link, base frame."""
    u, v, w = 0.0, 0.0, 0.0
    for j in range(len(chain.qd)):
        if chain.moved_by[link, j]:
            a, b, c = column(chain.anchor, chain.axis, j, x, y, z)
            u, v, w = u + a * chain.qd[j], v + b * chain.qd[j], w + c * chain.qd[j]
    return u, v, w


@kernel
def row_along(chain: Chain, link: int, point: FloatArray, along: FloatArray, row: FloatArray) -> float:
    """Write the row along^T J (n,) of a point (3,) of a link, and return the speed along it [m/s]."""
    speed = 0.0
    for j in range(len(row)):
        row[j] = 0.0
        if chain.moved_by[link, j]:
            x, y, z = column(chain.anchor, chain.axis, j, point[0], point[1], point[2])
            row[j] = along[0] * x + along[1] * y + along[2] * z
            speed += row[j] * chain.qd[j]
    return speed


@compiled
def jacobian_into(
    anchor: FloatArray, axis: FloatArray, moved: BoolArray, point: FloatArray, jacobian: FloatArray
) -> None:
    """Write the Jacobian (6, n) of `RobotModel.jacobian`; `moved` (n,) marks the joints that move the link."""
    for j in range(len(anchor)):
        for i in range(6):
            jacobian[i, j] = 0.0
        if moved[j]:
            jacobian[0, j], jacobian[1, j], jacobian[2, j] = column(anchor, axis, j, point[0], point[1], point[2])
            jacobian[3, j], jacobian[4, j], jacobian[5, j] = axis[j, 0], axis[j, 1], axis[j, 2]


@compiled
def mass_matrix_into(kin: Kinematics, mechanism: Mechanism, M: FloatArray) -> None:
    """Write M = sum of m Jv^T Jv + Jw^T I Jw over the links (n, n) [kg m^2].

    Jv (3, n) is the Jacobian of a link's centre of mass and Jw that of its angular velocity.
    """
    position, rotation, anchor, axis = kin
    moved_by = mechanism.arm.moved_by
    mass, com, inertia = mechanism.links.mass, mechanism.links.com, mechanism.links.inertia
    n = len(anchor)
    V, H, turned = np.empty((n, 3)), np.empty((n, 3)), np.empty((3, 3))
    c, RI = np.empty(3), np.empty((3, 3))
    M[:] = 0.0
    for m in range(len(mass)):
        if mass[m] <= 0.0 or sum(moved_by[m]) == 0:
            continue
        R = rotation[m]
        for i in range(3):
            c[i] = position[m, i]
            for j in range(3):
                c[i] += R[i, j] * com[m, j]
                RI[i, j] = R[i, 0] * inertia[m, 0, j] + R[i, 1] * inertia[m, 1, j] + R[i, 2] * inertia[m, 2, j]
        for i in range(3):
            for j in range(3):
                turned[i, j] = RI[i, 0] * R[j, 0] + RI[i, 1] * R[j, 1] + RI[i, 2] * R[j, 2]
        for j in range(n):
            if not moved_by[m, j]:
                continue
            V[j, 0], V[j, 1], V[j, 2] = column(anchor, axis, j, c[0], c[1], c[2])
            for i in range(3):
                H[j, i] = turned[i, 0] * axis[j, 0] + turned[i, 1] * axis[j, 1] + turned[i, 2] * axis[j, 2]
            for k in range(j + 1):
                if moved_by[m, k]:
                    M[j, k] += mass[m] * (V[j, 0] * V[k, 0] + V[j, 1] * V[k, 1] + V[j, 2] * V[k, 2])
                    M[j, k] += H[j, 0] * axis[k, 0] + H[j, 1] * axis[k, 1] + H[j, 2] * axis[k, 2]
    for j in range(n):
        for k in range(j):
            M[k, j] = M[j, k]


@kernel
def rotate(R: FloatArray, v: FloatArray, out: FloatArray) -> None:
    """Write R @ v of a matrix (3, 3) and a vector (3,) to `out` (3,), which is another array."""
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]


@kernel
def dot(a: FloatArray, b: FloatArray) -> float:
    """Scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def separation(points: FloatArray, m: int, other: FloatArray) -> float:
    """Return the distance [m] of point m of (M, 3) from another point (3,)."""
    x, y, z = points[m, 0] - other[0], points[m, 1] - other[1], points[m, 2] - other[2]
    return np.sqrt(x * x + y * y + z * z)


@compiled
def tangents_of(normal: FloatArray, tangents: FloatArray) -> None:
    """Write two unit vectors (2, 3) across a unit vector (3,) and across each other."""
    x, y, z = normal[0], normal[1], normal[2]
    # across the base axis that is least along the normal, so that it never vanishes
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        u, v, w = 0.0, z, -y
    elif abs(y) <= abs(z):
        u, v, w = -z, 0.0, x
    else:
        u, v, w = y, -x, 0.0
    size = np.sqrt(u * u + v * v + w * w)
    u, v, w = u / size, v / size, w / size
    tangents[0, 0], tangents[0, 1], tangents[0, 2] = u, v, w
    tangents[1, 0], tangents[1, 1], tangents[1, 2] = y * w - z * v, z * u - x * w, x * v - y * u


@compiled
def below(numbers: FloatArray, bound: float) -> bool:
    """Return whether all numbers (k,) are smaller than a bound in size; NaN is not."""
    for number in numbers:  # noqa: SIM110  compiled code knows no generators
        if not abs(number) < bound:
            return False
    return True


@compiled
def rotation_error(rotation: FloatArray, goal: FloatArray) -> FloatArray:
    """Rotation from one orientation to the other (3,): the unit axis times the sine of the angle, base frame."""
    error = np.zeros(3)
    # Half the sum of the cross products of corresponding axes. The sine falls again beyond a right angle and is 0 for a
    # half turn: it serves to hold an orientation, not to turn to a distant one.
    for i in range(3):
        x, y, z = rotation[0, i], rotation[1, i], rotation[2, i]
        error[0] += 0.5 * (y * goal[2, i] - z * goal[1, i])
        error[1] += 0.5 * (z * goal[0, i] - x * goal[2, i])
        error[2] += 0.5 * (x * goal[1, i] - y * goal[0, i])
    return error
