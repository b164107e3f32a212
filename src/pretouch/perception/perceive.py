"""Perception in one call: readings in, obstacles with their closest body points out."""

import math
from typing import Any, NamedTuple

import numpy as np

from pretouch.compiled import entry, flattened, inlined
from pretouch.groups import CapsuleArrays, Chain, Kinematics, Sensors, SkinArrays
from pretouch.params import PerceptionParams
from pretouch.perception.chosen_points import PointNumbers
from pretouch.perception.closest import ClosestArrays, closest, distances, no_obstacles
from pretouch.perception.motion_compensation import LastSeen, closing_speeds, follow_points, move_back, reckon
from pretouch.perception.obstacles import (
    HEARD,
    SEEN,
    USED,
    NewReadings,
    TrackState,
    bring_nearer,
    give_up,
    locate,
    looks_at,
    measured,
    measured_distance,
    newer,
    pose_into,
    take_in,
    tells_anything,
    widen,
)
from pretouch.perception.scene_filter import Fixtures, leave_out, leave_out_planes
from pretouch.robot.model import RobotModel
from pretouch.robot.vectors import placed_capsules, rotate
from pretouch.sensing.skin import Skin
from pretouch.types import WHOLE, BoolArray, FloatArray, IntArray, Obstacles, RangeReadings, RobotState
from pretouch.values import value


@value
class Perception:
    """What one step sees."""

    obstacles: Obstacles
    distance: FloatArray
    """(K,) what each reading stands for [m]; NaN where it shows no target."""
    nearest: float
    """Distance of the nearest obstacle from the end-effector origin [m], infinite if there is none."""
    longest_silence: float
    """Time since the unit that has been silent for longest reported anything [s]."""


class Scene(NamedTuple):
    """What is known to be there: the arm, and what stands around it."""

    arm: CapsuleArrays
    """The whole arm."""
    body: CapsuleArrays
    """The part of it that joints move."""
    others: CapsuleArrays
    """Of fixtures."""
    planes: FloatArray
    """(P, 4) of fixtures."""
    moved_by: BoolArray
    """(L, n) whether a joint moves a link."""
    ee: int
    """Index of the end-effector's link."""


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


@value
class PerceptionSetup:
    """What perception is made with, once: an arm, its skin, its surroundings and parameters."""

    model: RobotModel
    skin: Skin
    fixtures: Fixtures
    params: PerceptionParams
    fields: tuple[Any, ...]
    """Of scene, skin and numbers, for compiled code."""
    outside: PointNumbers | None
    """What is taken of the parameters for points of outside sources; None where they are not looked at."""


def perception_setup(model: RobotModel, skin: Skin, fixtures: Fixtures, params: PerceptionParams) -> PerceptionSetup:
    """Return what `perceive` is made with."""
    p = params
    scene = Scene(
        model.capsules.arrays, model.body.arrays, fixtures.capsules.arrays, fixtures.planes, model.moved_by,
        model.ee,
    )  # fmt: skip
    estimates, memory = p.closing is not None, math.inf if p.closing is None else p.closing.memory_s
    numbers = SightNumbers(
        p.persistence_s, p.self_margin_m or 0.0, p.self_aside_m, p.self_margin_m is not None, estimates, memory,
        p.reckon_below_minimum, p.silent_after_s if p.keep_while_silent else 0.0,
        p.out_of_view_s, 0.0 if skin.exact else p.spread_sigmas,
    )  # fmt: skip
    o = p.outside
    points = None if o is None else PointNumbers(
        o.persistence_s, o.hidden_s, o.margin_m, o.per_link, p.spread_sigmas, estimates, memory,
        o.silent_after_s if p.keep_while_silent else 0.0,
    )  # fmt: skip
    return PerceptionSetup(model, skin, fixtures, params, flattened(scene, skin.arrays, numbers), points)


