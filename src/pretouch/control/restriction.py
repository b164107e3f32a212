"""Restricting the body's approach to obstacles: eqs. 5-7, as rows G qd <= h of the QP."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pretouch.params import RestrictionParams
from pretouch.robot.model import Kinematics
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles


@dataclass(frozen=True, slots=True)
class ApproachRows:
    """K rows of the QP: G @ qd <= h, softly or not."""

    G: FloatArray
    """(K, n) approach velocity of the closest body point per joint velocity [m]."""
    h: FloatArray
    """(K,) largest approach velocity [m/s]; negative asks for a retreat."""
    soft: bool
    """Whether a row may be violated at a cost."""


def _sigmoid(v_max: float, exponent: FloatArray) -> FloatArray:
    # beyond +-500 the result is 0 or v_max to the last digit, and exp does not overflow
    return v_max / (1.0 + np.exp(np.clip(exponent, -500.0, 500.0)))


def velocity_a(d: FloatArray, v_max: float, beta: float, d_crit: float) -> FloatArray:
    """V_a = V_max / (1 + exp(beta (2 d / d_crit - 1))) [m/s], eq. 5 of the paper. `d` [m] is from the surface."""
    return _sigmoid(v_max, beta * (2.0 * d / d_crit - 1.0))


def velocity_b(d: FloatArray, v_max: float, beta: float, d_crit: float, d_notice: float) -> FloatArray:
    """V_b = V_max / (1 + exp(beta (2 (d - d_crit) / (d_notice - d_crit) - 1))) [m/s], eq. 6 of the paper."""
    return _sigmoid(v_max, beta * (2.0 * (d - d_crit) / (d_notice - d_crit) - 1.0))


def approach_limit(d: FloatArray, params: RestrictionParams) -> FloatArray:
    """Largest approach velocity of the closest point (K,) [m/s], eq. 7 of the paper; infinite: no restriction.

    V_a - V_max below d_repulse, V_b from there to d_notice. `d` (K,) [m] is from the body's surface and may be
    negative. In mode floor the limit never lies below `floor_m_s`.
    """
    p = params
    repulse = velocity_a(d, p.v_max_m_s, p.beta, p.d_crit_m) - p.v_max_m_s
    slow = velocity_b(d, p.v_max_m_s, p.beta, p.d_crit_m, p.d_notice_m)
    limit = np.where(d < p.d_notice_m, np.where(d < p.d_repulse_m, repulse, slow), np.inf)
    return np.maximum(limit, p.floor_m_s) if p.mode == "floor" else limit


def approach_rows(
    kin: Kinematics, moved_by: BoolArray, obstacles: Obstacles, params: RestrictionParams
) -> tuple[ApproachRows, IntArray]:
    """Rows d^T J_c qd <= x_a for all obstacles within d_notice, and which obstacles (K',) they belong to.

    J_c is the Jacobian of the closest body point, d the direction from it to the obstacle; `moved_by` (L, n) says
    which joint moves which link.
    """
    if params.mode == "off" or len(obstacles.unit) == 0:
        return ApproachRows(np.zeros((0, len(kin.anchor))), np.zeros(0), soft=False), np.zeros(0, np.int64)
    soft = params.mode in ("slack", "floor")
    limit = approach_limit(obstacles.body_distance, params)
    which = np.flatnonzero(np.isfinite(limit))
    G = _rows(
        kin.anchor,
        kin.axis,
        moved_by,
        obstacles.link[which],
        obstacles.body_point[which],
        obstacles.direction[which],
    )
    return ApproachRows(G, limit[which], soft), which


@njit(cache=True)
def _rows(
    anchor: FloatArray,
    axis: FloatArray,
    moved_by: BoolArray,
    link: IntArray,
    point: FloatArray,
    direction: FloatArray,
) -> FloatArray:
    n = anchor.shape[0]
    G = np.zeros((len(link), n))
    for k in range(len(link)):
        d = direction[k]
        for j in range(n):
            if moved_by[link[k], j]:
                r = point[k] - anchor[j]
                z = axis[j]
                G[k, j] = (
                    d[0] * (z[1] * r[2] - z[2] * r[1])
                    + d[1] * (z[2] * r[0] - z[0] * r[2])
                    + d[2] * (z[0] * r[1] - z[1] * r[0])
                )
    return G
