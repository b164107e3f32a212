"""Perception in one call: readings in, obstacles with their closest body points out."""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import inlined, kernel
from pretouch.perception.closest import closest
from pretouch.perception.external_points import OutsideState
from pretouch.perception.motion_compensation import closing_speeds, follow_points, move_back, reckon
from pretouch.perception.obstacles import (
    Sight,
    TrackState,
    bring_nearer,
    give_up,
    locate,
    looks_at,
    measured,
    newer,
    pose_into,
    spread_of,
    take_in,
    tells_anything,
    widen,
)
from pretouch.perception.scene_filter import leave_out, plane_return
from pretouch.records import Cell, IntCell
from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Chain, Kinematics
from pretouch.sensing.sensor import Sensors
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles, some_of


class Readings(NamedTuple):
    """As `RangeReadings`."""

    stamp: Annotated[FloatArray, "K"]
    distance: Annotated[FloatArray, "K"]
    status: Annotated[IntArray, "K"]


class Seen(NamedTuple):
    """What units and others see, and how well they are heard."""

    distance: Annotated[FloatArray, "K"]
    """(K,) what each reading stands for [m]; NaN where it shows no target."""
    near: Obstacles
    found: IntCell
    """Obstacles that units and outside points show."""
    all: IntCell
    """With the nearest of moving fixtures, behind them."""
    nearest: Cell
    """Distance of the nearest obstacle from the end-effector origin [m]."""
    heard: Cell
    """Factor on the speed for units and outside sources that fall silent."""


@kernel
def perceive(
    sight: Sight, memory: tuple[TrackState, OutsideState], readings: Readings, seen: Seen,
    posture: tuple[Kinematics, Chain, FloatArray], instants: tuple[float, float], beside: Capsules,
) -> tuple[int, float, float]:  # fmt: skip
    """Locate what the units see (eq. 1), leave out the arm and fixtures, and find the closest body points.

    Changes the tracks, writes obstacles, those of outside points last, and what each reading stands for, (K,) [m], NaN
    for no target. Where the place of a unit or of a point is uncertain, distances are less by the points' spread, and
    the arm and fixtures are expected earlier by it.

    `posture` has the end-effector origin (3,) [m] too; `instants` are that of the step and that of the posture [s].
    Returns how many obstacles there are, the distance of the nearest from the end-effector, and when the unit that is
    silent for longest last reported anything.
    """
    skin, p, room, distance = sight.skin, sight.perception, seen.near, seen.distance
    (tracks, outside), (kin, _, ee), now = memory, posture, instants[0]
    distance[:] = measured(readings.distance, readings.status, skin.cones)

    # which readings are new, show what is not known to be there, and where
    fresh, any_fresh = newer(tracks.used, readings.stamp, now), False
    for k in range(len(fresh)):
        any_fresh = any_fresh or fresh[k]
    # casting cones is what a new reading costs: a step without one leaves it out
    if any_fresh:
        _take_readings(sight, tracks, readings, seen, fresh, posture, instants, beside)

    keeps = _lasting(tracks, p.persistence_s, p.silent_after_s if p.keep_while_silent else 0.0)
    for k in range(len(keeps)):
        if p.out_of_view_s > keeps[k] and not looks_at(kin, skin, k, tracks.point[k]):
            keeps[k] = p.out_of_view_s
    body, estimates = placed(sight.body, kin), sight.memory_s > 0.0
    units = _show(tracks, keeps, now, body, ee, estimates, room)
    for m in range(units):
        if sight.sigmas > 0:
            bring_nearer(room, m, spread_of(room.point[m], room.unit[m], sight.sigmas, skin, kin))
    count = units
    if outside.heard[0] > -np.inf:  # false where there was no source
        o = sight.outside
        keeps = _lasting(outside.tracks, o.persistence_s, o.silent_after_s if p.keep_while_silent else 0.0)
        count += _show(outside.tracks, keeps, now, body, ee, estimates, some_of(room, units, len(room.unit)))
        for m in range(units, count):
            bring_nearer(room, m, p.spread_sigmas * outside.sigma[room.unit[m]])
            room.unit[m] += len(distance)
    nearest, oldest = np.inf, np.inf
    for m in range(count):
        nearest = min(nearest, room.ee_distance[m])
    for k in range(len(distance)):
        oldest = min(oldest, tracks.heard[k])
    return count, nearest, oldest