def nothing_seen(readings: RangeReadings, skin: Skin) -> Perception:
    """Return what is seen without a unit, or where nobody looks."""
    return Perception(no_obstacles(), measured_distance(readings, skin.cones), np.inf, 0.0)


def perceive(
    state: TrackState, setup: PerceptionSetup, kin: Kinematics, readings: RangeReadings, now: float,
    robot: RobotState | None = None,
) -> tuple[Perception, TrackState]:  # fmt: skip
    """Locate what the units see (eq. 1), leave out the arm and fixtures, and find the closest body points.

    `robot` is the state that `kin` is of: with it and the switch for it, a reading is placed from where its unit was at
    the stamp.

    Where the skin says how uncertain the places of its units are, distances are less by the points' spread, and the
    arm and fixtures are expected earlier by it.
    """
    params, count = setup.params, len(setup.skin)
    if count == 0:
        return nothing_seen(readings, setup.skin), state
    # a step is pure: what compiled code writes to is copied first
    motion = state.motion if params.closing is None else state.motion.copy()
    tracks = TrackState(state.point.copy(), state.direction.copy(), state.times.copy(), motion)
    moving = robot if params.place_at_stamp else None
    distance = np.empty(count)
    indices, vectors, scalars = np.empty((2, count), WHOLE), np.empty((3, count, 3)), np.zeros((3, count))
    # The fields of _Tracks, _Readings, Instant, _Room and Kinematics in their order, which nothing checks, then those
    # that stay the same. Given as groups they would cost 1 us more (docs/explanation/design.md).
    found, nearest, oldest = _perceive.flat(
        tracks.point, tracks.direction, tracks.times, tracks.motion,
        readings.stamp, readings.distance, readings.status,
        now, moving is not None, 0.0 if moving is None else moving.stamp, _NO_JOINT if moving is None else moving.qd,
        distance, indices, vectors, scalars, *kin, *setup.fields,
    )  # fmt: skip
    obstacles = Obstacles(
        unit=indices[0, :found], link=indices[1, :found],
        point=vectors[0, :found], body_point=vectors[1, :found], direction=vectors[2, :found],
        ee_distance=scalars[0, :found], body_distance=scalars[1, :found],
        closing_speed=scalars[2, :found],
    )  # fmt: skip
    return Perception(obstacles, distance, nearest, now - oldest), tracks


_NO_JOINT = np.zeros(0)


class Instant(NamedTuple):
    """When a step is, and how the arm moves."""

    now: float
    """[s]"""
    moves: bool
    """Whether readings are placed from where their units were at the stamp."""
    posed: float
    """Instant of the arm's posture [s]; without meaning, as the next, if not."""
    qd: FloatArray
    """(n,) joint velocities [rad/s]."""


class _Tracks(NamedTuple):
    """As `TrackState`."""

    point: FloatArray
    direction: FloatArray
    times: FloatArray
    motion: FloatArray


class _Readings(NamedTuple):
    """As `RangeReadings`."""

    stamp: FloatArray
    distance: FloatArray
    status: IntArray


class _Room(NamedTuple):
    """Room for K obstacles."""

    distance: FloatArray
    """(K,) what each reading stands for [m]."""
    indices: IntArray
    """(2, K) unit and link."""
    vectors: FloatArray
    """(3, K, 3) point, body point and direction."""
    scalars: FloatArray
    """(3, K) distance from end-effector and body, closing speed."""


