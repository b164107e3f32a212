"""Positions of sensed obstacles: eq. 1, the readings that count, their instants, the spread of a point, and silence."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.params import LocalMapParams, OutsidePoints, PerceptionParams
from pretouch.robot.body import Capsules
from pretouch.robot.kinematics import Chain, Kinematics, point_velocity
from pretouch.sensing.sensor import Cones, Sensors
from pretouch.sensing.skin import Skin, SkinArrays
from pretouch.types import BoolArray, FloatArray, IntArray, Number, Obstacles, RangeStatus


class Sight(NamedTuple):
    """Constants of perception: units, arm and fixtures."""

    sees: bool
    """True if there are units and the profile has perception."""
    filters: bool
    """True if readings of the arm and of fixtures are left out."""
    margin_m: float
    """Distance before arm or fixture from which a reading belongs to it [m]."""
    remembers: bool
    """True if seen places are remembered; False: each unit's last point."""
    sigmas: float
    """Standard deviations of a unit's pose that shorten distances, 0 where all poses are exact."""
    arm: Capsules
    """All capsules of the arm."""
    body: Capsules
    """Capsules that joints move."""
    planes: Annotated[FloatArray, "P", 4]
    """(P, 4) planes of fixtures."""
    skin: SkinArrays
    late: Annotated[FloatArray, "K"]
    """(K,) time by which readings of each unit may be older than `persistence_s` [s]."""
    part: Annotated[IntArray, "L"]
    """(L,) number of each link among those that joints move."""
    perception: PerceptionParams
    memory: LocalMapParams
    outside: OutsidePoints


class TrackState(NamedTuple):
    """The last point of each of K units; NaN and -inf without one."""

    point: Annotated[FloatArray, "K", 3]
    """(K, 3) obstacle position, base frame [m]."""
    point_stamp: Annotated[FloatArray, "K"]
    """(K,) stamp of the measurement of the point [s]."""
    reading_stamp: Annotated[FloatArray, "K"]
    """(K,) stamp of the newest reading that was used [s]."""
    report_stamp: Annotated[FloatArray, "K"]
    """(K,) stamp of the newest reading with information, see `is_informative` [s]."""
    motion: Annotated[FloatArray, 2, "K", 3]
    """(2, K, 3) smoothed position [m] and velocity [m/s] of each point, where places are remembered."""


def track_init(units: int) -> TrackState:
    """Return the state before any reading."""
    never, nowhere = np.full(units, -np.inf), np.full((2, units, 3), np.nan)
    return TrackState(nowhere[0].copy(), never, never.copy(), never.copy(), nowhere)


@compiled
def placed_sensors(skin: SkinArrays, kin: Kinematics) -> Sensors:
    """Return the poses of a skin's sensors in a posture: T_O_link @ T_link_sensor."""
    position, rotation = np.empty((len(skin.link), 3)), np.empty((len(skin.link), 3, 3))
    for k in range(len(skin.link)):
        m = skin.link[k]
        pose_into(kin.position[m], kin.rotation[m], skin.T_link_sensor[k], position[k], rotation[k])
    return Sensors(position, rotation, skin.link)


@kernel
def pose_into(p: FloatArray, R: FloatArray, T: FloatArray, position: FloatArray, rotation: FloatArray) -> None:
    """Write the pose, (3,) and (3, 3), of a sensor at T_link_sensor (4, 4) on a link with position and rotation."""
    for i in range(3):
        # row i of R_O_link; written out, for calling a linear algebra library for 3 x 3 numbers is slow
        x, y, z = R[i, 0], R[i, 1], R[i, 2]
        for j in range(3):
            rotation[i, j] = x * T[0, j] + y * T[1, j] + z * T[2, j]
        position[i] = p[i] + (x * T[0, 3] + y * T[1, 3] + z * T[2, 3])


