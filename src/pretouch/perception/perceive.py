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
    drop_refuted,
    is_informative,
    locate,
    looks_at,
    measured,
    newer,
    pose_into,
    spread_of,
    update_tracks,
    widen,
)
from pretouch.perception.scene_filter import leave_out, plane_return
from pretouch.records import Cell, IntCell
from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Chain, Kinematics
from pretouch.sensing.sensor import Sensors
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles, some_of


class Readings(NamedTuple):
    """`RangeReadings` as a record."""

    stamp: Annotated[FloatArray, "K"]
    distance: Annotated[FloatArray, "K"]
    status: Annotated[IntArray, "K"]


class PerceivedScene(NamedTuple):
    """Obstacles near the arm, and the silence of their sources."""

    distance: Annotated[FloatArray, "K"]
    """(K,) distance of each reading's target [m], NaN without a target."""
    near: Obstacles
    sensed: IntCell
    """Number of obstacles of units and outside points."""
    total: IntCell
    """Number with the nearest points of moving fixtures, which come last."""
    nearest: Cell
    """Distance of the nearest obstacle from the end-effector origin [m]."""
    silence_scale: Cell
    """Factor on the speed for units and outside sources that fall silent."""


@kernel
def perceive(
    sight: Sight, memory: tuple[TrackState, OutsideState], readings: Readings, scene: PerceivedScene,
    posture: tuple[Kinematics, Chain, FloatArray], instants: tuple[float, float], beside: Capsules,
) -> tuple[int, float, float]:  # fmt: skip
    """Locate obstacles (eq. 1), leave out the arm and fixtures, and compute the closest body points.

    Updates the tracks; writes the obstacles, those of outside points last, and the distance of each reading's target
    (K,) [m], NaN without one. An uncertain pose of a unit, or an uncertain point, shortens the distances by the spread
    of the points, and lengthens the range in which arm and fixtures explain a reading.

    `posture` includes the end-effector origin (3,) [m]; `instants` are those of the step and of the posture [s].
    Returns the number of obstacles, the distance of the nearest from the end-effector, and the last report of the unit
    that is silent for longest [s].
    """
    skin, p, room, distance = sight.skin, sight.perception, scene.near, scene.distance
    (tracks, outside), (kin, _, ee), now = memory, posture, instants[0]
    distance[:] = measured(readings.distance, readings.status, skin.cones)

    # new readings: those of obstacles, and their points
    fresh, any_fresh = newer(tracks.reading_stamp, readings.stamp, now), False
    for k in range(len(fresh)):
        any_fresh = any_fresh or fresh[k]
    # a new reading costs the casting of cones: a step without one skips it
    if any_fresh:
        _take_readings(sight, tracks, readings, scene, fresh, posture, instants, beside)

    lives = _lives(tracks, p.persistence_s, p.silent_after_s if p.keep_while_silent else 0.0)
    for k in range(len(lives)):
        if p.out_of_view_s > lives[k] and not looks_at(kin, skin, k, tracks.point[k]):
            lives[k] = p.out_of_view_s
    body, estimates = placed(sight.body, kin), sight.memory_s > 0.0
    units = _write_obstacles(tracks, lives, now, (body, ee), estimates, room)
    for m in range(units):
        if sight.sigmas > 0:
            bring_nearer(room, m, spread_of(room.point[m], room.unit[m], sight.sigmas, skin, kin))
    count = units
    if outside.source_stamp[0] > -np.inf:  # false where there was no source
        o = sight.outside
        lives = _lives(outside.tracks, o.persistence_s, o.silent_after_s if p.keep_while_silent else 0.0)
        rest = some_of(room, units, len(room.unit))
        count += _write_obstacles(outside.tracks, lives, now, (body, ee), estimates, rest)
        for m in range(units, count):
            bring_nearer(room, m, p.spread_sigmas * outside.sigma[room.unit[m]])
            room.unit[m] += len(distance)
    nearest, oldest = np.inf, np.inf
    for m in range(count):
        nearest = min(nearest, room.ee_distance[m])
    for k in range(len(distance)):
        oldest = min(oldest, tracks.report_stamp[k])
    return count, nearest, oldest


