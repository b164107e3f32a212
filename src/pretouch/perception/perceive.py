"""Perception in one call: readings in, obstacles with their closest body points out."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.params import PerceptionParams
from pretouch.perception.closest import closest, distances, no_obstacles
from pretouch.perception.closing import closing_speeds, follow_points, reckon
from pretouch.perception.obstacles import (
    HEARD,
    SEEN,
    USED,
    TrackState,
    locate,
    measured,
    measured_distance,
    newer,
    poses,
    take_in,
    tells_anything,
)
from pretouch.perception.scene_filter import RAYS, Fixtures, leave_out, leave_out_planes
from pretouch.perception.spread import bring_nearer, widen
from pretouch.perception.stamped import move_back
from pretouch.perception.vectors import rotate
from pretouch.robot.body import placed_ends
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import MIN_DISTANCE
from pretouch.types import WHOLE, BoolArray, FloatArray, IntArray, Obstacles, RangeReadings, RangeStatus, RobotState
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
    """Time since the unit that has been silent for longest told anything [s]."""


def perceive(
    state: TrackState,
    model: RobotModel,
    skin: Skin,
    fixtures: Fixtures,
    kin: Kinematics,
    readings: RangeReadings,
    now: float,
    params: PerceptionParams,
    robot: RobotState | None = None,
) -> tuple[Perception, TrackState]:
    """Locate what the units see (eq. 1), leave out the arm and fixtures, and find the closest body points.

    `robot` is the state that `kin` is of: with it and the switch for it, a reading is placed from where its unit was at
    the stamp.

    Where the skin says how uncertain the places of its units are, distances are less by the points' spread, and the
    arm and fixtures are expected earlier by it.
    """
    if not params.enabled or len(skin) == 0:
        return Perception(no_obstacles(), measured_distance(readings), np.inf, 0.0), state
    arm, body, others, count = model.capsules, model.body, fixtures.capsules, len(skin)
    motion = state.motion.copy() if params.closing_speed else state.motion
    tracks = TrackState(state.point.copy(), state.direction.copy(), state.times.copy(), motion)
    moving = robot if params.place_at_stamp else None
    distance = np.empty(count)
    indices, vectors, scalars = np.empty((2, count), WHOLE), np.empty((3, count, 3)), np.zeros((3, count))
    found, nearest, oldest = _perceive(
        tracks.point, tracks.direction, tracks.times, tracks.motion,
        kin.position, kin.rotation, model.ee, skin.link, skin.T_link_sensor,
        kin.anchor, kin.axis, model.moved_by, _NO_JOINT if moving is None else moving.qd,
        0.0 if moving is None else moving.stamp,
        readings.stamp, readings.distance, readings.status, now,
        arm.link, arm.a, arm.b, arm.radius, body.link, body.a, body.b, body.radius,
        others.link, others.a, others.b, others.radius, fixtures.planes, RAYS,
        params.persistence_s, params.self_margin_m, params.filter_views,
        params.closing_memory_s if params.closing_speed else 0.0, params.reckon_below_minimum,
        params.silent_after_s if params.keep_while_silent else 0.0,
        0.0 if skin.exact else params.spread_sigmas, skin.position_sigma, skin.orientation_sigma,
        distance, indices, vectors, scalars,
    )  # fmt: skip
    obstacles = Obstacles(
        unit=indices[0, :found], link=indices[1, :found],
        point=vectors[0, :found], body_point=vectors[1, :found], direction=vectors[2, :found],
        ee_distance=scalars[0, :found], body_distance=scalars[1, :found],
        closing_speed=scalars[2, :found],
    )  # fmt: skip
    return Perception(obstacles, distance, nearest, now - oldest), tracks


_NO_JOINT = np.zeros(0)


@compiled
def _perceive(
    point: FloatArray, last_direction: FloatArray, times: FloatArray, motion: FloatArray,
    link_position: FloatArray, link_rotation: FloatArray, ee: int, unit_link: IntArray, T_link_sensor: FloatArray,
    anchor: FloatArray, axis: FloatArray, moved_by: BoolArray, qd: FloatArray, posed: float,
    stamp: FloatArray, reading: FloatArray, status: IntArray, now: float,
    arm_link: IntArray, arm_a: FloatArray, arm_b: FloatArray, arm_radius: FloatArray,
    body_link: IntArray, body_a: FloatArray, body_b: FloatArray, body_radius: FloatArray,
    other_link: IntArray, other_a: FloatArray, other_b: FloatArray, other_radius: FloatArray, planes: FloatArray,
    rays: FloatArray, persistence: float, margin: float, filter_views: bool, memory: float, reckoned: bool,
    silence: float, sigmas: float, position_sigma: FloatArray, orientation_sigma: FloatArray,
    distance: FloatArray, indices: IntArray, vectors: FloatArray, scalars: FloatArray,
) -> tuple[int, float, float]:  # fmt: skip
    """Change the tracks (first line of arguments), write obstacles (last line).

    Returns how many there are, the distance of the nearest from the end-effector, and when the unit that is silent for
    longest last told anything.
    """
    measured(reading, status, distance)

    # which readings are new, show what is not known to be there, and where
    fresh, any_fresh = newer(times[USED], stamp, now), False
    for k in range(len(fresh)):
        any_fresh = any_fresh or fresh[k]
    if any_fresh:
        position, rotation = poses(link_position, link_rotation, unit_link, T_link_sensor)
        tells, shows = tells_anything(reading, status, distance), np.empty(len(distance), np.bool_)
        ends = distance + margin
        for k in range(len(shows)):
            shows[k] = not np.isnan(distance[k])
        if filter_views:
            arm_from, arm_to = placed_ends(arm_link, arm_a, arm_b, link_position, link_rotation)
            if sigmas > 0:
                widen(ends, sigmas, position_sigma, orientation_sigma, distance, margin)
            leave_out(shows, fresh, ends, position, rotation, unit_link, arm_link, arm_from, arm_to, arm_radius, rays)
        if len(qd):
            # fixtures stand still, and are seen from where the units were; the arm's own links go along with them
            move_back(position, rotation, unit_link, anchor, axis, moved_by, qd, stamp, posed, persistence)
        if filter_views:
            other_from, other_to = placed_ends(other_link, other_a, other_b, link_position, link_rotation)
            leave_out(
                shows, fresh, ends, position, rotation, unit_link, other_link, other_from, other_to, other_radius, rays
            )
            leave_out_planes(shows, fresh, ends, position, rotation, planes, rays)
        points = locate(position, rotation, distance)
        if reckoned:
            reckon(
                points, distance, point, times[SEEN], stamp, motion, position, rotation, MIN_DISTANCE, 3 * persistence
            )
        if memory > 0:
            taken = fresh & shows & (now - stamp <= persistence)
            follow_points(motion, point, times[SEEN], points, stamp, taken, memory)
        take_in(point, times, stamp, points, fresh, shows, tells, now, persistence)

    # the points, as long as they last
    unit, link, near, body_point, direction = indices[0], indices[1], vectors[0], vectors[1], vectors[2]
    ee_distance, body_distance = scalars[0], scalars[1]
    found = 0
    for k in range(len(unit)):
        unanswered = times[HEARD, k] <= times[SEEN, k]
        if now - times[SEEN, k] <= (max(persistence, silence) if unanswered else persistence):
            unit[found] = k
            for i in range(3):
                near[found, i], direction[found, i] = point[k, i], last_direction[k, i]
            if np.isnan(direction[found, 0]):
                # in place of a direction from the body that never was, the one the unit looks in
                rotate(link_rotation[unit_link[k]], T_link_sensor[k, :3, 2], direction[found])
            found += 1

    # the body's closest points to them
    near, direction = near[:found], direction[:found]
    body_from, body_to = placed_ends(body_link, body_a, body_b, link_position, link_rotation)
    closest(body_link, body_from, body_to, body_radius, near, body_point, link, direction, body_distance)
    distances(near, link_position[ee], ee_distance)
    if sigmas > 0:
        bring_nearer(
            body_distance, ee_distance, near, unit, sigmas, position_sigma, orientation_sigma, unit_link, T_link_sensor,
            link_position, link_rotation,
        )  # fmt: skip
    if memory > 0:
        closing_speeds(motion, unit[:found], direction, scalars[2])
    nearest, oldest = np.inf, np.inf
    for m in range(found):
        nearest = min(nearest, ee_distance[m])
        for i in range(3):
            last_direction[unit[m], i] = direction[m, i]
    for k in range(len(unit)):
        oldest = min(oldest, times[HEARD, k])
    return found, nearest, oldest


_FAILURES = {
    int(RangeStatus.HARDWARE): " (it reports a hardware failure)",
    int(RangeStatus.STUCK): " (it repeats the same reading)",
}


def silent_units(
    skin: Skin, state: TrackState, status: IntArray, silence: float, now: float, params: PerceptionParams
) -> tuple[float, str]:
    """Factor in [0, 1] on the speed for units that fall silent, and the names of those that are.

    Silence is never free space, and neither is a failure: from `slow_after_s` without a reading that tells anything the
    arm slows, at `silent_after_s` it stands. `silence` [s] is the longest of any unit, `status` (K,) what the units
    reported last.
    """
    if silence <= params.slow_after_s:
        return 1.0, ""
    silent = np.flatnonzero(now - state.heard >= params.silent_after_s).tolist()
    names = ", ".join(skin.ids[k] + _FAILURES.get(int(status[k]), "") for k in silent)
    return max(0.0, (params.silent_after_s - silence) / (params.silent_after_s - params.slow_after_s)), names
