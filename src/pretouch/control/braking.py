"""The braking curve: the approach speed from which the arm can still stop, or touch gently.

Along the normal the closing speed v, the object's own included, keeps v <= sqrt(v_c^2 + 2 a max(0, d - v tau - m)):
the arm can brake at a to the touch speed v_c before it reaches the object, with a latency tau and a margin m. What was
seen lately is not touched at all: there v_c is 0, and within the margin the arm goes back. Each obstacle has a slot
with a row G qd <= h for that. A row starts at the speed of the arm, tightens at one rate and loosens at another, also
when its object has gone; so no row changes the command by a step. The exception is an object so near that the arm could
not slow down at that rate: there it brakes as hard as its joints may.
"""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, inlined, kernel
from pretouch.control.approach import ConstraintRows
from pretouch.params.pretouch import BrakingParams, Tangential
from pretouch.records import zeros
from pretouch.robot.kinematics import Chain, row_along, tangents_of
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles

_TANGENTS = 4  # two directions across the normal, both ways along each
_MOST_ROWS = 1 + _TANGENTS
"""Rows of a slot: along the normal and across it."""
_AT_ONCE_M = 0.02
"""Distance from the margin of an untouched object below which the limit holds at once [m]: the arm is slow there."""
_BACK_1_S = 4.0
"""Speed back to the margin of an untouched object for each metre within it [1/s]."""


class Slots(NamedTuple):
    """Memory of the rows of S slots."""

    link: Annotated[IntArray, "S"]
    """(S,) link of the row, -1 for none."""
    limit: Annotated[FloatArray, "S"]
    """(S,) largest closing speed along the normal [m/s]."""
    across: Annotated[FloatArray, "S"]
    """(S,) largest speed across it [m/s]."""
    normal: Annotated[FloatArray, "S", 3]
    """(S, 3) from the body to the obstacle."""
    point: Annotated[FloatArray, "S", 3]
    """(S, 3) on the body [m]."""


def slots_init(count: int) -> Slots:
    """Return slots without a row."""
    return zeros(Slots, S=count)._replace(link=np.full(count, -1, np.int64))


class BrakingNumbers(NamedTuple):
    """Numbers of the braking curve, from parameters and limits."""

    curve: BrakingParams
    deadband_m_s: float
    """Closing speed of an object below which it counts as still [m/s]; infinite: its speed does not count."""
    across: Tangential
    """Restriction of the motion across the normal; a distance of -inf stands for none."""
    fastest_m_s: float
    """Speed above which nothing is restricted [m/s]."""
    period_s: float


def braking_numbers(params: BrakingParams, speed: float, period: float) -> BrakingNumbers:
    """Return the numbers for compiled code, with the task's speed [m/s] and the control period [s]."""
    deadband, across = params.closing_deadband_m_s, (params.tangential or Tangential()).numbers
    if params.tangential is None:
        across = across._replace(distance_m=-np.inf)  # no distance is below that
    still = np.inf if deadband is None else deadband
    return BrakingNumbers(params.numbers, still, across, speed, period)


@compiled
def braking_cap(distance: float, touch: float, deceleration: float, latency: float, margin: float) -> float:
    """Largest closing speed v [m/s] with v = sqrt(v_c^2 + 2 a max(0, d - v tau - m)): the curve solved for v.

    `distance` d [m] may be negative, where v is the touch speed v_c.
    """
    left, lag = distance - margin, deceleration * latency
    if left <= touch * latency:
        return touch  # max(0, ...) is 0 here; both branches meet at v_c
    # the positive root of v^2 + 2 a tau v = v_c^2 + 2 a (d - m)
    return np.sqrt(lag * lag + touch * touch + 2.0 * deceleration * left) - lag