@compiled
def locate(position: FloatArray, rotation: FloatArray, distance: FloatArray) -> FloatArray:
    """Obstacle positions h_k = r_SUk + R_SUk [0 0 d_k]^T (K, 3) [m] in the base frame, eq. 1 of the paper.

    `position` (K, 3) [m] and `rotation` (K, 3, 3) are the sensors' poses, `distance` (K,) the readings [m].
    """
    point = np.empty((len(distance), 3))
    for k in range(len(distance)):
        for i in range(3):
            point[k, i] = position[k, i] + rotation[k, i, 2] * distance[k]  # R [0 0 d]^T is d times R's third column
    return point


# UM2356: 6 is a valid range whose wrap-around was not checked, 11 one of several pulses merged into one
_TARGET = tuple(int(s) for s in (RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED))
# a target is there, but its distance is not used
_NEAR = (int(RangeStatus.MIN_RANGE), int(RangeStatus.MIN_CLIPPED))
_NO_TARGET = tuple(
    int(s) for s in (RangeStatus.SIGNAL, RangeStatus.SIGMA, RangeStatus.OUT_OF_BOUNDS, RangeStatus.WRAPPED)
)
"""Statuses of a working sensor without a near target: too little light, too noisy, or beyond its range."""


@compiled
def measured(distance: FloatArray, status: IntArray, cones: Cones) -> FloatArray:
    """Return the distance (K,) [m] of each reading's target, NaN without a target.

    A target nearer than the sensor can measure counts as at the minimum distance, never as absent. A number beyond
    the range of the sensor is no target, whatever its status.
    """
    target = np.full(len(distance), np.nan)
    for k in range(len(distance)):
        nearest, farthest = cones.range[cones.kind[k]]
        if status[k] in _NEAR:
            target[k] = nearest
        elif status[k] in _TARGET and 0 <= distance[k] <= farthest:  # false for NaN
            target[k] = max(distance[k], nearest)
    return target


@compiled
def is_informative(distance: FloatArray, status: IntArray, target: FloatArray, cones: Cones) -> BoolArray:
    """Return which readings (K,) carry information: a target is there, or none near returns enough light.

    A failure (hardware, synchronisation, cross-talk, no measurement yet, a distance that is negative or NaN) carries
    none, and is no more free space than silence is. A target beyond the range of the sensor is far away. `target` is
    the result of `measured`.
    """
    informative = np.empty(len(status), np.bool_)
    for k in range(len(status)):
        # a number beyond the data sheet's range is no distance, but the sensor works; infinity and NaN are faults
        farthest = cones.range[cones.kind[k], 1]
        far = status[k] in _TARGET and np.isfinite(distance[k]) and distance[k] > farthest
        informative[k] = not np.isnan(target[k]) or far or status[k] in _NO_TARGET
    return informative


@kernel
def move_back(
    sensors: Sensors, moved: BoolArray, stamp: FloatArray, chain: Chain, posed: float, longest: FloatArray
) -> None:
    """Move sensor poses, (K, 3) [m] and (K, 3, 3), from the instant of the arm's posture back to their stamps (K,) [s].

    That is the motion of their links at the joint velocities (n,) [rad/s], to first order in the position; the rotation
    is exact for a constant angular velocity. Only sensors with a flag `moved` (K,) change; `posed` is that of the
    posture [s]. No reading counts as older than `longest` (K,) [s].
    """
    position, rotation, unit_link = sensors
    axis, moved_by, qd = chain.axis, chain.moved_by, chain.qd
    w, turned = np.empty(3), np.empty(3)
    for k in range(len(unit_link)):
        age = min(posed - stamp[k], longest[k])
        # measured after the posture: the further motion of the arm is unknown
        if not moved[k] or not age > 0.0:
            continue
        v = point_velocity(chain, unit_link[k], position[k, 0], position[k, 1], position[k, 2])
        w[:] = 0.0  # the sum of qd_j a_j, over the joints that move the link
        for j in range(len(qd)):
            if moved_by[unit_link[k], j]:
                for i in range(3):
                    w[i] += axis[j, i] * qd[j]
        speed = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        for i in range(3):
            position[k, i] -= age * v[i]  # p(stamp) = p - age v, to first order
        if speed == 0.0:  # without an axis of rotation
            continue
        # R(stamp) = exp(-age [w]) R by the formula of Rodrigues, column by column
        s, c = math.sin(-age * speed), math.cos(age * speed)
        for i in range(3):
            w[i] /= speed
        for column in range(3):
            a, b, d = rotation[k, 0, column], rotation[k, 1, column], rotation[k, 2, column]
            along = (1.0 - c) * (w[0] * a + w[1] * b + w[2] * d)
            turned[0] = c * a + s * (w[1] * d - w[2] * b) + along * w[0]
            turned[1] = c * b + s * (w[2] * a - w[0] * d) + along * w[1]
            turned[2] = c * d + s * (w[0] * b - w[1] * a) + along * w[2]
            for i in range(3):
                rotation[k, i, column] = turned[i]


