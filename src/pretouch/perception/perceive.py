"""Perception in one call: readings in, obstacles with their closest body points out."""

import math
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, inlined, kernel
from pretouch.groups import CapsuleArrays, Chain, Kinematics, Obstacles, Sensors, first_of
from pretouch.params import PerceptionParams
from pretouch.perception.closest import ClosestArrays, closest, distances
from pretouch.perception.motion_compensation import LastSeen, closing_speeds, follow_points, move_back, reckon
from pretouch.perception.obstacles import (
    HEARD,
    SEEN,
    USED,
    TrackState,
    bring_nearer,
    give_up,
    locate,
    looks_at,
    measured,
    newer,
    pose_into,
    take_in,
    tells_anything,
    widen,
)
from pretouch.perception.scene_filter import leave_out, leave_out_planes
from pretouch.robot.vectors import placed_capsules
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from pretouch.line_records import Seen, Sight


class SightNumbers(NamedTuple):
    """What perception takes of its parameters."""

    persistence_s: float
    margin_m: float
    """Distance before what is known to be there from which on a reading is explained by it."""
    aside_m: float
    """By how much it may lie beside what a unit is believed to see."""
    filters: bool
    """Whether readings are explained at all."""
    estimates: bool
    """Whether closing speeds are estimated."""
    memory_s: float
    """Memory of these estimates."""
    reckons: bool
    """Whether points nearer than a sensor measures are placed where they were last seen."""
    silence_s: float
    """How long the point of a silent unit is kept, 0 for no longer than others."""
    out_of_view_s: float
    """How long the point is kept that its unit no longer looks at."""
    sigmas: float
    """How many standard deviations of a unit's place are taken off, 0 where all places are exact."""


def sight_numbers(p: PerceptionParams, skin: Skin) -> SightNumbers:
    """Return what perception with a skin takes of its parameters."""
    return SightNumbers(
        p.persistence_s, p.self_margin_m or 0.0, p.self_aside_m, p.self_margin_m is not None, p.closing is not None,
        math.inf if p.closing is None else p.closing.memory_s, p.reckon_below_minimum,
        p.silent_after_s if p.keep_while_silent else 0.0, p.out_of_view_s, 0.0 if skin.exact else p.spread_sigmas,
    )  # fmt: skip


class Readings(NamedTuple):
    """As `RangeReadings`."""

    stamp: Annotated[FloatArray, "K"]
    distance: Annotated[FloatArray, "K"]
    status: Annotated[IntArray, "K"]


@kernel
def perceive(
    sight: "Sight", tracks: TrackState, readings: Readings, seen: "Seen", posture: tuple[Kinematics, Chain, FloatArray],
    instants: tuple[float, float], beside: CapsuleArrays,
) -> tuple[int, float, float]:  # fmt: skip
    """Locate what the units see (eq. 1), leave out the arm and fixtures, and find the closest body points.

    Changes the tracks, writes obstacles, and what each reading stands for, (K,) [m], NaN for no target. Where the skin
    says how uncertain the places of its units are, distances are less by the points' spread, and the arm and fixtures
    are expected earlier by it.

    `posture` has the end-effector origin (3,) [m] too; `instants` are that of the step and that of the posture [s].
    Returns how many obstacles there are, the distance of the nearest from the end-effector, and when the unit that is
    silent for longest last reported anything.
    """
    skin, p, times, room, distance = sight.skin, sight.numbers, tracks.times, seen.near, seen.distance
    (kin, _, ee), now = posture, instants[0]
    measured(readings.distance, readings.status, skin.cones, distance)

    # which readings are new, show what is not known to be there, and where
    fresh, any_fresh = newer(times[USED], readings.stamp, now), False
    for k in range(len(fresh)):
        any_fresh = any_fresh or fresh[k]
    # casting cones is what a new reading costs: a step without one leaves it out
    if any_fresh:
        _take_readings(sight, tracks, readings, seen, fresh, posture, instants, beside)

    keeps = lasting(times, p.persistence_s, p.silence_s)
    for k in range(len(keeps)):
        if p.out_of_view_s > keeps[k] and not looks_at(kin, skin, k, tracks.point[k]):
            keeps[k] = p.out_of_view_s
    found = show(tracks, keeps, now, placed_capsules(sight.body, kin), ee, p.estimates, room)
    if p.sigmas > 0:
        # only the distances: direction and body point stay those of the point of eq. 1
        bring_nearer(room.body_distance, room.ee_distance, room.point[:found], room.unit, p.sigmas, skin, kin)
    nearest, oldest = np.inf, np.inf
    for m in range(found):
        nearest = min(nearest, room.ee_distance[m])
    for k in range(len(distance)):
        oldest = min(oldest, times[HEARD, k])
    return found, nearest, oldest


