"""The problem every contender is given: snapshots of a moving arm with obstacle points round it.

In each snapshot the joint velocities qd are sought that minimise

    1/2 |v - J qd|^2 + mu/2 |qd|^2 + k/2 |(q_mid - q) / t - qd|^2

within the joint box (position, velocity and acceleration limits) and one approach row G qd <= h a point (eqs. 5-7 of
the paper). The snapshots lie on a smooth motion. Points are drawn round the arm and kept if the motion itself, with a
margin, is allowed by their row: every problem is feasible by construction, and thinly so, because half of the points
are those with the smallest margins.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.peers.geometry import Arm, approach_rows, frames_of, linear_jacobian

Array = Any
"""A NumPy array of float64, or of integers where said."""


@dataclass(frozen=True)
class Terms:
    """Weights and limits of the problem; the values of Table I where the paper has one."""

    period: float = 0.01
    """Time a joint velocity is held [s]."""
    mid_joint_gain: float = 0.001
    mid_joint_time: float = 5.0
    """[s]"""
    damping_max: float = 0.01
    manipulability_threshold: float = 0.2
    """High, so that the damping is at work in most snapshots."""
    v_max: float = 0.04
    """[m/s]"""
    beta: float = -10.0
    d_repulse: float = 0.1
    """[m]"""
    d_crit: float = 0.1
    """[m]"""
    d_notice: float = 0.6
    """[m]"""


TERMS = Terms()
MARGIN = 1e-4
"""By how much the motion keeps below each row's limit at least [m/s]."""
_SPACING = 0.05
"""Time between two snapshots [s]."""
_SPEED = 0.2
"""Task velocity asked for beside that of the motion [m/s]."""


@dataclass(frozen=True)
class Problem:
    """S snapshots with K points each."""

    arm: Arm
    q: Array
    """(S, n) joint positions [rad]."""
    qd: Array
    """(S, n) last commanded joint velocities [rad/s]."""
    witness: Array
    """(S, n) joint velocities that are allowed: those of the motion one period later [rad/s]."""
    velocity: Array
    """(S, 3) velocity asked of the TCP [m/s]."""
    points: Array
    """(S, K, 3) obstacle points, base frame [m]."""

    def save(self, path: Path) -> None:
        """Write everything to one .npz file."""
        arm = {f"arm_{name}": value for name, value in asdict(self.arm).items()}
        own = {name: getattr(self, name) for name in ("q", "qd", "witness", "velocity", "points")}
        np.savez(path, **arm, **own)


def load(path: Path) -> Problem:
    """Read a problem that `Problem.save` wrote."""
    with np.load(path) as data:
        values = {name: data[name] for name in data.files}
    arm = {name.removeprefix("arm_"): values.pop(name) for name in list(values) if name.startswith("arm_")}
    arm["mjcf"] = str(arm["mjcf"])
    return Problem(Arm(**arm), **values)


def generate(arm: Arm, q_ready: Array, snapshots: int, points: int, seed: int) -> Problem:
    """Draw S snapshots along a motion round `q_ready` (n,) [rad], the same ones for the same numbers."""
    rng = np.random.default_rng([seed, points])
    motion = _Motion(q_ready, np.random.default_rng(seed))
    time = _SPACING * np.arange(snapshots)
    q, qd, witness = motion.position(time), motion.velocity(time), motion.velocity(time + TERMS.period)
    velocity, clouds = np.empty((snapshots, 3)), np.empty((snapshots, points, 3))
    for s in range(snapshots):
        rotation, origin = frames_of(arm, q[s])
        wish = np.array([np.sin(0.9 * time[s]), np.cos(0.7 * time[s]), np.sin(1.3 * time[s] + 1.0)])
        velocity[s] = linear_jacobian(arm, rotation, origin) @ witness[s] + _SPEED * wish / np.linalg.norm(wish)
        clouds[s] = _cloud(arm, rotation, origin, witness[s], points, rng)
    return Problem(arm, q, qd, witness, velocity, clouds)


class _Motion:
    """Every joint swings about its ready position at a pace of its own."""

    def __init__(self, q_ready: Array, rng: np.random.Generator) -> None:
        n = len(q_ready)
        self.middle = q_ready
        self.amplitude, self.pace = rng.uniform(0.2, 0.4, n), rng.uniform(0.4, 0.9, n)
        self.phase = rng.uniform(0.0, 2 * np.pi, n)

    def position(self, time: Array) -> Array:
        """(S, n) [rad]."""
        return self.middle + self.amplitude * np.sin(np.outer(time, self.pace) + self.phase)

    def velocity(self, time: Array) -> Array:
        """(S, n) [rad/s]."""
        return self.amplitude * self.pace * np.cos(np.outer(time, self.pace) + self.phase)


def _cloud(arm: Arm, rotation: Array, origin: Array, witness: Array, points: int, rng: np.random.Generator) -> Array:
    """K points (K, 3) whose rows the witness keeps: half of them with the smallest margins, the others as drawn."""
    kept, margins = np.empty((0, 3)), np.empty(0)
    while len(kept) < 2 * points:
        drawn = _round_the_arm(arm, rotation, origin, 4 * points, rng)
        G, h = approach_rows(arm, rotation, origin, drawn, TERMS)
        margin = h - G @ witness
        allowed = margin >= MARGIN
        kept, margins = np.concatenate([kept, drawn[allowed]]), np.concatenate([margins, margin[allowed]])
    thin = np.argsort(margins)[: points // 2]
    others = np.setdiff1d(np.arange(len(kept)), thin)[: points - len(thin)]
    return kept[rng.permutation(np.concatenate([thin, others]))]


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
    _, h = approach_rows(arm, rotation, origin, drawn, TERMS)
    # the limit falls with the distance: this leaves out what another capsule contains or has within 27 mm
    return drawn[np.isfinite(h) & (h > -0.99 * TERMS.v_max)]
