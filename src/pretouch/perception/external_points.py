"""Points of outside sources, such as cameras: which of them are obstacles, and how long they last.

Of any number of points at most `per_link` are kept for each link that moves: the one that is nearest to it by
what is certain of their distance, then the nearest one in another direction, and so on. Each has a place of its own,
so a place goes on showing the same side of the same link, as a unit of the skin does. What is on the arm or a fixture
is left out, the arm being where it was when the points were measured.
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
"""A coordinate [m] from here on is implausible: another unit, or a broken message."""
LARGEST_SIGMA = 1.0
"""A standard deviation [m] above this is implausible."""
_ONE_INSTANT = 1e-3
"""Stamps that differ by less [s] are taken as one: in that time no arm moves by more than 2 mm."""
_APART = 0.5
"""Points of one link are kept whose directions from it have at most this cosine: 60 degrees between them."""
_UNKNOWN, _OBSTACLE, _EXPLAINED, _HIDDEN = range(4)


class OutsideState(NamedTuple):
    """What outside sources showed last, in P places: so many for each link that moves, one link after the other."""

    tracks: TrackState
    """`used` is when a point was measured, `seen` when it was last there or hidden; all were heard with the sources."""
    sigma: Annotated[FloatArray, "P"]
    """(P,) standard deviation of each point [m]."""
    heard: Cell
    """Newest instant the sources were heard of [s]: -inf before the first, NaN where there was no source so far."""


def outside_init(places: int, heard: float = math.nan) -> OutsideState:
    """Return what is remembered before the first points."""
    return OutsideState(track_init(places), np.zeros(places), np.full(1, heard))


def outside_silence(heard: float, unfit: str, now: float, params: OutsidePoints | None) -> tuple[float, str]:
    """Factor in [0, 1] on the speed for outside sources that fall silent, and what is wrong with them.

    As with units, silence is no free space: from `slow_after_s` on the arm slows, at `silent_after_s` it stands, and at
    once where `unfit` says what cannot be used of the points given. `heard` [s] is that of `OutsideState`.
    """
    if params is None:
        return 1.0, ""
    if unfit:
        return 0.0, unfit
    if math.isnan(heard):  # where no source was ever heard of, none is missed
        return 1.0, ""
    silence = now - heard
    factor = speed_factor(silence, params.slow_after_s, params.silent_after_s)
    if silence < params.silent_after_s:
        return factor, ""
    return 0.0, "has not been heard yet" if math.isinf(silence) else f"has been silent for {silence:.2f} s"


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


class _Contenders(NamedTuple):
    """M points that stand for election."""

    near: Obstacles
    """With the closest points of the body; the distance from it is less by the point's spread."""
    sigma: FloatArray
    """(M,) [m]."""
    stamp: FloatArray
    """(M,) when each was measured [s]."""
    status: IntArray
    """(M,) what is known of each."""
    first: IntArray
    """(M,) the first of the places of its nearest link."""


@kernel
def take_points(
    sight: Sight, state: OutsideState, new: SeenPoints, posture: tuple[Kinematics, Chain],
    instants: tuple[float, float], fixtures: Capsules,
) -> None:  # fmt: skip
    """Choose the points of each link's places, and change those that are kept.

    Points that were kept before stand for election with the new ones where the arm hides them. A source gives the same
    set until it has a newer one: each is taken in once. One that is newer than the step tells nothing, as with units.

    Args:
        sight: what is looked at, and what is known to be there.
        state: what was kept, changed.
        new: points of the sources.
        posture: of the arm.
        instants: that of the step and that of the posture [s].
        fixtures: placed.
    """
    (kin, chain), (now, posed), tracks = posture, instants, state.tracks
    if np.isnan(state.heard[0]):
        state.heard[0] = -np.inf
    if not state.heard[0] < new.heard <= now:
        return
    state.heard[0] = new.heard
    # where the arm was when the points were measured: it may have moved by more than the margin since; the whole arm
    # explains points, the base too, while only links that move have places for them
    here = placed(sight.arm, kin)
    arm = Capsules(here.link, np.empty_like(here.a), np.empty_like(here.b), here.radius)
    _move(here, chain, posed - new.heard, arm)
    candidates = _candidates(sight, state, new, now, placed(sight.body, kin), arm)
    chosen = np.full(len(state.sigma), -1, np.int64)
    _elect(candidates, chosen, sight, (here, arm, fixtures), new.heard, chain, posed)

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
        tracks.heard[k] = new.heard
        if chosen[k] >= 0:
            tracks.point[k], state.sigma[k], tracks.used[k] = points[k], candidates.sigma[chosen[k]], stamps[k]
            # a hidden point was not seen again: the arm is in front of it, so it is taken to be there still
            tracks.seen[k] = stamps[k] if fresh[k] else new.heard
            if sight.memory_s > 0.0 and not fresh[k]:
                tracks.motion[0, k], tracks.motion[1, k] = points[k], 0.0