@compiled
def lasting(times: FloatArray, persistence: float, silence: float) -> FloatArray:
    """For how long each point of a `TrackState` is kept (K,) [s], by its times (3, K)."""
    keeps = np.full(times.shape[1], persistence)
    for k in range(len(keeps)):
        # nothing was heard since the point was seen: silence is no free space, and keeps it longer
        if times[HEARD, k] <= times[SEEN, k]:
            keeps[k] = max(persistence, silence)
    return keeps


@compiled
def show(
    tracks: TrackState, keeps: FloatArray, now: float, body: CapsuleArrays, ee: FloatArray, estimates: bool,
    room: Obstacles,
) -> int:  # fmt: skip
    """Write the obstacles whose points last, and the placed body's closest points to them; return how many.

    The tracks keep the directions. `keeps` (K,) [s] is for how long each lasts, `ee` (3,) the end-effector origin [m].
    """
    found = 0
    for k in range(len(keeps)):
        if now - tracks.times[SEEN, k] <= keeps[k]:
            room.unit[found] = k
            for i in range(3):
                room.point[found, i], room.direction[found, i] = tracks.point[k, i], tracks.direction[k, i]
            if np.isnan(tracks.direction[k, 0]):  # of outside points: it stays only for one on a capsule's axis
                room.direction[found, 0], room.direction[found, 1], room.direction[found, 2] = 0.0, 0.0, 1.0
            found += 1
    o = first_of(room, found)
    closest(body, o.point, ClosestArrays(o.body_point, o.link, o.direction, o.body_distance))
    distances(o.point, ee, o.ee_distance)
    o.closing_speed[:] = 0.0
    if estimates:
        closing_speeds(tracks.motion, o.unit, o.direction, o.closing_speed)
    for m in range(found):
        for i in range(3):
            tracks.direction[o.unit[m], i] = o.direction[m, i]
    return found


@inlined
def _take_readings(
    sight: "Sight", tracks: TrackState, readings: Readings, seen: "Seen", fresh: BoolArray,
    posture: tuple[Kinematics, Chain, FloatArray], instants: tuple[float, float], beside: CapsuleArrays,
) -> None:  # fmt: skip
    """Take the readings that are new and show what is not known to be there into the tracks."""
    skin, p, times, distance, cones = sight.skin, sight.numbers, tracks.times, seen.distance, sight.skin.cones
    (kin, chain, _), (now, posed) = posture, instants
    position, rotation = np.zeros((len(fresh), 3)), np.zeros((len(fresh), 3, 3))
    for k in range(len(fresh)):
        if fresh[k]:
            m = skin.link[k]
            pose_into(kin.position[m], kin.rotation[m], skin.T_link_sensor[k], position[k], rotation[k])
    sensors = Sensors(position, rotation, skin.link)
    tells, shows = tells_anything(readings.distance, readings.status, distance, cones), ~np.isnan(distance)
    # a return expected before `ends`, up to `margin_m` behind the reading, explains it: nothing is seen through a body
    ends = distance + p.margin_m
    if p.filters:
        if p.sigmas > 0:
            widen(ends, p.sigmas, skin.position_sigma, skin.orientation_sigma, distance, p.margin_m)
        leave_out(shows, fresh, distance, ends, p.aside_m, sensors, placed_capsules(sight.arm, kin), cones)
    if sight.at_stamp:
        # fixtures stand still, and are seen from where the units were; the arm's own links go along with them
        # changes `position` and `rotation`, the arrays of `sensors`, for all that follows
        move_back(sensors, fresh, readings.stamp, chain, posed, p.persistence_s)
    if p.filters:
        leave_out(shows, fresh, distance, ends, p.aside_m, sensors, beside, cones)
        leave_out_planes(shows, fresh, ends, sensors, sight.planes, cones)
    points = locate(position, rotation, distance)  # eq. 1
    # both look at what was seen last, before `take_in` overwrites it
    if p.reckons:
        before = LastSeen(tracks.point, times[SEEN], tracks.motion)
        reckon(points, distance, readings.stamp, before, sensors, cones, 3 * p.persistence_s)
    if p.estimates:
        taken = fresh & shows & (now - readings.stamp <= p.persistence_s)  # by `take_in`
        follow_points(tracks.motion, tracks.point, times[SEEN], points, readings.stamp, taken, p.memory_s)
    if p.out_of_view_s > 0:
        give_up(tracks.point, times[SEEN], sensors, fresh & tells, distance, now - p.persistence_s)
    for k in range(len(fresh)):
        if fresh[k] and shows[k] and np.isnan(tracks.direction[k, 0]):
            # in place of a direction from the body that never was, the one the unit looks in
            tracks.direction[k] = rotation[k, :, 2]
    take_in(tracks, readings.stamp, points, fresh, shows, tells, now, p.persistence_s)