@kernel
def _lives(tracks: TrackState, persistence: float, silence: float) -> FloatArray:
    """Return the time for which each point stays (K,) [s]."""
    lives = np.full(len(tracks.point_stamp), persistence)
    for k in range(len(lives)):
        # no report since the point: silence is no free space, so the point stays longer
        if tracks.report_stamp[k] <= tracks.point_stamp[k]:
            lives[k] = max(persistence, silence)
    return lives


@kernel
def _write_obstacles(
    tracks: TrackState,
    lives: FloatArray,
    now: float,
    arm: tuple[Capsules, FloatArray],
    estimates: bool,
    room: Obstacles,
) -> int:
    """Write the obstacles of current points, and the closest points of the placed body; return their number.

    The tracks store the directions. `lives` (K,) [s] is the time for which each point stays; `arm` is the body and the
    end-effector origin (3,) [m].
    """
    count, (body, ee) = 0, arm
    for k in range(len(lives)):
        if now - tracks.point_stamp[k] <= lives[k]:
            room.unit[count] = k
            for i in range(3):
                room.point[count, i], room.direction[count, i] = tracks.point[k, i], tracks.direction[k, i]
            if np.isnan(tracks.direction[k, 0]):  # an outside point; it matters only for one on a capsule's axis
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
    sight: Sight, tracks: TrackState, readings: Readings, scene: PerceivedScene, fresh: BoolArray,
    posture: tuple[Kinematics, Chain, FloatArray], instants: tuple[float, float], beside: Capsules,
) -> None:  # fmt: skip
    """Update the tracks by the new readings; those of the arm and of fixtures are no obstacles."""
    skin, p, distance, cones = sight.skin, sight.perception, scene.distance, sight.skin.cones
    (kin, chain, _), (now, posed) = posture, instants
    position, rotation = np.zeros((len(fresh), 3)), np.zeros((len(fresh), 3, 3))
    for k in range(len(fresh)):
        if fresh[k]:  # at 1 kHz one of twenty is
            m = skin.link[k]
            pose_into(kin.position[m], kin.rotation[m], skin.T_link_sensor[k], position[k], rotation[k])
    sensors = Sensors(position, rotation, skin.link)
    informative = is_informative(readings.distance, readings.status, distance, cones)
    shows = ~np.isnan(distance)
    # a return expected before `ends`, up to `margin_m` behind the reading, explains it: no beam passes a body
    ends = distance + sight.margin_m
    if sight.filters:
        if sight.sigmas > 0:
            widen(ends, sight.sigmas, skin, distance, sight.margin_m)
        leave_out(shows, fresh, distance, ends, p.self_aside_m, sensors, placed(sight.arm, kin), cones)
    if p.place_at_stamp:
        # fixtures stand still, and the units saw them from their past poses; the arm's links moved with the units.
        # This changes `position` and `rotation`, the arrays of `sensors`, for the rest of the function
        move_back(sensors, fresh, readings.stamp, chain, posed, p.persistence_s)
    if sight.filters:
        leave_out(shows, fresh, distance, ends, p.self_aside_m, sensors, beside, cones)
        for k in range(len(fresh)):
            if fresh[k] and shows[k]:
                shows[k] = plane_return(sensors, k, sight.planes, cones, ends[k]) > ends[k]
    points = locate(position, rotation, distance)  # eq. 1
    # both use the last points, before `update_tracks` overwrites them
    if p.reckon_below_minimum:
        reckon(points, distance, readings.stamp, tracks, sensors, cones, 3 * p.persistence_s)
    if sight.memory_s > 0.0:
        counts = fresh & shows & (now - readings.stamp <= p.persistence_s)  # as in `update_tracks`
        follow_points(tracks, points, readings.stamp, counts, sight.memory_s)
    if p.out_of_view_s > 0:
        drop_refuted(tracks, sensors, fresh & informative, distance, now - p.persistence_s)
    for k in range(len(fresh)):
        if fresh[k] and shows[k] and np.isnan(tracks.direction[k, 0]):
            # without a direction from the body yet, the beam of the unit
            tracks.direction[k] = rotation[k, :, 2]
    update_tracks(tracks, readings.stamp, points, (fresh, shows, informative), now, p.persistence_s)