@inlined
def _candidates(
    sight: Sight, state: OutsideState, new: SeenPoints, now: float, body: Capsules, arm: Capsules
) -> _Contenders:
    """The kept points that the arm hides and the new ones that are young enough, each with its nearest link."""
    p, sigmas, tracks = sight.outside, sight.perception.spread_sigmas, state.tracks
    room, count = len(new.stamp) + len(state.sigma), 0
    point, sigma, stamp, status = np.empty((room, 3)), np.empty(room), np.empty(room), np.full(room, _UNKNOWN)
    for k in range(len(state.sigma)):
        u = sigmas * state.sigma[k]
        if now - tracks.used[k] > p.hidden_s or now - tracks.seen[k] > p.persistence_s:
            continue
        # within what the filter takes for the arm, no source can show the point; inside the arm it cannot be
        if -u <= _gap(tracks.point, k, arm) <= p.margin_m + u:
            point[count], sigma[count], stamp[count] = tracks.point[k], state.sigma[k], tracks.used[k]
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
    return _Contenders(near, sigma, stamp, status, first)


@inlined
def _elect(
    candidates: _Contenders, chosen: IntArray, sight: Sight, capsules: tuple[Capsules, Capsules, Capsules],
    placed_for: float, chain: Chain, posed: float,
) -> None:  # fmt: skip
    """Write the candidate of each place to `chosen`: of each link the nearest, then the nearest apart from it.

    A candidate is compared with arm and fixtures only once it would win: a cloud has hundreds that never do.
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
    """Whether point m lies in another direction from its link than all those chosen of it; not if one is missing."""
    for c in chosen:  # noqa: SIM110  compiled code knows no generators
        if c < 0 or c == m or dot(direction[c], direction[m]) > _APART:
            return False
    return True


@kernel
def _gap(points: FloatArray, m: int, capsules: Capsules) -> float:
    """Distance [m] of point m from the nearest of some placed capsules, negative inside."""
    least = np.inf
    for c in range(len(capsules.radius)):
        least = min(least, to_axis(points, m, capsules.a, capsules.b, c)[1] - capsules.radius[c])
    return least


@kernel
def _move(capsules: Capsules, chain: Chain, age: float, moved: Capsules) -> None:
    """Write to `moved` where placed capsules of the arm were `age` [s] before, to first order."""
    for c in range(len(capsules.link)):
        for end, out in ((capsules.a, moved.a), (capsules.b, moved.b)):
            x, y, z = point_velocity(chain, capsules.link[c], end[c, 0], end[c, 1], end[c, 2])
            out[c, 0], out[c, 1], out[c, 2] = end[c, 0] - age * x, end[c, 1] - age * y, end[c, 2] - age * z


@kernel
def _on_planes(points: FloatArray, m: int, planes: FloatArray, within: float) -> bool:
    """Whether point m is within a distance [m] of a plane, or behind it."""
    for p in range(len(planes)):  # noqa: SIM110  compiled code knows no generators
        if dot(planes[p, :3], points[m]) - planes[p, 3] <= within:
            return True
    return False
