"""Which points of an outside source are kept: those of no arm and no fixture that are nearest to each link."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.perception.closest import closest, to_axis
from pretouch.perception.closing import follow_points
from pretouch.perception.obstacles import HEARD, SEEN, USED
from pretouch.robot.vectors import dot
from pretouch.types import BoolArray, FloatArray, IntArray

_FARTHEST = 100.0
"""A coordinate [m] from here on is none: another unit, or a broken message."""
_LARGEST_SIGMA = 1.0
"""A standard deviation [m] above this is none."""
_ONE_INSTANT = 1e-3
"""Stamps that differ by less [s] are taken as one: in that time no arm moves by more than 2 mm."""
_APART = 0.5
"""Points of one link are kept whose directions from it have at most this cosine: 60 degrees between them."""
_UNKNOWN, _OBSTACLE, _EXPLAINED, _HIDDEN = range(4)


@compiled
def usable(stamp: FloatArray, point: FloatArray, sigma: FloatArray) -> tuple[int, int]:
    """How many of M points are such as a source can see, and how many show nothing, for they hold a NaN."""
    good = nothing = 0
    for m in range(len(stamp)):
        if np.isnan(point[m, 0]) or np.isnan(point[m, 1]) or np.isnan(point[m, 2]):
            nothing += 1
        elif _is_point(stamp[m], point, m, sigma[m]):
            good += 1
    return good, nothing


@compiled
def _is_point(stamp: float, point: FloatArray, m: int, sigma: float) -> bool:
    for i in range(3):
        if not abs(point[m, i]) < _FARTHEST:
            return False
    return bool(0.0 <= sigma <= _LARGEST_SIGMA and np.isfinite(stamp))


@compiled
def take_points(
    last: FloatArray, times: FloatArray, motion: FloatArray, kept_sigma: FloatArray, heard: float, stamp: FloatArray,
    point: FloatArray, sigma: FloatArray, now: float, body_link: IntArray, body_from: FloatArray, body_to: FloatArray,
    body_radius: FloatArray, place: IntArray, arm_link: IntArray, arm_ends: FloatArray, arm_radius: FloatArray,
    other_ends: FloatArray, other_radius: FloatArray, planes: FloatArray, anchor: FloatArray, axis: FloatArray,
    moved_by: BoolArray, qd: FloatArray, posed: float, persistence: float, hidden: float, margin: float, sigmas: float,
    kept: int, memory: float,
) -> None:  # fmt: skip
    """Choose the points of each link's places, and change the tracks (first line of arguments) by them.

    Points that were kept before stand for election with the new ones where the arm hides them. Of the tracks' times
    `used` is when a point was measured, and `seen` when it was last known to be there or hidden.
    """
    ends = np.empty_like(arm_ends)
    move_ends(arm_ends, arm_link, anchor, axis, moved_by, qd, posed - heard, ends)
    placed_for, room = heard, len(stamp) + len(last)
    near, spread, when = np.empty((room, 3)), np.empty(room), np.empty(room)
    known, count = np.full(room, _UNKNOWN), 0
    for p in range(len(last)):
        u = sigmas * kept_sigma[p]
        if now - times[USED, p] <= hidden and now - times[SEEN, p] <= persistence:
            gap_of_arm = _gap(last, p, ends, arm_radius)
            if -u <= gap_of_arm <= margin + u:
                near[count], spread[count], when[count], known[count] = last[p], kept_sigma[p], times[USED, p], _HIDDEN
                count += 1
    for m in range(len(stamp)):
        if _is_point(stamp[m], point, m, sigma[m]) and 0.0 <= now - stamp[m] <= persistence:
            near[count], spread[count], when[count] = point[m], sigma[m], stamp[m]
            count += 1
    near = near[:count]
    body_point, link, gap = np.empty((count, 3)), np.empty(count, np.int64), np.empty(count)
    direction = np.zeros((count, 3))
    direction[:, 2] = 1.0
    closest(body_link, body_from, body_to, body_radius, near, body_point, link, direction, gap)
    for m in range(count):
        gap[m] -= sigmas * spread[m]

    chosen = np.full(len(kept_sigma), -1, np.int64)
    for rank in range(kept):
        for m in range(count):
            first = kept * place[link[m]]
            best = chosen[first + rank]
            if known[m] == _EXPLAINED or (best >= 0 and not gap[m] < gap[best]):
                continue
            if not _is_apart(direction, m, chosen[first : first + rank]):
                continue
            if known[m] == _UNKNOWN:
                if not abs(when[m] - placed_for) < _ONE_INSTANT:
                    placed_for = when[m]
                    move_ends(arm_ends, arm_link, anchor, axis, moved_by, qd, posed - placed_for, ends)
                within = margin + sigmas * spread[m]
                known[m] = _OBSTACLE
                if (
                    _on_capsules(near, m, ends, arm_radius, within)
                    or _on_capsules(near, m, other_ends, other_radius, within)
                    or _on_planes(near, m, planes, within)
                ):
                    known[m] = _EXPLAINED
                    continue
            chosen[first + rank] = m

    points, stamps, taken = np.zeros((len(chosen), 3)), np.full(len(chosen), heard), np.zeros(len(chosen), np.bool_)
    for p in range(len(chosen)):
        if chosen[p] >= 0:
            points[p], stamps[p], taken[p] = near[chosen[p]], when[chosen[p]], known[chosen[p]] == _OBSTACLE
    if memory > 0:
        follow_points(motion, last, times[SEEN], points, stamps, taken, memory)
    for p in range(len(chosen)):
        times[HEARD, p] = heard
        if chosen[p] >= 0:
            last[p], kept_sigma[p], times[USED, p] = points[p], spread[chosen[p]], stamps[p]
            times[SEEN, p] = stamps[p] if taken[p] else heard
            if memory > 0 and not taken[p]:
                motion[0, p], motion[1, p] = points[p], 0.0


@compiled
def _is_apart(direction: FloatArray, m: int, chosen: IntArray) -> bool:
    """Whether point m lies in another direction from its link than all those chosen of it; not if one is missing."""
    for c in chosen:  # noqa: SIM110  compiled code knows no generators
        if c < 0 or c == m or dot(direction[c], direction[m]) > _APART:
            return False
    return True


@compiled
def _gap(points: FloatArray, m: int, ends: FloatArray, radius: FloatArray) -> float:
    """Distance [m] of point m from the nearest of some placed capsules, negative inside."""
    least = np.inf
    for c in range(len(radius)):
        least = min(least, to_axis(points, m, ends[0], ends[1], c)[1] - radius[c])
    return least


@compiled
def move_ends(
    ends: FloatArray, link: IntArray, anchor: FloatArray, axis: FloatArray, moved_by: BoolArray, qd: FloatArray,
    age: float, out: FloatArray,
) -> None:  # fmt: skip
    """Write to `out` where the ends (2, C, 3) [m] of capsules on links (C,) were `age` [s] before, to first order.

    `anchor` (n, 3) [m] and `axis` (n, 3) are those of the joints, `qd` (n,) [rad/s] their velocities, `moved_by` (L, n)
    says which joint moves which link.
    """
    for end in range(2):
        for c in range(len(link)):
            x, y, z = 0.0, 0.0, 0.0
            for j in range(len(qd)):
                if moved_by[link[c], j]:
                    u, v, w = (
                        ends[end, c, 0] - anchor[j, 0], ends[end, c, 1] - anchor[j, 1], ends[end, c, 2] - anchor[j, 2],
                    )  # fmt: skip
                    x += (axis[j, 1] * w - axis[j, 2] * v) * qd[j]
                    y += (axis[j, 2] * u - axis[j, 0] * w) * qd[j]
                    z += (axis[j, 0] * v - axis[j, 1] * u) * qd[j]
            out[end, c, 0] = ends[end, c, 0] - age * x
            out[end, c, 1] = ends[end, c, 1] - age * y
            out[end, c, 2] = ends[end, c, 2] - age * z


@compiled
def _on_capsules(points: FloatArray, m: int, ends: FloatArray, radius: FloatArray, within: float) -> bool:
    """Whether point m is within a distance [m] of a placed capsule, or inside one."""
    for c in range(len(radius)):  # noqa: SIM110  compiled code knows no generators
        if to_axis(points, m, ends[0], ends[1], c)[1] - radius[c] <= within:
            return True
    return False


@compiled
def _on_planes(points: FloatArray, m: int, planes: FloatArray, within: float) -> bool:
    """Whether point m is within a distance [m] of a plane, or behind it."""
    for p in range(len(planes)):  # noqa: SIM110  compiled code knows no generators
        if dot(planes[p, :3], points[m]) - planes[p, 3] <= within:
            return True
    return False
