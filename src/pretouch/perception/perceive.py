"""Perception in one call: readings in, obstacles with their closest body points out."""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import inlined, kernel
from pretouch.perception.closest import closest
from pretouch.perception.local_map import LocalMap, Look, carve, height_over, nearest_places, remember, replace_wider
from pretouch.perception.obstacles import (
    Sight,
    TrackState,
    bring_nearer,
    follow_points,
    is_informative,
    locate,
    measured,
    move_back,
    newer,
    pose_into,
    spread,
    spread_of,
    update_tracks,
    widen,
)
from pretouch.perception.scene_filter import leave_out, plane_return
from pretouch.records import Cell, IntCell
from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Chain, Kinematics, separation
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
    sight: Sight, memory: tuple[TrackState, LocalMap], readings: Readings, scene: PerceivedScene,
    posture: tuple[Kinematics, Chain, FloatArray], instants: tuple[float, float], beside: Capsules,
) -> tuple[int, float, float]:  # fmt: skip
    """Locate obstacles (eq. 1), leave out the arm and fixtures, and compute the closest body points.

    Updates the memory; writes the obstacles, and the distance of each reading's target (K,) [m], NaN without one. An
    uncertain pose of a unit, or an uncertain point, shortens the distances by the spread of the points, and lengthens
    the range in which arm and fixtures explain a reading.

    `posture` includes the end-effector origin (3,) [m]; `instants` are those of the step and of the posture [s].
    Returns the number of obstacles, the distance of the nearest from the end-effector, and the last report of the unit
    that is silent for longest [s].
    """
    skin, p, room, distance = sight.skin, sight.perception, scene.near, scene.distance
    (tracks, places), (kin, _, ee), now = memory, posture, instants[0]
    distance[:] = measured(readings.distance, readings.status, skin.cones)

    # new readings: those of obstacles, and their points
    fresh, any_fresh = newer(tracks.reading_stamp, readings.stamp, now), False
    for k in range(len(fresh)):
        any_fresh = any_fresh or fresh[k]
    # a new reading costs the casting of cones: a step without one skips it
    if any_fresh:
        _take_readings(sight, memory, readings, scene, fresh, posture, instants, beside)

    body = placed(sight.body, kin)
    if sight.remembers:
        o = sight.outside
        outside = len(fresh), o.margin_m, (o.persistence_s, o.hidden_s)
        count = nearest_places(places, (body, sight.part, ee), now, sight.memory, outside, room)
    else:
        count = _last_points(tracks, p.persistence_s + sight.late, now, (body, ee), room)
        for m in range(count):
            if sight.sigmas > 0:
                bring_nearer(room, m, spread_of(room.point[m], room.unit[m], sight.sigmas, skin, kin))
    nearest, oldest = np.inf, np.inf
    for m in range(count):
        nearest = min(nearest, room.ee_distance[m])
    for k in range(len(distance)):
        oldest = min(oldest, tracks.report_stamp[k] + sight.late[k])
    return count, nearest, oldest


@inlined
def _last_points(
    tracks: TrackState, lives: FloatArray, now: float, arm: tuple[Capsules, FloatArray], room: Obstacles
) -> int:
    """Write the obstacles of units' last points, while they live (K,) [s]; return their number.

    `arm` is the body and the end-effector origin (3,) [m].
    """
    count, (body, ee) = 0, arm
    for k in range(len(lives)):
        age = now - tracks.point_stamp[k]
        if age <= lives[k]:
            room.unit[count], room.slot[count], room.age[count], room.closing_speed[count] = k, k, age, 0.0
            for i in range(3):
                room.point[count, i], room.direction[count, i] = tracks.point[k, i], 1.0 if i == 2 else 0.0
            room.ee_distance[count] = separation(tracks.point, k, ee)
            count += 1
    closest(body, some_of(room, 0, count))
    return count


