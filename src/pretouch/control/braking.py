"""Restriction mode "braking": how fast the body may come near, so that it could stop, or touch gently.

Along the normal the closing speed v, the object's own included, keeps v <= sqrt(v_c^2 + 2 a max(0, d - v tau - m)),
from which it can brake at a to the touch speed v_c before the object is reached, tau later than measured and m nearer
than seen. A row G qd <= h of that is kept for each unit and link. It appears with the speed the arm has, tightens at
one rate and gives way at another, also when its object is no longer seen; so no row moves the command by a step, but
for what is so near that the arm could not slow at that rate before it: there it brakes as hard as its joints may.
"""

import numpy as np

from pretouch.compiled import compiled
from pretouch.control.touch_speed import mass_along, touch_speed
from pretouch.types import BoolArray, FloatArray, IntArray

LINK, LIMIT, ACROSS, DIRECTION, POINT, WIDTH = 0, 1, 2, 3, 6, 9
"""Columns of a slot: link of the row or -1, its limit and that across the normal [m/s], normal, body point; how many.
"""
_TANGENTS = 4
(
    NOTICE, DECELERATION, LATENCY, MARGIN, RETREAT, DEADBAND, NEAR, SLOWEST, FASTEST, TIGHTEN, LOOSEN, PERIOD, MASSES,
) = range(13)  # fmt: skip
"""Places of the numbers in `settings` of `braking_rows`."""


def slots_init(units: int) -> FloatArray:
    """Return the slots (2 K, 9) of K units without a row: first one a unit, then one for the row it had before."""
    slots = np.zeros((2 * units, WIDTH))
    slots[:, LINK] = -1.0
    return slots


@compiled
def braking_cap(distance: float, touch: float, deceleration: float, latency: float, margin: float) -> float:
    """Largest closing speed v [m/s] with v = sqrt(v_c^2 + 2 a max(0, d - v tau - m)): the curve solved for v.

    `distance` d [m] may be negative, where v is the touch speed v_c.
    """
    left, lag = distance - margin, deceleration * latency
    if left <= touch * latency:
        return touch
    return np.sqrt(lag * lag + touch * touch + 2.0 * deceleration * left) - lag


@compiled
def braking_rows(
    slots: FloatArray, unit: IntArray, link: IntArray, body_point: FloatArray, direction: FloatArray,
    distance: FloatArray, closing: FloatArray, anchor: FloatArray, axis: FloatArray, moved_by: BoolArray,
    qd: FloatArray, L: FloatArray, limits: FloatArray, settings: FloatArray,
    G: FloatArray, h: FloatArray, which: IntArray,
) -> tuple[int, int]:  # fmt: skip
    """Change `slots` by one period and write rows G (R, n), h (R,); return how many are of what is seen, and of all.

    The first are those of the obstacles `which`; then those that fade, then those across the normals.

    Args:
        slots: (2 K, 9) rows so far.
        unit: (M,) of each obstacle.
        link: (M,) closest to each.
        body_point: (M, 3) closest on the body [m].
        direction: (M, 3) from there to the obstacle.
        distance: (M,) between them [m].
        closing: (M,) each obstacle's own closing speed [m/s].
        anchor: (n, 3) of the joints [m].
        axis: (n, 3) of the joints.
        moved_by: (L, n) which joint moves which link.
        qd: (n,) joint velocities as last commanded [rad/s].
        L: (n, n) factor of the mass matrix.
        limits: (4,) of `touch_speed`.
        settings: (13,) numbers at the places named above.
        G: room for all rows.
        h: likewise.
        which: room for M indices.
    """
    half, s = len(slots) // 2, settings
    seen, found = np.zeros(half, np.bool_), 0
    for m in range(len(unit)):
        k = unit[m]
        if not distance[m] < s[NOTICE]:
            continue
        seen[k] = True
        _take_slot(slots, k, half, link[m])
        for i in range(3):
            slots[k, DIRECTION + i], slots[k, POINT + i] = direction[m, i], body_point[m, i]
        approach = _row(slots[k], anchor, axis, moved_by, qd, direction[m], G[found])
        touch = touch_speed(mass_along(L, G[found]), limits) if s[MASSES] > 0 else limits[3]
        own = max(0.0, closing[m] - s[DEADBAND])
        target = max(braking_cap(distance[m], touch, s[DECELERATION], s[LATENCY], s[MARGIN]) - own, -s[RETREAT])
        last = braking_cap(distance[m], touch, s[TIGHTEN], s[LATENCY], s[MARGIN]) - own
        # beyond the speed from which tightening at its rate would still do, smoothness comes second
        slots[k, LIMIT] = min(_eased(target, slots[k, LIMIT], approach, s), max(target, last, 0.0))
        h[found], which[found] = slots[k, LIMIT], m
        across = np.inf
        if distance[m] < s[NEAR]:
            share = max(0.0, distance[m]) / s[NEAR]
            across = s[SLOWEST] + share * max(0.0, s[FASTEST] - s[SLOWEST])
        slots[k, ACROSS] = min(across, slots[k, ACROSS] + s[LOOSEN] * s[PERIOD])
        found += 1
    rows = _fading_rows(slots, seen, anchor, axis, moved_by, qd, s, G, h, found)
    return found, _rows_across(slots, anchor, axis, moved_by, qd, s, G, h, rows)


