"""Which points of an outside source are kept: those of no arm and no fixture that are nearest to each link."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, inlined, kernel
from pretouch.groups import CapsuleArrays, Chain
from pretouch.perception.closest import ClosestArrays, closest, to_axis
from pretouch.perception.motion_compensation import follow_points
from pretouch.perception.obstacles import HEARD, SEEN, USED
from pretouch.robot.kinematics import point_velocity
from pretouch.robot.vectors import dot
from pretouch.types import FloatArray, IntArray, SeenPoints

FARTHEST = 100.0
"""A coordinate [m] from here on is implausible: another unit, or a broken message."""
LARGEST_SIGMA = 1.0
"""A standard deviation [m] above this is implausible."""
_ONE_INSTANT = 1e-3
"""Stamps that differ by less [s] are taken as one: in that time no arm moves by more than 2 mm."""
_APART = 0.5
"""Points of one link are kept whose directions from it have at most this cosine: 60 degrees between them."""
_UNKNOWN, _OBSTACLE, _EXPLAINED, _HIDDEN = range(4)


@compiled
def usable(stamp: FloatArray, point: FloatArray, sigma: FloatArray) -> tuple[int, int]:
    """How many of M points are plausible, and how many show nothing, for they hold a NaN."""
    good = nothing = 0
    for m in range(len(stamp)):
        if np.isnan(point[m, 0]) or np.isnan(point[m, 1]) or np.isnan(point[m, 2]):
            nothing += 1
        elif _is_point(stamp[m], point, m, sigma[m]):
            good += 1
    return good, nothing


@kernel
def _is_point(stamp: float, point: FloatArray, m: int, sigma: float) -> bool:
    for i in range(3):
        if not abs(point[m, i]) < FARTHEST:
            return False
    return bool(0.0 <= sigma <= LARGEST_SIGMA and np.isfinite(stamp))


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
    """What is taken of `OutsidePoints` and of the rest of `PerceptionParams`."""

    persistence_s: float
    hidden_s: float
    margin_m: float
    per_link: int
    spread_sigmas: float
    estimates: bool
    """Whether closing speeds are estimated."""
    memory_s: float
    """Memory of these estimates."""
    silence_s: float
    """How long points of silent sources are kept, 0 for no longer than others."""


class _Candidates(NamedTuple):
    """M points that stand for election."""

    point: FloatArray
    """(M, 3) [m]."""
    sigma: FloatArray
    """(M,) [m]."""
    stamp: FloatArray
    """(M,) when each was measured [s]."""
    known: IntArray
    """(M,) what is known of each."""
    first: IntArray
    """(M,) the first of the places of its nearest link."""
    direction: FloatArray
    """(M, 3) from that link."""
    gap: FloatArray
    """(M,) distance from it, less the point's spread [m]."""