@inlined
def braking_rows(
    p: BrakingNumbers, slots: Slots, near: Obstacles, chain: Chain, touch: tuple[float, float, int, float, float]
) -> ConstraintRows:
    """Update `slots` by one period, and return rows.

    The first rows belong to the obstacles; then come the fading ones, then those across the normals.

    Args:
        p: parameters.
        slots: rows so far.
        near: M obstacles.
        chain: joints that move the points.
        touch: touch speed, closing speed of an object below which it counts as still [m/s], `Obstacles.slot` from
            which obstacles must not be touched at any speed, age of a look up to which others must not, and age from
            which they do not count [s].
    """
    places, s, distance = len(slots.link), p.curve, near.body_distance
    touch_speed, deadband, fixtures, young, old = touch
    most, which, present, count = _MOST_ROWS * places, np.empty(places, np.int64), np.zeros(places, np.bool_), 0
    rows = ConstraintRows(np.empty((most, len(chain.qd))), np.empty(most), which, s.slack_weight)
    for m in range(len(near.unit)):
        k = near.slot[m]
        if not (distance[m] < s.d_notice_m and near.age[m] < old):
            continue  # counts as absent: its row fades below
        present[k] = True
        if slots.link[k] != near.link[m]:
            # infinite, so that `_eased` starts at the speed of the arm
            slots.link[k], slots.limit[k], slots.across[k] = near.link[m], np.inf, np.inf
        for i in range(3):
            slots.normal[k, i], slots.point[k, i] = near.direction[m, i], near.body_point[m, i]
        row = rows.G[count]
        approach = row_along(chain, slots.link[k], slots.point[k], near.direction[m], row)
        stops = k >= fixtures or near.age[m] < young
        speed = 0.0 if stops else touch_speed
        # a receding object allows no more; an infinite deadband ignores its speed
        own = max(0.0, near.closing_speed[m] - deadband)
        cap = braking_cap(distance[m], speed, s.deceleration_m_s2, s.latency_s, s.margin_m)
        if stops and distance[m] < s.margin_m:
            cap = _BACK_1_S * (distance[m] - s.margin_m)
        target = max(cap - own, -s.retreat_max_m_s)
        # the same curve at the rate of tightening: the arm can still slow down to it at that rate
        last = braking_cap(distance[m], speed, s.tighten_m_s2, s.latency_s, s.margin_m) - own
        # Faster than that, smoothness comes second: the limit falls at once. With 0.0 it falls as far as a stop, while
        # a retreat (target < 0) is still approached at the rate of tightening.
        limit = min(_eased(target, slots.limit[k], approach, p), max(target, last, 0.0))
        slots.limit[k] = target if stops and distance[m] < s.margin_m + _AT_ONCE_M else limit
        rows.h[count], which[count] = slots.limit[k], m
        # it falls at once here; the deceleration of the arm is bounded where the row is written
        slots.across[k] = min(_limit_across(p, distance[m]), slots.across[k] + s.loosen_m_s2 * p.period_s)
        count += 1
    with_fading = _fading_rows(p, slots, present, chain, rows, count)
    all_rows = _rows_across(p, slots, chain, rows, with_fading)
    return ConstraintRows(rows.G[:all_rows], rows.h[:all_rows], which[:count], s.slack_weight)


@kernel
def _fading_rows(
    p: BrakingNumbers, slots: Slots, present: BoolArray, chain: Chain, rows: ConstraintRows, count: int
) -> int:
    """Add the rows of obstacles that have gone; return the number of rows."""
    s = p.curve
    for k in range(len(slots.link)):
        if present[k] or slots.link[k] < 0:
            continue
        # Point and normal stay in the base frame while the link moves on. From stop to free that takes less than a
        # second at the default rates.
        slots.limit[k] += s.loosen_m_s2 * p.period_s
        slots.across[k] += s.loosen_m_s2 * p.period_s
        # what the curve allows at d_notice, but for latency, margin and touch speed, or the task's speed if more
        free = max(p.fastest_m_s, np.sqrt(2.0 * s.deceleration_m_s2 * s.d_notice_m))
        if slots.limit[k] >= free and slots.across[k] >= p.fastest_m_s:
            slots.link[k] = -1
            continue
        approach = row_along(chain, slots.link[k], slots.point[k], slots.normal[k], rows.G[count])
        # where the link is faster along the old normal, this slows it no harder than a row tightens
        rows.h[count] = max(slots.limit[k], approach - s.tighten_m_s2 * p.period_s)
        count += 1
    return count


@kernel
def _limit_across(p: BrakingNumbers, distance: float) -> float:
    """Return v_t [m/s]: the slowest within the margin, and from there linear to the task's speed at that distance."""
    if not distance < p.across.distance_m:
        return np.inf
    share = max(0.0, distance - p.curve.margin_m) / max(p.across.distance_m - p.curve.margin_m, 1e-9)
    return p.across.speed_m_s + share * max(0.0, p.fastest_m_s - p.across.speed_m_s)


@kernel
def _rows_across(p: BrakingNumbers, slots: Slots, chain: Chain, rows: ConstraintRows, count: int) -> int:
    """Add (t + n) . v <= cap for four tangents t of each near point, n its normal: a retreating point may slide."""
    tangents, along = np.empty((2, 3)), np.empty(3)
    for k in range(len(slots.link)):
        if slots.link[k] < 0 or not slots.across[k] < p.fastest_m_s:
            continue
        normal = slots.normal[k]
        tangents_of(normal, tangents)
        # four half-planes for a disc: diagonally across, the square they leave allows sqrt(2) of the cap
        for t in range(_TANGENTS):
            sign = 1.0 if t % 2 == 0 else -1.0
            for i in range(3):
                along[i] = normal[i] + sign * tangents[t // 2, i]
            speed = row_along(chain, slots.link[k], slots.point[k], along, rows.G[count])
            rows.h[count] = max(slots.across[k], speed - p.curve.tighten_m_s2 * p.period_s)
            count += 1
    return count


@kernel
def _eased(target: float, last: float, approach: float, p: BrakingNumbers) -> float:
    """Limit between the target, the rate of loosening from the last limit, and the rate of slowing the arm."""
    eased = min(target, last + p.curve.loosen_m_s2 * p.period_s)
    return max(eased, approach - p.curve.tighten_m_s2 * p.period_s)  # last, so that it takes precedence over the target