@compiled
def _take_slot(slots: FloatArray, k: int, half: int, link: int) -> None:
    """Make slot k that of a unit's row on a link: as it is, as it was before another link was nearer, or empty."""
    if slots[k, LINK] == link:
        return
    last = half + k
    if slots[last, LINK] == link:
        for i in range(slots.shape[1]):
            slots[k, i], slots[last, i] = slots[last, i], slots[k, i]
        return
    _leave(slots, k, last)
    slots[k, LINK], slots[k, LIMIT], slots[k, ACROSS] = link, np.inf, np.inf


@compiled
def _leave(slots: FloatArray, k: int, last: int) -> None:
    """Let the row in slot k fade in slot `last`, unless a row that fades there is the tighter one."""
    if slots[k, LINK] >= 0 and (slots[last, LINK] < 0 or slots[k, LIMIT] <= slots[last, LIMIT]):
        for i in range(slots.shape[1]):
            slots[last, i] = slots[k, i]
    slots[k, LINK] = -1.0


@compiled
def _fading_rows(
    slots: FloatArray, seen: BoolArray, anchor: FloatArray, axis: FloatArray, moved_by: BoolArray, qd: FloatArray,
    s: FloatArray, G: FloatArray, h: FloatArray, rows: int,
) -> int:  # fmt: skip
    """Add the rows of what is no longer seen to those there are; return how many there are then."""
    half = len(slots) // 2
    for k in range(half):
        if not seen[k]:
            _leave(slots, k, half + k)
        slot = slots[half + k]
        if slot[LINK] < 0:
            continue
        slot[LIMIT] += s[LOOSEN] * s[PERIOD]
        slot[ACROSS] += s[LOOSEN] * s[PERIOD]
        free = max(s[FASTEST], np.sqrt(2.0 * s[DECELERATION] * s[NOTICE]))
        if slot[LIMIT] >= free and slot[ACROSS] >= s[FASTEST]:
            slot[LINK] = -1.0
            continue
        approach = _row(slot, anchor, axis, moved_by, qd, slot[DIRECTION : DIRECTION + 3], G[rows])
        h[rows] = max(slot[LIMIT], approach - s[TIGHTEN] * s[PERIOD])
        rows += 1
    return rows


@compiled
def _rows_across(
    slots: FloatArray, anchor: FloatArray, axis: FloatArray, moved_by: BoolArray, qd: FloatArray, s: FloatArray,
    G: FloatArray, h: FloatArray, rows: int,
) -> int:  # fmt: skip
    """Add (t + n) . v <= cap for four tangents t of each near point, n its normal: what retreats may slide as fast."""
    tangents, along = np.empty((2, 3)), np.empty(3)
    for k in range(len(slots)):
        slot = slots[k]
        if slot[LINK] < 0 or not slot[ACROSS] < s[FASTEST]:
            continue
        normal = slot[DIRECTION : DIRECTION + 3]
        tangents_of(normal, tangents)
        for t in range(_TANGENTS):
            sign = 1.0 if t % 2 == 0 else -1.0
            for i in range(3):
                along[i] = normal[i] + sign * tangents[t // 2, i]
            speed = _row(slot, anchor, axis, moved_by, qd, along, G[rows])
            h[rows] = max(slot[ACROSS], speed - s[TIGHTEN] * s[PERIOD])
            rows += 1
    return rows


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
def _eased(target: float, last: float, approach: float, s: FloatArray) -> float:
    """Limit between what is wanted, how far it may loosen from the last, and how hard it may slow the arm."""
    eased = min(target, last + s[LOOSEN] * s[PERIOD])
    return max(eased, approach - s[TIGHTEN] * s[PERIOD])


@compiled
def _row(
    slot: FloatArray, anchor: FloatArray, axis: FloatArray, moved_by: BoolArray, qd: FloatArray, along: FloatArray,
    row: FloatArray,
) -> float:  # fmt: skip
    """Write the row along^T J (n,) of a slot's point, and return the speed along it [m/s]."""
    link, speed = int(slot[LINK]), 0.0
    for j in range(len(anchor)):
        row[j] = 0.0
        if moved_by[link, j]:
            x, y, z = slot[POINT] - anchor[j, 0], slot[POINT + 1] - anchor[j, 1], slot[POINT + 2] - anchor[j, 2]
            row[j] = (
                along[0] * (axis[j, 1] * z - axis[j, 2] * y)
                + along[1] * (axis[j, 2] * x - axis[j, 0] * z)
                + along[2] * (axis[j, 0] * y - axis[j, 1] * x)
            )
            speed += row[j] * qd[j]
    return speed
