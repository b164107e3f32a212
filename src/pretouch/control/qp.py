"""The quadratic program for joint velocities: the cost of eq. 2, and its rows."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.params import TaskParams
from pretouch.robot.kinematics import rotation_error
from pretouch.types import FloatArray, IntArray, Number


@compiled
def twist(velocity: FloatArray, rotation: FloatArray, goal: FloatArray, gain: float) -> FloatArray:
    """Task velocity (6,) [m/s, then rad/s] where the orientation R_O_ee (3, 3) is held, with a gain [1/s]."""
    error, both = rotation_error(rotation, goal), np.empty(6)
    for i in range(3):
        both[i], both[3 + i] = velocity[i], gain * error[i]
    return both


class Rows(NamedTuple):
    """Rows G qd <= h of the QP, or room for as many as there may be."""

    G: FloatArray
    """(R, n) approach velocity of the closest body point per joint velocity [m]."""
    h: FloatArray
    """(R,) largest approach velocity [m/s]; negative asks for a retreat."""
    which: IntArray
    """(K,) the obstacle that each of the first belongs to."""


class CostParams(NamedTuple):
    """What eq. 2 takes of `TaskParams`."""

    damping_max: float
    manipulability_threshold: float
    mid_joint_gain: float
    mid_joint_time_s: float


def cost_params(params: TaskParams) -> CostParams:
    """Return what eq. 2 takes of the parameters."""
    p = params
    return CostParams(p.damping_max, p.manipulability_threshold, p.mid_joint_gain, p.mid_joint_time_s)


@compiled
def manipulability(jacobian: FloatArray) -> float:
    """Yoshikawa's measure w = sqrt(det(J J^T)) of a Jacobian (m, n)."""
    # the volume its rows span, row by row: of the determinant rounding would leave half the digits near a singularity
    m, n = jacobian.shape
    rows, volume = jacobian.copy(), 1.0
    for i in range(m):
        height = 0.0
        for j in range(n):
            height += rows[i, j] * rows[i, j]
        volume *= np.sqrt(height)
        for k in range(i + 1, m):
            along = 0.0
            for j in range(n):
                along += rows[k, j] * rows[i, j]
            for j in range(n):
                # a row of no height depends on those before it, and the volume is 0 already
                rows[k, j] -= along * rows[i, j] / height if height > 0 else 0.0
    return volume


@kernel
def damping(w: float, damping_max: float, threshold: float) -> float:
    """Factor mu of eq. 2 after Nakamura and Hanafusa (1986): lambda_0 (1 - w / w_0)^2 below w_0, else zero."""
    return damping_max * (1.0 - w / threshold) ** 2 if w < threshold else 0.0


@kernel
def mid_joint_velocity(q: Number, q_mid: Number, time: float) -> Number:
    """Joint velocities qd_mid (n,) [rad/s] of eq. 2 that would reach the middle of the joint ranges in `time` [s]."""
    return (q_mid - q) / time


@compiled
def cost_into(
    J: FloatArray, x_d: FloatArray, q: FloatArray, q_mid: FloatArray, p: CostParams, H: FloatArray, f: FloatArray
) -> None:
    """Write H (n, n) and f (n,) of the cost g(qd) of eq. 2 of the paper, without its constant.

    1/2 |x_d - J qd|^2 + mu/2 |qd|^2 + k/2 |qd_mid - qd|^2, so H = J^T J + (mu + k) I, f = -J^T x_d - k qd_mid, with the
    Jacobian (m, n) of the task, its velocity x_d (m,) [m/s, then rad/s], and joint positions (n,) [rad].
    """
    # J^T J has no more rank than the task has rows, and mu is 0 away from singularities: it is k that makes H regular
    mu, k = damping(manipulability(J), p.damping_max, p.manipulability_threshold), p.mid_joint_gain
    for i in range(len(q)):
        f[i] = -k * mid_joint_velocity(q[i], q_mid[i], p.mid_joint_time_s)
        for m in range(len(x_d)):
            f[i] -= J[m, i] * x_d[m]
        for j in range(i + 1):
            H[i, j] = mu + k if i == j else 0.0
            # with the orientation held, 1 rad/s of error weighs as much as 1 m/s
            for m in range(len(x_d)):
                H[i, j] += J[m, i] * J[m, j]
            H[j, i] = H[i, j]