@kernel
def _lasting(tracks: TrackState, persistence: float, silence: float) -> FloatArray:
    """For how long each point is kept (K,) [s]."""
    keeps = np.full(len(tracks.seen), persistence)
    for k in range(len(keeps)):
        # nothing was heard since the point was seen: silence is no free space, and keeps it longer
        if tracks.heard[k] <= tracks.seen[k]:
            keeps[k] = max(persistence, silence)
    return keeps


@kernel
def _show(
    tracks: TrackState, keeps: FloatArray, now: float, body: Capsules, ee: FloatArray, estimates: bool,
    room: Obstacles,
) -> int:  # fmt: skip
    """Write the obstacles whose points last, and the placed body's closest points to them; return how many.

    The tracks keep the directions. `keeps` (K,) [s] is for how long each lasts, `ee` (3,) the end-effector origin [m].
    """
    count = 0
    for k in range(len(keeps)):
        if now - tracks.seen[k] <= keeps[k]:
            room.unit[count] = k
            for i in range(3):
                room.point[count, i], room.direction[count, i] = tracks.point[k, i], tracks.direction[k, i]
            if np.isnan(tracks.direction[k, 0]):  # of outside points: it stays only for one on a capsule's axis
                room.direction[count, 0], room.direction[count, 1], room.direction[count, 2] = 0.0, 0.0, 1.0
            count += 1
    o = some_of(room, 0, count)
    closest(body, o)
    o.closing_speed[:] = 0.0
    if estimates:
        closing_speeds(tracks.motion, o)
    for m in range(count):
        x, y, z = o.point[m, 0] - ee[0], o.point[m, 1] - ee[1], o.point[m, 2] - ee[2]
        o.ee_distance[m] = np.sqrt(x * x + y * y + z * z)
        for i in range(3):
            tracks.direction[o.unit[m], i] = o.direction[m, i]
    return count


@inlined
def _take_readings(
    sight: Sight, tracks: TrackState, readings: Readings, seen: Seen, fresh: BoolArray,
    posture: tuple[Kinematics, Chain, FloatArray], instants: tuple[float, float], beside: Capsules,
) -> None:  # fmt: skip
    """Take the readings that are new and show what is not known to be there into the tracks."""
    skin, p, distance, cones = sight.skin, sight.perception, seen.distance, sight.skin.cones
    (kin, chain, _), (now, posed) = posture, instants
    position, rotation = np.zeros((len(fresh), 3)), np.zeros((len(fresh), 3, 3))
    for k in range(len(fresh)):
        if fresh[k]:  # at 1 kHz one of twenty is
            m = skin.link[k]
            pose_into(kin.position[m], kin.rotation[m], skin.T_link_sensor[k], position[k], rotation[k])
    sensors = Sensors(position, rotation, skin.link)
    tells, shows = tells_anything(readings.distance, readings.status, distance, cones), ~np.isnan(distance)
    # a return expected before `ends`, up to `margin_m` behind the reading, explains it: nothing is seen through a body
    ends = distance + sight.margin_m
    if sight.filters:
        if sight.sigmas > 0:
            widen(ends, sight.sigmas, skin, distance, sight.margin_m)
        leave_out(shows, fresh, distance, ends, p.self_aside_m, sensors, placed(sight.arm, kin), cones)
    if p.place_at_stamp:
        # fixtures stand still, and are seen from where the units were; the arm's own links go along with them
        # changes `position` and `rotation`, the arrays of `sensors`, for all that follows
        move_back(sensors, fresh, readings.stamp, chain, posed, p.persistence_s)
    if sight.filters:
        leave_out(shows, fresh, distance, ends, p.self_aside_m, sensors, beside, cones)
        for k in range(len(fresh)):
            if fresh[k] and shows[k]:
                shows[k] = plane_return(sensors, k, sight.planes, cones, ends[k]) > ends[k]
    points = locate(position, rotation, distance)  # eq. 1
    # both look at what was seen last, before `take_in` overwrites it
    if p.reckon_below_minimum:
        reckon(points, distance, readings.stamp, tracks, sensors, cones, 3 * p.persistence_s)
    if sight.memory_s > 0.0:
        counts = fresh & shows & (now - readings.stamp <= p.persistence_s)  # by `take_in`
        follow_points(tracks, points, readings.stamp, counts, sight.memory_s)
    if p.out_of_view_s > 0:
        give_up(tracks, sensors, fresh & tells, distance, now - p.persistence_s)
    for k in range(len(fresh)):
        if fresh[k] and shows[k] and np.isnan(tracks.direction[k, 0]):
            # in place of a direction from the body that never was, the one the unit looks in
            tracks.direction[k] = rotation[k, :, 2]
    take_in(tracks, readings.stamp, points, fresh, shows, tells, now, p.persistence_s)