@compiled
def take_points(
    old: KeptPoints, new: SeenPoints, now: float, place: IntArray, there: Placed, chain: Chain, posed: float,
    p: PointNumbers,
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
    # where the arm was when the points were measured: it may have moved by more than the margin since
    ends = np.empty_like(there.arm_ends)
    move_ends(there.arm_ends, there.arm_link, chain, posed - new.heard, ends)
    found = _candidates(old, new, now, place, there, ends, p)
    chosen = np.full(len(old.point), -1, np.int64)
    _elect(found, chosen, there, ends, new.heard, chain, posed, p)

    points, stamps = np.zeros((len(chosen), 3)), np.full(len(chosen), new.heard)
    taken = np.zeros(len(chosen), np.bool_)
    for k in range(len(chosen)):
        if chosen[k] >= 0:
            m = chosen[k]
            points[k], stamps[k], taken[k] = found.point[m], found.stamp[m], found.known[m] == _OBSTACLE
    if p.estimates:
        follow_points(old.motion, old.point, old.times[SEEN], points, stamps, taken, p.memory_s)
    for k in range(len(chosen)):
        old.times[HEARD, k] = new.heard
        if chosen[k] >= 0:
            old.point[k], old.sigma[k], old.times[USED, k] = points[k], found.sigma[chosen[k]], stamps[k]
            # a hidden point was not seen again: the arm is in front of it, so it is taken to be there still
            old.times[SEEN, k] = stamps[k] if taken[k] else new.heard
            if p.estimates and not taken[k]:
                old.motion[0, k], old.motion[1, k] = points[k], 0.0


@inlined
def _candidates(
    old: KeptPoints, new: SeenPoints, now: float, place: IntArray, there: Placed, ends: FloatArray, p: PointNumbers
) -> _Candidates:
    """The kept points that the arm hides and the new ones that are young enough, each with its nearest link."""
    persistence, sigmas = p.persistence_s, p.spread_sigmas
    room, count = len(new.stamp) + len(old.point), 0
    near, spread, when = np.empty((room, 3)), np.empty(room), np.empty(room)
    known = np.full(room, _UNKNOWN)
    for k in range(len(old.point)):
        u = sigmas * old.sigma[k]
        if now - old.times[USED, k] <= p.hidden_s and now - old.times[SEEN, k] <= persistence:
            # within what the filter takes for the arm, no source can show the point; inside the arm it cannot be
            gap_of_arm = _gap(old.point, k, ends, there.arm_radius)
            if -u <= gap_of_arm <= p.margin_m + u:
                near[count], spread[count], when[count] = old.point[k], old.sigma[k], old.times[USED, k]
                known[count] = _HIDDEN
                count += 1
    for m in range(len(new.stamp)):
        if _is_point(new.stamp[m], new.point, m, new.sigma[m]) and 0.0 <= now - new.stamp[m] <= persistence:
            near[count], spread[count], when[count] = new.point[m], new.sigma[m], new.stamp[m]
            count += 1
    near = near[:count]
    body_point, link, gap = np.empty((count, 3)), np.empty(count, np.int64), np.empty(count)
    direction = np.zeros((count, 3))
    direction[:, 2] = 1.0
    closest(there.body, near, ClosestArrays(body_point, link, direction, gap))
    for m in range(count):
        gap[m] -= sigmas * spread[m]
        link[m] = p.per_link * place[link[m]]
    return _Candidates(near, spread, when, known, link, direction, gap)


@inlined
def _elect(
    found: _Candidates, chosen: IntArray, there: Placed, ends: FloatArray, placed_for: float, chain: Chain,
    posed: float, p: PointNumbers,
) -> None:  # fmt: skip
    """Write the candidate of each place to `chosen`: of each link the nearest, then the nearest apart from it.

    A candidate is compared with arm and fixtures only once it would win: a cloud has hundreds that never do.
    `ends` are those of the arm at `placed_for`, and change with the stamp of the candidate.
    """
    for rank in range(p.per_link):
        for m in range(len(found.point)):
            first = found.first[m]
            best = chosen[first + rank]
            if found.known[m] == _EXPLAINED or (best >= 0 and not found.gap[m] < found.gap[best]):
                continue
            if not _is_apart(found.direction, m, chosen[first : first + rank]):
                continue
            if found.known[m] == _UNKNOWN:
                if not abs(found.stamp[m] - placed_for) < _ONE_INSTANT:
                    placed_for = found.stamp[m]
                    move_ends(there.arm_ends, there.arm_link, chain, posed - placed_for, ends)
                within = p.margin_m + p.spread_sigmas * found.sigma[m]
                found.known[m] = _OBSTACLE
                if (
                    _gap(found.point, m, ends, there.arm_radius) <= within
                    or _gap(found.point, m, there.other_ends, there.other_radius) <= within
                    or _on_planes(found.point, m, there.planes, within)
                ):
                    found.known[m] = _EXPLAINED
                    continue
            chosen[first + rank] = m


@kernel
def _is_apart(direction: FloatArray, m: int, chosen: IntArray) -> bool:
    """Whether point m lies in another direction from its link than all those chosen of it; not if one is missing."""
    for c in chosen:  # noqa: SIM110  compiled code knows no generators
        if c < 0 or c == m or dot(direction[c], direction[m]) > _APART:
            return False
    return True


@kernel
def _gap(points: FloatArray, m: int, ends: FloatArray, radius: FloatArray) -> float:
    """Distance [m] of point m from the nearest of some placed capsules, negative inside."""
    least = np.inf
    for c in range(len(radius)):
        least = min(least, to_axis(points, m, ends[0], ends[1], c)[1] - radius[c])
    return least


@kernel
def move_ends(ends: FloatArray, link: IntArray, chain: Chain, age: float, out: FloatArray) -> None:
    """Write to `out` where the ends (2, C, 3) [m] of capsules on links (C,) were `age` [s] before, to first order."""
    for end in range(2):
        for c in range(len(link)):
            x, y, z = point_velocity(chain, link[c], ends[end, c, 0], ends[end, c, 1], ends[end, c, 2])
            out[end, c, 0] = ends[end, c, 0] - age * x
            out[end, c, 1] = ends[end, c, 1] - age * y
            out[end, c, 2] = ends[end, c, 2] - age * z


@kernel
def _on_planes(points: FloatArray, m: int, planes: FloatArray, within: float) -> bool:
    """Whether point m is within a distance [m] of a plane, or behind it."""
    for p in range(len(planes)):  # noqa: SIM110  compiled code knows no generators
        if dot(planes[p, :3], points[m]) - planes[p, 3] <= within:
            return True
    return False
