"""Which points of an outside source are kept: those of no arm and no fixture that are nearest to each link."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import ByName, compiled, entry
from pretouch.groups import CapsuleArrays, Chain
from pretouch.perception.closest import ClosestArrays, closest, to_axis
from pretouch.perception.closing import follow_points
from pretouch.perception.obstacles import HEARD, SEEN, USED
from pretouch.robot.vectors import dot
from pretouch.types import FloatArray, IntArray

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


class KeptPoints(NamedTuple):
    """The points that P places show, changed by newer ones."""

    point: FloatArray
    """(P, 3) [m]."""
    times: FloatArray
    """(3, P) as of `TrackState`: `used` is when a point was measured, `seen` when it was last there or hidden."""
    motion: FloatArray
    """(2, P, 3) smoothed place [m] and velocity [m/s]."""
    sigma: FloatArray
    """(P,) standard deviation of each [m]."""


class PointSet(NamedTuple):
    """As `SeenPoints`."""

    heard: float
    stamp: FloatArray
    point: FloatArray
    sigma: FloatArray


class Placed(NamedTuple):
    """What is there already when points are measured, placed in the base frame in one posture."""

    body: CapsuleArrays
    """The part of the arm that joints move."""
    arm_link: IntArray
    """(C,) link of each capsule of the whole arm."""
    arm_ends: FloatArray
    """(2, C, 3) both ends of the axis of each [m]."""
    arm_radius: FloatArray
    """(C,) [m]."""
    other_ends: FloatArray
    """(2, F, 3) the same of fixtures."""
    other_radius: FloatArray
    """(F,) [m]."""
    planes: FloatArray
    """(Q, 4) of fixtures."""


class PointNumbers(NamedTuple):
    """What is taken of `PerceptionParams`."""

    outside_persistence_s: float
    outside_hidden_s: float
    outside_margin_m: float
    spread_sigmas: float
    outside_points: int
    closing_speed: bool
    closing_memory_s: float


@entry
def take_points(
    old: KeptPoints, new: ByName[PointSet], now: float, place: IntArray, there: Placed, chain: Chain, posed: float,
    p: ByName[PointNumbers],
) -> None:  # fmt: skip
    """Choose the points of each link's places, and change those that are kept.

    Points that were kept before stand for election with the new ones where the arm hides them.

    Args:
        old: those kept.
        new: those of the sources.
        now: instant of the step [s].
        place: (L,) of each link, -1 for none.
        there: what is no obstacle, in the posture of the arm.
        chain: of the arm.
        posed: instant of that posture [s].
        p: parameters.
    """
    last, times, motion, kept_sigma = old
    heard, stamp, point, sigma = new
    arm_link, arm_ends, arm_radius = there.arm_link, there.arm_ends, there.arm_radius
    other_ends, other_radius, planes = there.other_ends, there.other_radius, there.planes
    persistence, hidden, margin = p.outside_persistence_s, p.outside_hidden_s, p.outside_margin_m
    sigmas, kept = p.spread_sigmas, p.outside_points
    ends = np.empty_like(arm_ends)
    move_ends(arm_ends, arm_link, chain, posed - heard, ends)
    placed_for, room = heard, len(stamp) + len(last)
    near, spread, when = np.empty((room, 3)), np.empty(room), np.empty(room)
    known, count = np.full(room, _UNKNOWN), 0
    for k in range(len(last)):
        u = sigmas * kept_sigma[k]
        if now - times[USED, k] <= hidden and now - times[SEEN, k] <= persistence:
            gap_of_arm = _gap(last, k, ends, arm_radius)
            if -u <= gap_of_arm <= margin + u:
                near[count], spread[count], when[count], known[count] = last[k], kept_sigma[k], times[USED, k], _HIDDEN
                count += 1
    for m in range(len(stamp)):
        if _is_point(stamp[m], point, m, sigma[m]) and 0.0 <= now - stamp[m] <= persistence:
            near[count], spread[count], when[count] = point[m], sigma[m], stamp[m]
            count += 1
    near = near[:count]
    body_point, link, gap = np.empty((count, 3)), np.empty(count, np.int64), np.empty(count)
    direction = np.zeros((count, 3))
    direction[:, 2] = 1.0
    closest(there.body, near, ClosestArrays(body_point, link, direction, gap))
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
                    move_ends(arm_ends, arm_link, chain, posed - placed_for, ends)
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
    for k in range(len(chosen)):
        if chosen[k] >= 0:
            points[k], stamps[k], taken[k] = near[chosen[k]], when[chosen[k]], known[chosen[k]] == _OBSTACLE
    if p.closing_speed:
        follow_points(motion, last, times[SEEN], points, stamps, taken, p.closing_memory_s)
    for k in range(len(chosen)):
        times[HEARD, k] = heard
        if chosen[k] >= 0:
            last[k], kept_sigma[k], times[USED, k] = points[k], spread[chosen[k]], stamps[k]
            times[SEEN, k] = stamps[k] if taken[k] else heard
            if p.closing_speed and not taken[k]:
                motion[0, k], motion[1, k] = points[k], 0.0


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
def move_ends(ends: FloatArray, link: IntArray, chain: Chain, age: float, out: FloatArray) -> None:
    """Write to `out` where the ends (2, C, 3) [m] of capsules on links (C,) were `age` [s] before, to first order."""
    anchor, axis, moved_by, qd = chain
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
