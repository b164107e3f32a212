"""The problem of all contenders: snapshots of a moving arm with obstacle points round it.

The answer in each snapshot are the joint velocities qd that minimise

    1/2 |v - J qd|^2 + mu/2 |qd|^2 + k/2 |(q_mid - q) / t - qd|^2

within the joint box (position, velocity and acceleration limits) and one approach row G qd <= h a point (eqs. 5-7 of
the paper). The snapshots are on a smooth motion. Random points round the arm are used if their row allows the motion
itself with a margin, so every problem is feasible. Half of the points have the smallest margins, so it is barely so.

The code is plain NumPy, vectorised over points, as a user of a peer would write it. It imports nothing of Pretouch, so
its answers are an independent check.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

Array = Any
"""A NumPy array of float64, or of integers where so documented."""

PERIOD_S = 0.01
"""Time for which a joint velocity is constant [s]."""
MID_JOINT_GAIN, MID_JOINT_TIME_S = 0.001, 5.0
DAMPING_MAX, MANIPULABILITY = 0.01, 0.2
"""Damping and its threshold, high enough for damping in most snapshots."""
V_MAX_M_S, BETA = 0.04, -10.0
D_REPULSE_M, D_CRIT_M, D_NOTICE_M = 0.1, 0.1, 0.6
"""Parameters of the approach rows; they and those above are the values of Table I where the paper has one."""
MARGIN = 1e-4
"""Least margin of the motion to each row's limit [m/s]."""
_SPACING_S = 0.05
"""Time between two snapshots [s]."""
_SPEED = 0.2
"""Task velocity in addition to that of the motion [m/s]."""


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
    frames, T = [], np.eye(4)
    for placement, angle in zip(arm.placement, q, strict=True):
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        T = T @ placement @ turn
        frames.append(T)
    every = np.array(frames)
    return every[:, :3, :3], every[:, :3, 3]


def linear_jacobian(arm: Arm, rotation: Array, origin: Array) -> Array:
    """Jacobian (3, n) of the TCP's velocity in the base frame."""
    tcp = origin[-1] + rotation[-1] @ arm.tool[:3, 3]
    return np.cross(rotation[:, :, 2], tcp - origin).T


def damping(jacobian: Array) -> float:
    """Factor mu = lambda_0 (1 - w / w_0)^2 below the manipulability w_0, else zero."""
    w = np.sqrt(max(0.0, np.linalg.det(jacobian @ jacobian.T)))
    return DAMPING_MAX * (1.0 - w / MANIPULABILITY) ** 2 if w < MANIPULABILITY else 0.0


def approach_rows(arm: Arm, rotation: Array, origin: Array, points: Array) -> tuple[Array, Array]:
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
    return G, _approach_limit(distance)


def _approach_limit(d: Array) -> Array:
    repulse = V_MAX_M_S / (1.0 + np.exp(BETA * (2.0 * d / D_CRIT_M - 1.0))) - V_MAX_M_S
    slow = V_MAX_M_S / (1.0 + np.exp(BETA * (2.0 * (d - D_CRIT_M) / (D_NOTICE_M - D_CRIT_M) - 1.0)))
    return np.where(d < D_NOTICE_M, np.where(d < D_REPULSE_M, repulse, slow), np.inf)


def joint_box(arm: Arm, q: Array, qd: Array) -> tuple[Array, Array]:
    """Bounds (n,) [rad/s] that keep position, velocity and acceleration limits, for velocities held over a period."""
    up = np.minimum(arm.qd_max, _viable(arm.q_max - q, arm.qdd_max))
    down = -np.minimum(arm.qd_max, _viable(q - arm.q_min, arm.qdd_max))
    slowest, fastest = qd - arm.qdd_max * PERIOD_S, qd + arm.qdd_max * PERIOD_S
    return np.clip(down, slowest, fastest), np.clip(up, slowest, fastest)


def _viable(distance: Array, a: Array) -> Array:
    """Largest speed from which braking in whole periods ends before the limit."""
    d = np.maximum(distance, 0.0)
    steps = np.floor((np.sqrt(1.0 + 8.0 * d / (a * PERIOD_S**2)) - 1.0) / 2.0)
    return (d / PERIOD_S + a * PERIOD_S * steps * (steps + 1.0) / 2.0) / (steps + 1.0)