FASTEST = 2.0
"""Fastest plausible motion of a person's hand [m/s]."""
JUMP_M = 0.06
"""Further difference of two readings of one surface, by noise and the width of the cone [m]."""


@kernel
def follow_points(tracks: TrackState, points: FloatArray, stamp: FloatArray, counts: BoolArray, memory: float) -> None:
    """Update the motion of the tracks by the points (K, 3) [m] of `stamp` (K,) [s] that count (K,).

    A fading-memory filter, the least squares of a straight line with weights that fall by 1/e in `memory` [s]: with
    theta = exp(-dt / memory) it corrects the position by 1 - theta^2 and the velocity by (1 - theta)^2 / dt of the
    prediction error. A point farther from the unit's last than a hand moves belongs to another surface: its motion
    starts anew, with velocity 0. The tracks still contain the last points.
    """
    motion, last = tracks.motion, tracks.point
    for k in range(len(counts)):
        if not counts[k]:
            continue
        dt, away2 = stamp[k] - tracks.point_stamp[k], 0.0
        for i in range(3):
            away2 += (points[k, i] - last[k, i]) ** 2
        # not the first reading, whose dt is infinite, nor one after three memories: e^-3 of the old weight is left then
        continues = not np.isnan(motion[0, k, 0]) and 0.0 < dt <= 3.0 * memory
        if not continues or away2 > (FASTEST * dt + JUMP_M) ** 2:
            for i in range(3):
                motion[0, k, i], motion[1, k, i] = points[k, i], 0.0
            continue
        # The gains of the steady state, from the second reading on: two noisy points alone would give any velocity.
        theta = np.exp(-dt / memory)
        for i in range(3):
            prediction = motion[0, k, i] + dt * motion[1, k, i]
            error = points[k, i] - prediction
            motion[0, k, i] = prediction + (1.0 - theta * theta) * error
            motion[1, k, i] += (1.0 - theta) ** 2 / dt * error


@kernel
def update_tracks(
    tracks: TrackState, stamp: FloatArray, points: FloatArray, flags: tuple[BoolArray, BoolArray, BoolArray]
) -> None:
    """Update the tracks by readings (K,) of `stamp` [s] with points (K, 3) [m].

    `flags` (K,) mark readings that are fresh, that show an obstacle and are young enough, and that are informative. A
    reading with an obstacle replaces its unit's point. One without, or a late one, does not change the point, so a
    single missed reading removes no obstacle.
    """
    fresh, shows, informative = flags
    for k in range(len(stamp)):
        if fresh[k]:
            # a failure is no report, so its unit ages as in silence
            tracks.reading_stamp[k] = stamp[k]
            if informative[k]:
                tracks.report_stamp[k] = stamp[k]
            if shows[k]:
                tracks.point_stamp[k] = stamp[k]
                for i in range(3):
                    tracks.point[k, i] = points[k, i]


