"""Points of outside sources, such as cameras: the choice of obstacles among them, and their life.

Of any number of points at most `per_link` stay for each moving link: the nearest one by its certain distance, then the
nearest one in another direction, and so on. Each has a slot of its own, so a slot continues to show the same side of
the same link, as a unit of the skin does. Points on the arm, in its posture at the measurement, and on fixtures are
left out.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, inlined, kernel
from pretouch.params import OutsidePoints
from pretouch.perception.closest import closest
from pretouch.perception.motion_compensation import follow_points
from pretouch.perception.obstacles import Sight, TrackState, speed_factor, track_init
from pretouch.records import Cell
from pretouch.robot.body import Capsules, placed, to_axis
from pretouch.robot.kinematics import Chain, Kinematics, dot, point_velocity
from pretouch.types import FloatArray, IntArray, Obstacles, SeenPoints, no_obstacles

FARTHEST = 100.0
"""A coordinate [m] of this size is implausible: another unit, or a broken message."""
LARGEST_SIGMA = 1.0
"""A standard deviation [m] above this is implausible."""
_ONE_INSTANT = 1e-3
"""Stamps that differ by less [s] count as one: in that time no arm moves by more than 2 mm."""
_APART = 0.5
"""Largest cosine between the directions of the points of one link: at least 60 degrees between them."""
_UNKNOWN, _OBSTACLE, _EXPLAINED, _HIDDEN = range(4)


class OutsideState(NamedTuple):
    """Last points of outside sources in P slots: the same number for each moving link, one link after the other."""

    tracks: TrackState
    """`reading_stamp` is that of the measurement, `point_stamp` also that of a later set while the point is hidden."""
    sigma: Annotated[FloatArray, "P"]
    """(P,) standard deviation of each point [m]."""
    source_stamp: Cell
    """Stamp of the newest set [s]: -inf before the first, NaN without a source so far."""


def outside_init(slots: int, source_stamp: float = math.nan) -> OutsideState:
    """Return the state before the first points."""
    return OutsideState(track_init(slots), np.zeros(slots), np.full(1, source_stamp))


def outside_silence(source_stamp: float, unfit: str, now: float, params: OutsidePoints | None) -> tuple[float, str]:
    """Return the factor in [0, 1] on the speed for outside sources that fall silent, and their fault.

    As with units, silence is no free space: from `slow_after_s` on the arm slows, and at `silent_after_s` it stands. It
    stands at once for a fault `unfit` of the points. `source_stamp` [s] is that of `OutsideState`.
    """
    if params is None:
        return 1.0, ""
    if unfit:
        return 0.0, unfit
    if math.isnan(source_stamp):  # there was no source so far
        return 1.0, ""
    silence = now - source_stamp
    factor = speed_factor(silence, params.slow_after_s, params.silent_after_s)
    if silence < params.silent_after_s:
        return factor, ""
    return 0.0, "has not reported yet" if math.isinf(silence) else f"has been silent for {silence:.2f} s"


@compiled
def usable(stamp: FloatArray, point: FloatArray, sigma: FloatArray) -> tuple[int, int]:
    """Return the number of plausible points of M, and the number of rows without a point, with a NaN."""
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


class _PointCandidates(NamedTuple):
    """M points among which those of the slots are chosen."""

    near: Obstacles
    """Points with their closest body points; the spread of a point shortens its distance from the body."""
    sigma: FloatArray
    """(M,) [m]."""
    stamp: FloatArray
    """(M,) stamp of each measurement [s]."""
    status: IntArray
    """(M,) unknown, obstacle, explained by arm or fixture, or hidden by the arm."""
    first: IntArray
    """(M,) first slot of its nearest link."""


@kernel
def take_points(
    sight: Sight, state: OutsideState, new: SeenPoints, posture: tuple[Kinematics, Chain],
    instants: tuple[float, float], fixtures: Capsules,
) -> None:  # fmt: skip
    """Choose the points of each link's slots.

    Points that the arm hides now compete with the new ones. A source returns the same set until it has a newer one:
    each set is used once. A set that is newer than the step is ignored, as with units.

    Args:
        sight: constants.
        state: points so far, changed.
        new: points of the sources.
        posture: of the arm.
        instants: those of the step and of the posture [s].
        fixtures: placed.
    """
    (kin, chain), (now, posed), tracks = posture, instants, state.tracks
    if np.isnan(state.source_stamp[0]):
        state.source_stamp[0] = -np.inf
    if not state.source_stamp[0] < new.heard <= now:
        return
    state.source_stamp[0] = new.heard
    # the arm at the measurement of the points: it may have moved by more than the margin since; the whole arm explains
    # points, the base too, while only moving links have slots
    here = placed(sight.arm, kin)
    arm = Capsules(here.link, np.empty_like(here.a), np.empty_like(here.b), here.radius)
    _move(here, chain, posed - new.heard, arm)
    candidates = _candidates(sight, state, new, now, placed(sight.body, kin), arm)
    chosen = np.full(len(state.sigma), -1, np.int64)
    _choose(candidates, chosen, sight, (here, arm, fixtures), new.heard, chain, posed)

    points, stamps = np.zeros((len(chosen), 3)), np.full(len(chosen), new.heard)
    fresh = np.zeros(len(chosen), np.bool_)
    for k in range(len(chosen)):
        if chosen[k] >= 0:
            m = chosen[k]
            points[k], stamps[k] = candidates.near.point[m], candidates.stamp[m]
            fresh[k] = candidates.status[m] == _OBSTACLE
    if sight.memory_s > 0.0:
        follow_points(tracks, points, stamps, fresh, sight.memory_s)
    for k in range(len(chosen)):
        tracks.report_stamp[k] = new.heard
        if chosen[k] >= 0:
            tracks.point[k], state.sigma[k], tracks.reading_stamp[k] = points[k], candidates.sigma[chosen[k]], stamps[k]
            # the arm is in front of a hidden point, so the point counts as still there
            tracks.point_stamp[k] = stamps[k] if fresh[k] else new.heard
            if sight.memory_s > 0.0 and not fresh[k]:
                tracks.motion[0, k], tracks.motion[1, k] = points[k], 0.0


@inlined
def _candidates(
    sight: Sight, state: OutsideState, new: SeenPoints, now: float, body: Capsules, arm: Capsules
) -> _PointCandidates:
    """Return the points that the arm hides and the new ones that are young enough, each with its nearest link."""
    p, sigmas, tracks = sight.outside, sight.perception.spread_sigmas, state.tracks
    room, count = len(new.stamp) + len(state.sigma), 0
    point, sigma, stamp, status = np.empty((room, 3)), np.empty(room), np.empty(room), np.full(room, _UNKNOWN)
    for k in range(len(state.sigma)):
        u = sigmas * state.sigma[k]
        if now - tracks.reading_stamp[k] > p.hidden_s or now - tracks.point_stamp[k] > p.persistence_s:
            continue
        # within the margin of the arm no source can show the point; inside the arm it cannot be
        if -u <= _gap(tracks.point, k, arm) <= p.margin_m + u:
            point[count], sigma[count], stamp[count] = tracks.point[k], state.sigma[k], tracks.reading_stamp[k]
            status[count] = _HIDDEN
            count += 1
    for m in range(len(new.stamp)):
        if _is_point(new.stamp[m], new.point, m, new.sigma[m]) and 0.0 <= now - new.stamp[m] <= p.persistence_s:
            point[count], sigma[count], stamp[count] = new.point[m], new.sigma[m], new.stamp[m]
            count += 1
    near, first, links = no_obstacles(count), np.empty(count, np.int64), np.unique(body.link)
    near.point[:] = point[:count]
    near.direction[:, 2] = 1.0
    closest(body, near)
    for m in range(count):
        near.body_distance[m] -= sigmas * sigma[m]
        first[m] = p.per_link * np.searchsorted(links, near.link[m])
    return _PointCandidates(near, sigma, stamp, status, first)


@inlined
def _choose(
    candidates: _PointCandidates, chosen: IntArray, sight: Sight, capsules: tuple[Capsules, Capsules, Capsules],
    placed_for: float, chain: Chain, posed: float,
) -> None:  # fmt: skip
    """Write the candidate of each slot to `chosen`: for each link the nearest, then the nearest apart from it.

    A candidate is compared with arm and fixtures only when it would win: a cloud has hundreds that never do.
    `capsules` are those of the arm now, of the arm at `placed_for`, which change with the stamp of the candidate, and
    of fixtures.
    """
    here, arm, fixtures = capsules
    near, status, p = candidates.near, candidates.status, sight.outside
    for rank in range(p.per_link):
        for m in range(len(near.unit)):
            first = candidates.first[m]
            best = chosen[first + rank]
            if status[m] == _EXPLAINED or (best >= 0 and not near.body_distance[m] < near.body_distance[best]):
                continue
            if not _is_apart(near.direction, m, chosen[first : first + rank]):
                continue
            if status[m] == _UNKNOWN:
                if not abs(candidates.stamp[m] - placed_for) < _ONE_INSTANT:
                    placed_for = candidates.stamp[m]
                    _move(here, chain, posed - placed_for, arm)
                within = p.margin_m + sight.perception.spread_sigmas * candidates.sigma[m]
                status[m] = _OBSTACLE
                if (
                    _gap(near.point, m, arm) <= within
                    or _gap(near.point, m, fixtures) <= within
                    or _on_planes(near.point, m, sight.planes, within)
                ):
                    status[m] = _EXPLAINED
                    continue
            chosen[first + rank] = m


@kernel
def _is_apart(direction: FloatArray, m: int, chosen: IntArray) -> bool:
    """Return whether point m has another direction from its link than all those chosen; false if one is missing."""
    for c in chosen:  # noqa: SIM110  compiled code knows no generators
        if c < 0 or c == m or dot(direction[c], direction[m]) > _APART:
            return False
    return True


@kernel
def _gap(points: FloatArray, m: int, capsules: Capsules) -> float:
    """Return the distance [m] of point m from the nearest placed capsule, negative inside."""
    least = np.inf
    for c in range(len(capsules.radius)):
        least = min(least, to_axis(points, m, capsules.a, capsules.b, c)[1] - capsules.radius[c])
    return least


@kernel
def _move(capsules: Capsules, chain: Chain, age: float, moved: Capsules) -> None:
    """Write the placed capsules of the arm `age` [s] before to `moved`, to first order."""
    for c in range(len(capsules.link)):
        for end, out in ((capsules.a, moved.a), (capsules.b, moved.b)):
            x, y, z = point_velocity(chain, capsules.link[c], end[c, 0], end[c, 1], end[c, 2])
            out[c, 0], out[c, 1], out[c, 2] = end[c, 0] - age * x, end[c, 1] - age * y, end[c, 2] - age * z


@kernel
def _on_planes(points: FloatArray, m: int, planes: FloatArray, within: float) -> bool:
    """Return whether point m is within a distance [m] of a plane, or behind it."""
    for p in range(len(planes)):  # noqa: SIM110  compiled code knows no generators
        if dot(planes[p, :3], points[m]) - planes[p, 3] <= within:
            return True
    return False