@dataclass(frozen=True)
class Problem:
    """S snapshots with K points each."""

    arm: Arm
    q: Array
    """(S, n) joint positions [rad]."""
    qd: Array
    """(S, n) last commanded joint velocities [rad/s]."""
    witness: Array
    """(S, n) feasible joint velocities: those of the motion one period later [rad/s]."""
    velocity: Array
    """(S, 3) desired velocity of the TCP [m/s]."""
    points: Array
    """(S, K, 3) obstacle points, base frame [m]."""

    def save(self, path: Path) -> None:
        """Write everything to one .npz file."""
        values = asdict(self)
        arm = {f"arm_{name}": value for name, value in values.pop("arm").items()}
        np.savez(path, **arm, **values)


def load(path: Path) -> Problem:
    """Read a problem that `Problem.save` wrote."""
    with np.load(path) as data:
        values = {name: data[name] for name in data.files}
    arm = {name.removeprefix("arm_"): values.pop(name) for name in list(values) if name.startswith("arm_")}
    return Problem(Arm(**arm | {"mjcf": str(arm["mjcf"])}), **values)


def generate(arm: Arm, q_ready: Array, snapshots: int, points: int, seed: int) -> Problem:
    """Draw S snapshots along a motion round `q_ready` (n,) [rad], the same ones for the same numbers.

    Every joint swings about its ready position at a pace of its own.
    """
    rng, of_motion, n = np.random.default_rng([seed, points]), np.random.default_rng(seed), len(q_ready)
    amplitude, pace = of_motion.uniform(0.2, 0.4, n), of_motion.uniform(0.4, 0.9, n)
    phase, time = of_motion.uniform(0.0, 2 * np.pi, n), _SPACING_S * np.arange(snapshots)
    q = q_ready + amplitude * np.sin(np.outer(time, pace) + phase)
    qd, witness = (amplitude * pace * np.cos(np.outer(at, pace) + phase) for at in (time, time + PERIOD_S))
    velocity, clouds = np.empty((snapshots, 3)), np.empty((snapshots, points, 3))
    for s in range(snapshots):
        rotation, origin = frames_of(arm, q[s])
        wish = np.array([np.sin(0.9 * time[s]), np.cos(0.7 * time[s]), np.sin(1.3 * time[s] + 1.0)])
        velocity[s] = linear_jacobian(arm, rotation, origin) @ witness[s] + _SPEED * wish / np.linalg.norm(wish)
        clouds[s] = _cloud(arm, rotation, origin, witness[s], points, rng)
    return Problem(arm, q, qd, witness, velocity, clouds)


def _cloud(arm: Arm, rotation: Array, origin: Array, witness: Array, points: int, rng: np.random.Generator) -> Array:
    """Return K points (K, 3) whose rows allow the motion: half with the smallest margins, half at random."""
    allowed, margins = np.empty((0, 3)), np.empty(0)
    while len(allowed) < 2 * points:
        drawn = _round_the_arm(arm, rotation, origin, 4 * points, rng)
        G, h = approach_rows(arm, rotation, origin, drawn)
        margin = h - G @ witness
        wide = margin >= MARGIN
        allowed, margins = np.concatenate([allowed, drawn[wide]]), np.concatenate([margins, margin[wide]])
    thin = np.argsort(margins)[: points // 2]
    others = np.setdiff1d(np.arange(len(allowed)), thin)[: points - len(thin)]
    return allowed[rng.permutation(np.concatenate([thin, others]))]


def _round_the_arm(arm: Arm, rotation: Array, origin: Array, count: int, rng: np.random.Generator) -> Array:
    """Points (N, 3) 0.06 to 0.4 m off a random capsule, in a random direction; never inside or beyond notice."""
    c = rng.integers(len(arm.radius), size=count)
    along = rng.uniform(size=(count, 1))
    foot = arm.a[c] * (1 - along) + arm.b[c] * along
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    j = arm.joint[c]
    drawn = origin[j] + np.einsum("kij,kj->ki", rotation[j], foot)
    drawn += direction * (arm.radius[c] + rng.uniform(0.06, 0.4, count))[:, None]
    _, h = approach_rows(arm, rotation, origin, drawn)
    # the limit falls with the distance: this leaves out what another capsule contains or has within 27 mm
    return drawn[np.isfinite(h) & (h > -0.99 * V_MAX_M_S)]
