"""Kinematics, approach rows and joint box in plain NumPy, vectorised over points: what a user of a peer would write.

Nothing of Pretouch is imported here, so an agreement with it means something.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from benchmarks.peers.problem import Terms

Array = Any


@dataclass(frozen=True)
class Arm:
    """An arm of n hinge joints, each about the z axis of its own frame, with C capsules on them."""

    mjcf: str
    """Path of the MJCF file it was read from."""
    placement: Array
    """(n, 4, 4) frame of each joint at zero in the frame of the joint before it, the base for the first."""
    tool: Array
    """(4, 4) the TCP in the frame of the last joint."""
    q_min: Array
    """(n,) [rad]"""
    q_max: Array
    """(n,) [rad]"""
    qd_max: Array
    """(n,) [rad/s]"""
    qdd_max: Array
    """(n,) [rad/s^2]"""
    joint: Array
    """(C,) integers: the joint whose frame each capsule is fixed to."""
    a: Array
    """(C, 3) one end of its axis, joint frame [m]."""
    b: Array
    """(C, 3) the other end [m]."""
    radius: Array
    """(C,) [m]."""


def frames_of(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Orientations (n, 3, 3) and origins (n, 3) [m] of the joint frames at q (n,) [rad], base frame."""
    n = len(q)
    rotation, origin, T = np.empty((n, 3, 3)), np.empty((n, 3)), np.eye(4)
    for j in range(n):
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(q[j]), -np.sin(q[j])], [np.sin(q[j]), np.cos(q[j])]]
        T = T @ arm.placement[j] @ turn
        rotation[j], origin[j] = T[:3, :3], T[:3, 3]
    return rotation, origin


def linear_jacobian(arm: Arm, rotation: Array, origin: Array) -> Array:
    """Jacobian (3, n) of the TCP's velocity in the base frame."""
    tcp = origin[-1] + rotation[-1] @ arm.tool[:3, 3]
    return np.cross(rotation[:, :, 2], tcp - origin).T


def damping(jacobian: Array, terms: "Terms") -> float:
    """Factor mu = lambda_0 (1 - w / w_0)^2 below the manipulability w_0, else zero."""
    w = np.sqrt(max(0.0, np.linalg.det(jacobian @ jacobian.T)))
    w_0 = terms.manipulability_threshold
    return terms.damping_max * (1.0 - w / w_0) ** 2 if w < w_0 else 0.0


def approach_rows(arm: Arm, rotation: Array, origin: Array, points: Array, terms: "Terms") -> tuple[Array, Array]:
    """Rows G (K, n) [m] and limits h (K,) [m/s] of eqs. 5-7: how fast the closest body point may approach."""
    frame, base = rotation[arm.joint], origin[arm.joint]
    a = base + np.einsum("cij,cj->ci", frame, arm.a)
    axis = np.einsum("cij,cj->ci", frame, arm.b - arm.a)
    to = points[:, None] - a
    along = np.clip(np.einsum("kci,ci->kc", to, axis) / np.einsum("ci,ci->c", axis, axis), 0.0, 1.0)
    gap = to - along[:, :, None] * axis
    from_axis = np.sqrt(np.einsum("kci,kci->kc", gap, gap))
    closest = np.argmin(from_axis - arm.radius, axis=1)
    k = np.arange(len(points))
    direction = gap[k, closest] / from_axis[k, closest, None]
    distance = from_axis[k, closest] - arm.radius[closest]
    body_point = points - distance[:, None] * direction
    # d . (z x r) = z . (r x d) for each joint that moves the point
    arms = body_point[:, None] - origin
    G = np.einsum("ji,kji->kj", rotation[:, :, 2], np.cross(arms, direction[:, None]))
    G[np.arange(len(origin)) > arm.joint[closest, None]] = 0.0
    return G, _approach_limit(distance, terms)


def _approach_limit(d: Array, t: "Terms") -> Array:
    repulse = t.v_max / (1.0 + np.exp(t.beta * (2.0 * d / t.d_crit - 1.0))) - t.v_max
    slow = t.v_max / (1.0 + np.exp(t.beta * (2.0 * (d - t.d_crit) / (t.d_notice - t.d_crit) - 1.0)))
    return np.where(d < t.d_notice, np.where(d < t.d_repulse, repulse, slow), np.inf)


def joint_box(arm: Arm, q: Array, qd: Array, period: float) -> tuple[Array, Array]:
    """Bounds (n,) [rad/s] that keep position, velocity and acceleration limits, for velocities held over a period."""
    up = np.minimum(arm.qd_max, _viable(arm.q_max - q, arm.qdd_max, period))
    down = -np.minimum(arm.qd_max, _viable(q - arm.q_min, arm.qdd_max, period))
    slowest, fastest = qd - arm.qdd_max * period, qd + arm.qdd_max * period
    return np.clip(down, slowest, fastest), np.clip(up, slowest, fastest)


def _viable(distance: Array, a: Array, period: float) -> Array:
    """Largest speed from which whole periods of braking still end before the limit."""
    d = np.maximum(distance, 0.0)
    steps = np.floor((np.sqrt(1.0 + 8.0 * d / (a * period**2)) - 1.0) / 2.0)
    return (d / period + a * period * steps * (steps + 1.0) / 2.0) / (steps + 1.0)
