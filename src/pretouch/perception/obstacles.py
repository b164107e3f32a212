"""Where the sensed obstacles are: eq. 1, which readings count, and how long a point lasts, its spread, and silence."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.params import OutsidePoints, PerceptionParams
from pretouch.robot.body import Capsules
from pretouch.robot.kinematics import Kinematics
from pretouch.sensing.sensor import Cones, Sensors
from pretouch.sensing.skin import Skin, SkinArrays
from pretouch.types import BoolArray, FloatArray, IntArray, Number, Obstacles, RangeStatus


class Sight(NamedTuple):
    """What is seen with, and what is known to be there."""

    sees: bool
    """Whether there are units to see with."""
    filters: bool
    """Whether readings are explained by what is known to be there."""
    margin_m: float
    """Distance before that from which on a reading is explained by it."""
    memory_s: float
    """Memory of the estimates of closing speeds, 0 where there are none."""
    sigmas: float
    """How many standard deviations of a unit's place are taken off, 0 where all places are exact."""
    arm: Capsules
    """All capsules of the arm."""
    body: Capsules
    """Those that joints move."""
    planes: Annotated[FloatArray, "P", 4]
    """(P, 4) of fixtures."""
    skin: SkinArrays
    perception: PerceptionParams
    outside: OutsidePoints


class TrackState(NamedTuple):
    """The last point each of K units showed. NaN and -inf where there is none."""

    point: Annotated[FloatArray, "K", 3]
    """(K, 3) obstacle position, base frame [m]."""
    direction: Annotated[FloatArray, "K", 3]
    """(K, 3) last direction from the body to the point."""
    seen: Annotated[FloatArray, "K"]
    """(K,) instant of the measurement that showed the point [s]."""
    used: Annotated[FloatArray, "K"]
    """(K,) stamp of the newest reading taken into account [s]."""
    heard: Annotated[FloatArray, "K"]
    """(K,) stamp of the newest reading that reported anything [s]."""
    motion: Annotated[FloatArray, 2, "K", 3]
    """(2, K, 3) smoothed place [m] and velocity [m/s] of each unit's point, where closing speeds are estimated."""


def track_init(units: int) -> TrackState:
    """Return the state before any reading."""
    nowhere, never = np.full((units, 3), np.nan), np.full(units, -np.inf)
    return TrackState(nowhere, nowhere.copy(), never, never.copy(), never.copy(), np.full((2, units, 3), np.nan))


def points_of_units(obstacles: Obstacles, units: int) -> FloatArray:
    """Where each unit of a skin shows an obstacle (K, 3) [m], NaN where it shows none; other sources are not in it."""
    points, own = np.full((units, 3), np.nan), obstacles.unit < units
    points[obstacles.unit[own]] = obstacles.point[own]
    return points


@compiled
def placed_sensors(skin: SkinArrays, kin: Kinematics) -> Sensors:
    """Return the sensors of a skin where they are in a posture: T_O_link @ T_link_sensor."""
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
_SHOWN = tuple(int(s) for s in (RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED))
# something is there, but the distance that comes with it is not used
_NEAR = (int(RangeStatus.MIN_RANGE), int(RangeStatus.MIN_CLIPPED))
_NO_TARGET = tuple(
    int(s) for s in (RangeStatus.SIGNAL, RangeStatus.SIGMA, RangeStatus.OUT_OF_BOUNDS, RangeStatus.WRAPPED)
)
"""Statuses of a sensor at work that sees nothing near: too little light, too noisy, or beyond its range."""


@compiled
def measured(distance: FloatArray, status: IntArray, cones: Cones) -> FloatArray:
    """Distance (K,) [m] each reading (K,) stands for, NaN where it shows no target.

    A target nearer than the sensor can measure is taken to be at its minimum distance, never as gone. A number
    beyond what it can measure shows nothing, whatever its status.
    """
    target = np.full(len(distance), np.nan)
    for k in range(len(distance)):
        nearest, farthest = cones.range[cones.kind[k]]
        if status[k] in _NEAR:
            target[k] = nearest
        elif status[k] in _SHOWN and 0 <= distance[k] <= farthest:  # false for NaN
            target[k] = max(distance[k], nearest)
    return target


@compiled
def tells_anything(distance: FloatArray, status: IntArray, shown: FloatArray, cones: Cones) -> BoolArray:
    """Say which readings (K,) tell anything: that a target is there, or that none near returns enough light.

    A failure (hardware, synchronisation, cross-talk, no measurement yet, a distance that is negative or no number)
    tells nothing, and is no more free space than silence is. A target beyond what the sensor can measure is far away.
    `shown` is what `measured` makes of the readings.
    """
    tells = np.empty(len(status), np.bool_)
    for k in range(len(status)):
        # a number beyond the data sheet's range is no distance, but the sensor is at work; infinity and NaN are faults
        farthest = cones.range[cones.kind[k], 1]
        far = status[k] in _SHOWN and np.isfinite(distance[k]) and distance[k] > farthest
        tells[k] = not np.isnan(shown[k]) or far or status[k] in _NO_TARGET
    return tells


@kernel
def take_in(
    tracks: TrackState, stamp: FloatArray, points: FloatArray, fresh: BoolArray, shows: BoolArray, tells: BoolArray,
    now: float, persistence: float,
) -> None:  # fmt: skip
    """Take readings (K,) of `stamp` [s] and points (K, 3) [m], those that are `fresh`, into the tracks.

    A reading that `shows` something replaces its unit's point. One that shows nothing, or comes too late, leaves the
    point as it was, so one missed reading removes no obstacle. From the age `persistence` [s] on a point is given up.
    One that `tells` anything is heard.
    """
    for k in range(len(stamp)):
        if fresh[k]:
            # a failure is used up but not heard, so it ages the unit as silence does
            tracks.used[k] = stamp[k]
            if tells[k]:
                tracks.heard[k] = stamp[k]
            # a reading that is too old on arrival shows nothing: its point would be given up in this very step
            if shows[k] and now - stamp[k] <= persistence:
                tracks.seen[k] = stamp[k]
                for i in range(3):
                    tracks.point[k, i] = points[k, i]