@inlined
def _take_readings(
    sight: Sight, memory: tuple[TrackState, LocalMap], readings: Readings, scene: PerceivedScene, fresh: BoolArray,
    posture: tuple[Kinematics, Chain, FloatArray], instants: tuple[float, float], beside: Capsules,
) -> None:  # fmt: skip
    """Update the memory by the new readings; those of the arm and of fixtures are no obstacles."""
    skin, p, distance, cones = sight.skin, sight.perception, scene.distance, sight.skin.cones
    tracks, (kin, chain, _), (now, posed), stamp = memory[0], posture, instants, readings.stamp
    position, rotation = np.zeros((len(fresh), 3)), np.zeros((len(fresh), 3, 3))
    for k in range(len(fresh)):
        if fresh[k]:  # at 1 kHz one of twenty is
            m = skin.link[k]
            pose_into(kin.position[m], kin.rotation[m], skin.T_link_sensor[k], position[k], rotation[k])
    sensors = Sensors(position, rotation, skin.link)
    informative = is_informative(readings.distance, readings.status, distance, cones)
    shows, lives = ~np.isnan(distance), p.persistence_s + sight.late
    # a return expected before `ends`, up to `margin_m` behind the reading, explains it: no beam passes a body
    ends = distance + sight.margin_m
    if sight.filters:
        if sight.sigmas > 0:
            widen(ends, sight.sigmas, skin, distance, sight.margin_m)
        leave_out(shows, fresh, distance, ends, p.self_aside_m, sensors, placed(sight.arm, kin), cones)
    if sight.remembers:
        # fixtures stand still, and the units saw them from their past poses; the arm's links moved with the units.
        # This changes `position` and `rotation`, the arrays of `sensors`, for the rest of the function
        move_back(sensors, fresh, stamp, chain, posed, lives)
    if sight.filters:
        leave_out(shows, fresh, distance, ends, p.self_aside_m, sensors, beside, cones)
        for k in range(len(fresh)):
            if fresh[k] and shows[k]:
                shows[k] = plane_return(sensors, k, sight.planes, cones, ends[k]) > ends[k]
    points = locate(position, rotation, distance)  # eq. 1
    for k in range(len(fresh)):
        # the point of a reading that is too old on arrival would be dropped in this very step
        shows[k] = shows[k] and now - stamp[k] <= lives[k]
    if sight.remembers:
        # it uses the last points, before `update_tracks` overwrites them
        follow_points(tracks, points, stamp, fresh & shows, sight.memory.closing_s)
        young = fresh & informative & (now - stamp <= lives)
        _remember_readings(sight, memory, stamp, distance, (young, shows), sensors, lives)
    update_tracks(tracks, stamp, points, (fresh, shows, informative))


@inlined
def _remember_readings(
    sight: Sight, memory: tuple[TrackState, LocalMap], stamp: FloatArray, distance: FloatArray,
    flags: tuple[BoolArray, BoolArray], sensors: Sensors, lives: FloatArray,
) -> None:  # fmt: skip
    """Remove the places that new readings (K,) show empty, and remember what they show.

    `flags` (K,) mark new readings with information, and those of obstacles; `sensors` are placed as at their
    measurements.
    """
    (tracks, places), (young, shows), p = memory, flags, sight.memory
    cones, free, wait, at = sight.skin.cones, np.full(len(stamp), -np.inf), np.zeros(len(stamp)), np.empty(3)
    for k in range(len(stamp)):
        if young[k] and not np.isnan(distance[k]):
            free[k] = distance[k] + p.fist_m - (p.tolerance_m if shows[k] else sight.margin_m)
        elif young[k]:
            # no target: that has to last longer than a burst of a sensor that misses one
            free[k], wait[k] = cones.range[cones.kind[k], 1], cones.timing[cones.kind[k], 0]
    carve(places, sensors, sight.skin, (stamp, free, wait), p.carve_m)
    for k in range(len(stamp)):
        if not (young[k] and shows[k] and distance[k] <= p.mark_m):
            continue
        kind, beam, velocity = cones.kind[k], sensors.rotation[k, :, 2], tracks.motion[1, k].copy()
        turned = np.sqrt(sight.skin.orientation_sigma[k] ** 2 + cones.spread[kind] ** 2)
        u = spread(sight.sigmas, sight.skin.position_sigma[k], turned, distance[k])
        height, width = distance[k] + p.fist_m, distance[k] * cones.edge[kind, 2]
        look = Look(stamp[k], (lives[k], p.kept_s), width, u, k)
        if distance[k] <= cones.range[kind, 0]:
            # a target at the minimum may be anywhere before it: it is as near as it was seen before
            height = height_over(places, sensors.position[k], beam, height, look)
        for i in range(3):
            at[i] = sensors.position[k, i] + height * beam[i]
        replace_wider(places, at, stamp[k], width)
        remember(places, at, velocity, look, p)