@entry
def _perceive(
    tracks: _Tracks, readings: _Readings, instant: Instant, room: _Room, kin: Kinematics, scene: Scene,
    skin: SkinArrays, p: SightNumbers,
) -> tuple[int, float, float]:  # fmt: skip
    """Change the tracks, write obstacles.

    Returns how many there are, the distance of the nearest from the end-effector, and when the unit that is silent for
    longest last reported anything.
    """
    now, times, distance = instant.now, tracks.times, room.distance
    measured(readings.distance, readings.status, skin.cones, distance)

    # which readings are new, show what is not known to be there, and where
    fresh, any_fresh = newer(times[USED], readings.stamp, now), False
    for k in range(len(fresh)):
        any_fresh = any_fresh or fresh[k]
    # casting cones is what a new reading costs: a step without one leaves it out
    if any_fresh:
        _take_readings(tracks, kin, scene, skin, readings, p, instant, NewShown(distance, fresh))

    # the points, as long as they last
    unit, link, near, body_point, direction = (
        room.indices[0], room.indices[1], room.vectors[0], room.vectors[1], room.vectors[2],
    )  # fmt: skip
    ee_distance, body_distance = room.scalars[0], room.scalars[1]
    found = 0
    for k in range(len(unit)):
        # nothing was heard since the point was seen: silence is no free space, and keeps it for `silence_s`
        unanswered = times[HEARD, k] <= times[SEEN, k]
        lasts = max(p.persistence_s, p.silence_s) if unanswered else p.persistence_s
        if p.out_of_view_s > lasts and not looks_at(kin, skin, k, tracks.point[k]):
            lasts = p.out_of_view_s
        if now - times[SEEN, k] <= lasts:
            unit[found] = k
            for i in range(3):
                near[found, i], direction[found, i] = tracks.point[k, i], tracks.direction[k, i]
            if np.isnan(direction[found, 0]):
                # in place of a direction from the body that never was, the one the unit looks in
                rotate(kin.rotation[skin.link[k]], skin.T_link_sensor[k, :3, 2], direction[found])
            found += 1

    # the body's closest points to them
    near, direction = near[:found], direction[:found]
    closest(placed_capsules(scene.body, kin), near, ClosestArrays(body_point, link, direction, body_distance))
    distances(near, kin.position[scene.ee], ee_distance)
    if p.sigmas > 0:
        # only the distances: direction and body point stay those of the point of eq. 1
        bring_nearer(body_distance, ee_distance, near, unit, p.sigmas, skin, kin)
    if p.estimates:
        closing_speeds(tracks.motion, unit[:found], direction, room.scalars[2])
    nearest, oldest = np.inf, np.inf
    for m in range(found):
        nearest = min(nearest, ee_distance[m])
        for i in range(3):
            tracks.direction[unit[m], i] = direction[m, i]
    for k in range(len(unit)):
        oldest = min(oldest, times[HEARD, k])
    return found, nearest, oldest


class NewShown(NamedTuple):
    """What readings stand for."""

    distance: FloatArray
    """(K,) [m], NaN for nothing."""
    fresh: BoolArray
    """(K,) whether each is new."""


@inlined
def _take_readings(
    tracks: _Tracks, kin: Kinematics, scene: Scene, skin: SkinArrays, readings: _Readings, p: SightNumbers,
    instant: Instant, shown: NewShown,
) -> None:  # fmt: skip
    """Take the readings that are new and show what is not known to be there into the tracks."""
    times, distance, fresh, now, cones = tracks.times, shown.distance, shown.fresh, instant.now, skin.cones
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
        leave_out(shows, fresh, distance, ends, p.aside_m, sensors, placed_capsules(scene.arm, kin), cones)
    if instant.moves:
        # fixtures stand still, and are seen from where the units were; the arm's own links go along with them
        chain = Chain(kin.anchor, kin.axis, scene.moved_by, instant.qd)
        # changes `position` and `rotation`, the arrays of `sensors`, for all that follows
        move_back(sensors, fresh, readings.stamp, chain, instant.posed, p.persistence_s)
    if p.filters:
        leave_out(shows, fresh, distance, ends, p.aside_m, sensors, placed_capsules(scene.others, kin), cones)
        leave_out_planes(shows, fresh, ends, sensors, scene.planes, cones)
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
    new = NewReadings(readings.stamp, points, fresh, shows, tells)
    take_in(tracks.point, times, new, now, p.persistence_s)
