"""The range of joint velocities that keeps position, velocity and acceleration limits, now and ever after."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pretouch.types import FloatArray


@dataclass(frozen=True)
class JointLimits:
    """Limits of n joints, and the period of the controller that must keep them."""

    q_min: FloatArray
    """(n,) [rad]"""
    q_max: FloatArray
    """(n,) [rad]"""
    qd_max: FloatArray
    """(n,) [rad/s]"""
    qdd_max: FloatArray
    """(n,) [rad/s^2]"""
    period: float
    """Time a joint velocity command is held [s]."""


@njit(cache=True)
def viable_speed(distance: FloatArray, acceleration: FloatArray, period: float) -> FloatArray:
    """Largest speed (n,) [rad/s] towards a limit at `distance` (n,) [rad] from which braking still ends before it.

    Exact for velocities held over a period: with x = d / (a dt^2) and n = floor((sqrt(1 + 8 x) - 1) / 2) whole
    steps of braking, v = (d / dt + a dt n (n + 1) / 2) / (n + 1). The usual sqrt(2 a d) breaks the limit. Zero at
    the limit and beyond it.
    """
    speed = np.empty(len(distance))
    for i in range(len(distance)):
        d, a = max(distance[i], 0.0), acceleration[i]
        steps = np.floor((np.sqrt(1.0 + 8.0 * d / (a * period**2)) - 1.0) / 2.0)
        speed[i] = (d / period + a * period * steps * (steps + 1.0) / 2.0) / (steps + 1.0)
    return speed


def joint_box(q: FloatArray, qd: FloatArray, limits: JointLimits) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bounds (n,) [rad/s] on the next joint velocity command; never empty.

    The box of velocity and position limits is met with what the acceleration allows from the last commanded
    velocity. From a state that is no longer viable acceleration wins: the joint brakes at its limit.

    Args:
        q: (n,) commanded joint positions, where the motion generator is [rad].
        qd: (n,) last commanded joint velocities [rad/s].
        limits: the limits.
    """
    return _box(q, qd, limits.q_min, limits.q_max, limits.qd_max, limits.qdd_max, limits.period)


@njit(cache=True)
def _box(
    q: FloatArray, qd: FloatArray, q_min: FloatArray, q_max: FloatArray, qd_max: FloatArray, qdd_max: FloatArray,
    period: float,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    reach = qdd_max * period
    up = np.minimum(qd_max, viable_speed(q_max - q, qdd_max, period))
    down = -np.minimum(qd_max, viable_speed(q - q_min, qdd_max, period))
    slowest, fastest = qd - reach, qd + reach
    return np.minimum(np.maximum(down, slowest), fastest), np.minimum(np.maximum(up, slowest), fastest)


def brake(qd: FloatArray, lower: FloatArray, upper: FloatArray, limits: JointLimits) -> FloatArray:
    """Joint velocities (n,) [rad/s] on the shortest way to rest from `qd` that stays inside the box.

    All joints slow by the same factor, so the hand keeps its course, unless the box asks one of them for less.
    """
    needed = float((np.abs(qd) / (limits.qdd_max * limits.period)).max())
    slower = qd * max(0.0, 1.0 - 1.0 / needed) if needed > 0 else qd
    return np.clip(slower, lower, upper)