@kernel
def newer(used: FloatArray, stamp: FloatArray, now: float) -> BoolArray:
    """Say which units (K,) have a reading newer than the last one used, and not from the future.

    A unit whose clock is ahead is so never heard: it must not pass for one that is well.
    """
    fresh = np.empty(len(stamp), np.bool_)
    for k in range(len(stamp)):
        fresh[k] = used[k] < stamp[k] <= now  # false for NaN, and for -inf: never heard
    return fresh


_FAILURES = {
    int(RangeStatus.HARDWARE): " (it reports a hardware failure)",
    int(RangeStatus.STUCK): " (it repeats the same reading)",
}


@compiled
def speed_factor(silence: float, slow_after: float, silent_after: float) -> float:
    """Factor in [0, 1] on the speed for who fell silent: 1 up to `slow_after` [s], 0 from `silent_after` [s] on.

    Silence is never free space, and neither is a failure. The silence of who was never heard is infinite.
    """
    return 1.0 if silence <= slow_after else max(0.0, (silent_after - silence) / (silent_after - slow_after))


def silent_units(skin: Skin, heard: FloatArray, status: IntArray, now: float, silent_after: float) -> str:
    """Name the units that told nothing for `silent_after` [s]; of a unit with zones the unit is named, once.

    `heard` (K,) [s] is when each told anything, `status` (K,) what it reported last.
    """
    silent = np.flatnonzero(now - heard >= silent_after).tolist()
    return ", ".join(dict.fromkeys(skin.boards[k] + _FAILURES.get(int(status[k]), "") for k in silent))


_ON_AXIS = math.cos(math.radians(0.5))
"""A target may be anywhere in its cone, though eq. 1 puts it on the axis: it may leave the cone as soon as that is
carried on. Half a degree is more than an arm at rest turns."""


@kernel
def looks_at(kin: Kinematics, skin: SkinArrays, k: int, point: FloatArray) -> bool:
    """Whether the beam of unit k still goes to a point (3,)."""
    position, rotation, link = np.empty(3), np.empty((3, 3)), skin.link[k]
    pose_into(kin.position[link], kin.rotation[link], skin.T_link_sensor[k], position, rotation)
    return _on_axis(position, rotation, point) >= 0


@kernel
def give_up(tracks: TrackState, sensors: Sensors, tells: BoolArray, distance: FloatArray, until: float) -> None:
    """Give up each point last seen before `until` [s] through whose place its unit now looks.

    `tells` (K,) are units with a new reading that tells something, `distance` (K,) [m] what they show, NaN for nothing.
    """
    for k in range(len(tells)):
        if tells[k] and tracks.seen[k] < until:
            away = _on_axis(sensors.position[k], sensors.rotation[k], tracks.point[k])
            # what is nearer may hide the point: such a reading says nothing about it
            if away >= 0 and not distance[k] < away:
                tracks.seen[k] = -np.inf


@kernel
def _on_axis(position: FloatArray, rotation: FloatArray, point: FloatArray) -> float:
    """Distance [m] of a point (3,) from a sensor on whose axis it lies, -1 if it does not, or is NaN."""
    along, away2 = 0.0, 0.0
    for i in range(3):
        to = point[i] - position[i]
        along += to * rotation[i, 2]
        away2 += to * to
    away = np.sqrt(away2)
    return away if along >= _ON_AXIS * away else -1.0


@kernel
def spread(sigmas: float, position_sigma: Number, orientation_sigma: Number, distance: Number) -> Number:
    """Spread u = n sqrt(sigma_p^2 + (d sigma_r)^2) [m]: how far a point may lie from where eq. 1 puts it.

    `sigmas` n counts standard deviations, those of the unit's position [m] and orientation [rad] in the worst
    direction; `distance` d [m] is from the unit to the point.
    """
    turned = distance * orientation_sigma  # to first order: lever times angle
    return sigmas * np.sqrt(position_sigma * position_sigma + turned * turned)


@kernel
def widen(ends: FloatArray, sigmas: float, skin: SkinArrays, distance: FloatArray, most: float) -> None:
    """Add to `ends` (K,) [m], up to which the arm and fixtures explain a reading, its spread, but no more than `most`.

    `distance` (K,) [m] is what each reading stands for.
    """
    for k in range(len(ends)):
        # an obstacle so close before the arm is not seen: `most` bounds how much a badly placed unit may hide
        ends[k] += min(spread(sigmas, skin.position_sigma[k], skin.orientation_sigma[k], distance[k]), most)


@kernel
def spread_of(point: FloatArray, k: int, sigmas: float, skin: SkinArrays, kin: Kinematics) -> float:
    """Spread [m] of a point (3,) of unit k, as far as the unit now is from it."""
    # from the unit as it is now, not as it measured: at 5 degrees u is off by 3 mm at most, without a memory of it
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
    """Take its spread u [m] off the distances of obstacle m; direction and body point stay those of its point.

    The distance from the body may become negative (eqs. 5-7), that from the end-effector is at least 0: eq. 3 makes a
    factor on the speed of it.
    """
    obstacles.body_distance[m] -= u
    obstacles.ee_distance[m] = max(0.0, obstacles.ee_distance[m] - u)
