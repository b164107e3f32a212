"""Restricting the body's approach to obstacles: eqs. 5-7 as rows G qd <= h of the QP, or the braking curve."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.control.braking import BrakingLimits
from pretouch.control.interface import Restriction
from pretouch.control.qp import Rows
from pretouch.params import BrakingParams, RestrictionParams
from pretouch.robot.kinematics import Kinematics, column
from pretouch.types import BoolArray, FloatArray, Number, Obstacles


@kernel
def _sigmoid(v_max: float, exponent: Number) -> Number:
    # beyond +-500 the result is 0 or v_max to the last digit, and exp does not overflow
    return v_max / (1.0 + np.exp(np.minimum(np.maximum(exponent, -500.0), 500.0)))


@kernel
def velocity_a(d: Number, v_max: float, beta: float, d_crit: float) -> Number:
    """V_a = V_max / (1 + exp(beta (2 d / d_crit - 1))) [m/s], eq. 5 of the paper. `d` [m] is from the surface."""
    return _sigmoid(v_max, beta * (2.0 * d / d_crit - 1.0))  # beta < 0: from about 0 at the surface to V_max at d_crit


@kernel
def velocity_b(d: Number, v_max: float, beta: float, d_crit: float, d_notice: float) -> Number:
    """V_b = V_max / (1 + exp(beta (2 (d - d_crit) / (d_notice - d_crit) - 1))) [m/s], eq. 6 of the paper."""
    return _sigmoid(v_max, beta * (2.0 * (d - d_crit) / (d_notice - d_crit) - 1.0))


def approach_limit(d: FloatArray, params: RestrictionParams) -> FloatArray:
    """Largest approach velocity of the closest point (K,) [m/s], eq. 7 of the paper; infinite: no restriction.

    V_a - V_max below d_repulse, V_b from there to d_notice. `d` (K,) [m] is from the body's surface and may be
    negative. With rows=floor the limit never lies below `floor_m_s`.
    """
    p = approach_params(params)
    return np.array([_limit(one, p) for one in d], dtype=np.float64)


class ApproachParams(NamedTuple):
    """What eqs. 5-7 take of `RestrictionParams`."""

    v_max_m_s: float
    beta: float
    d_crit_m: float
    d_repulse_m: float
    d_notice_m: float
    least_m_s: float
    """Limit no row falls below, -inf for none [m/s]."""


def approach_params(params: RestrictionParams) -> ApproachParams:
    """Return what eqs. 5-7 take of the parameters."""
    p = params
    least = p.floor_m_s if p.rows == "floor" else -np.inf
    return ApproachParams(p.v_max_m_s, p.beta, p.d_crit_m, p.d_repulse_m, p.d_notice_m, least)


@compiled
def _limit(d: float, p: ApproachParams) -> float:
    if not d < p.d_notice_m:
        return np.inf  # dropped, not eased: just below, V_b allows V_max
    if d < p.d_repulse_m:
        # never positive: the point has to retreat, at V_max in penetration; with floor it may come on all the same
        return max(velocity_a(d, p.v_max_m_s, p.beta, p.d_crit_m) - p.v_max_m_s, p.least_m_s)
    # both cases meet near 0 only if d_repulse is d_crit, as in Table I; otherwise the limit jumps between them
    return max(velocity_b(d, p.v_max_m_s, p.beta, p.d_crit_m, p.d_notice_m), p.least_m_s)


def approach_rows(kin: Kinematics, moved_by: BoolArray, obstacles: Obstacles, params: RestrictionParams) -> Rows:
    """Rows d^T J_c qd <= x_a for all obstacles within d_notice.

    J_c is the Jacobian of the closest body point, d the direction from it to the obstacle; `moved_by` (L, n) says
    which joint moves which link.
    """
    n, count = len(kin.anchor), len(obstacles.unit)
    rows = Rows(np.empty((count, n)), np.empty(count), np.empty(count, np.int64))
    found = rows_into(kin, moved_by, obstacles, approach_params(params), rows)
    return Rows._make(part[:found] for part in rows)


@compiled
def rows_into(kin: Kinematics, moved_by: BoolArray, near: Obstacles, p: ApproachParams, rows: Rows) -> int:
    """Write the rows of `approach_rows` and the indices of their obstacles; return how many."""
    anchor, axis = kin.anchor, kin.axis
    link, point, direction = near.link, near.body_point, near.direction
    G, h, which = rows.G, rows.h, rows.which
    found = 0
    for k in range(len(link)):
        limit = _limit(near.body_distance[k], p)
        if limit == np.inf:
            continue
        h[found], which[found] = limit, k
        dx, dy, dz = direction[k, 0], direction[k, 1], direction[k, 2]
        for j in range(len(anchor)):
            G[found, j] = 0.0
            if moved_by[link[k], j]:
                # d . (a x (p - p_j)), column j of d^T J_c: all joints are hinges
                x, y, z = column(anchor, axis, j, point[k, 0], point[k, 1], point[k, 2])
                G[found, j] = dx * x + dy * y + dz * z
        found += 1
    return found


@dataclass(frozen=True)
class ApproachRestriction(RestrictionParams, Restriction, name="paper"):
    """Restricting the body's approach to obstacles, as in the paper (eqs. 5-7); compiled in `line`."""


def of_table_i(part: Restriction | None) -> ApproachRestriction:
    """Return a profile's restriction if it is of eqs. 5-7, else one with the values of Table I."""
    return part if isinstance(part, ApproachRestriction) else ApproachRestriction()


def notice_m(part: Restriction | None) -> float:
    """Return from which body distance on a restriction allows everything [m]: its own, or Table I's."""
    return float(getattr(part, "d_notice_m", ApproachRestriction.d_notice_m))


@dataclass(frozen=True)
class BrakingCurve(BrakingParams, Restriction, name="braking"):
    """How fast the body may come near, so that it could stop, or touch gently; compiled in `line`."""


def braking_limits(p: BrakingParams, speed: float, period: float) -> BrakingLimits:
    """Return what compiled code takes of the parameters, the task's speed [m/s], and the control period [s]."""
    across = p.tangential
    return BrakingLimits(
        p.d_notice_m, p.deceleration_m_s2, p.latency_s, p.margin_m, p.retreat_max_m_s,
        # what is switched off never binds: no distance is below -inf
        -np.inf if across is None else across.distance_m, 0.0 if across is None else across.speed_m_s, speed,
        p.tighten_m_s2, p.loosen_m_s2, period,
    )  # fmt: skip