@kernel
def newer(last: FloatArray, stamp: FloatArray, now: float) -> BoolArray:
    """Return which units (K,) have a reading newer than their last one, and not from the future.

    A unit whose clock is ahead so falls silent: it must not pass for one that works.
    """
    fresh = np.empty(len(stamp), np.bool_)
    for k in range(len(stamp)):
        fresh[k] = last[k] < stamp[k] <= now  # false for NaN, and for -inf, before the first reading
    return fresh


_FAILURES = {
    int(RangeStatus.HARDWARE): " (it reports a hardware failure)",
    int(RangeStatus.STUCK): " (it repeats the same reading)",
}


@compiled
def speed_factor(silence: float, slow_after: float, silent_after: float) -> float:
    """Return the factor in [0, 1] on the speed after a silence: 1 up to `slow_after` [s], 0 from `silent_after` [s] on.

    Silence is never free space, and neither is a failure. Before the first report the silence is infinite.
    """
    return 1.0 if silence <= slow_after else max(0.0, (silent_after - silence) / (silent_after - slow_after))


def silent_units(skin: Skin, report_stamp: FloatArray, status: IntArray, now: float, silent_after: float) -> str:
    """Return the names of the units without a report for `silent_after` [s]; a unit with zones is named once.

    `report_stamp` (K,) [s] is that of `TrackState`, `status` (K,) that of the last reading.
    """
    silent = np.flatnonzero(now - report_stamp >= silent_after).tolist()
    return ", ".join(dict.fromkeys(skin.boards[k] + _FAILURES.get(int(status[k]), "") for k in silent))


@kernel
def spread(sigmas: float, position_sigma: Number, orientation_sigma: Number, distance: Number) -> Number:
    """Return the spread u = n sqrt(sigma_p^2 + (d sigma_r)^2) [m]: the possible distance of a point from eq. 1's.

    `sigmas` n counts standard deviations, those of the unit's position [m] and orientation [rad] in the worst
    direction; `distance` d [m] is from the unit to the point.
    """
    turned = distance * orientation_sigma  # to first order: lever times angle
    return sigmas * np.sqrt(position_sigma * position_sigma + turned * turned)


@kernel
def widen(ends: FloatArray, sigmas: float, skin: SkinArrays, distance: FloatArray, most: float) -> None:
    """Add its spread, at most `most`, to the `ends` (K,) [m] up to which arm and fixtures explain a reading.

    `distance` (K,) [m] is that of each reading's target.
    """
    for k in range(len(ends)):
        # an obstacle so close to the arm is left out: `most` bounds the distance for a badly placed unit
        ends[k] += min(spread(sigmas, skin.position_sigma[k], skin.orientation_sigma[k], distance[k]), most)


@kernel
def spread_of(point: FloatArray, k: int, sigmas: float, skin: SkinArrays, kin: Kinematics) -> float:
    """Return the spread [m] of a point (3,) of unit k at its present distance from the unit."""
    # with the present pose of the unit, not that of the measurement: at 5 degrees u is wrong by 3 mm at most
    origin, R, away2 = kin.position[skin.link[k]], kin.rotation[skin.link[k]], 0.0
    for i in range(3):
        at = origin[i]
        for j in range(3):
            at += R[i, j] * skin.T_link_sensor[k, j, 3]
        away2 += (point[i] - at) ** 2
    turned = np.sqrt(skin.orientation_sigma[k] ** 2 + skin.cones.spread[skin.cones.kind[k]] ** 2)
    return spread(sigmas, skin.position_sigma[k], turned, np.sqrt(away2))


@kernel
def bring_nearer(obstacles: Obstacles, m: int, u: float) -> None:
    """Subtract a spread u [m] from the distances of obstacle m; direction and body point do not change.

    The distance from the body may become negative (eqs. 5-7), that from the end-effector is at least 0: eq. 3 turns it
    into a factor on the speed.
    """
    obstacles.body_distance[m] -= u
    obstacles.ee_distance[m] = max(0.0, obstacles.ee_distance[m] - u)
