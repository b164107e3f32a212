"""Where the sensed obstacles are: eq. 1, which readings count, and how long a point lasts, its spread, and silence."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.groups import Cones, Kinematics, Sensors, SkinArrays
from pretouch.params import PerceptionParams
from pretouch.perception.motion_compensation import motion_init
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray, IntArray, Number, Obstacles, RangeReadings, RangeStatus


class TrackState(NamedTuple):
    """The last point each of K units showed. NaN and -inf where there is none."""

    point: Annotated[FloatArray, "K", 3]
    """(K, 3) obstacle position, base frame [m]."""
    direction: Annotated[FloatArray, "K", 3]
    """(K, 3) last direction from the body to the point."""
    times: Annotated[FloatArray, 3, "K"]
    """(3, K) instants `seen`, `used` and `heard` [s]."""
    motion: Annotated[FloatArray, 2, "K", 3]
    """(2, K, 3) smoothed place [m] and velocity [m/s] of each unit's point, where closing speeds are estimated."""

    @property
    def seen(self) -> FloatArray:
        """Instant of the measurement that showed the point (K,) [s]."""
        return self.times[SEEN]

    @property
    def used(self) -> FloatArray:
        """Stamp of the newest reading taken into account (K,) [s]."""
        return self.times[USED]

    @property
    def heard(self) -> FloatArray:
        """Stamp of the newest reading that reported anything (K,) [s]."""
        return self.times[HEARD]


SEEN, USED, HEARD = range(3)


def track_init(units: int) -> TrackState:
    """Return the state before any reading."""
    return TrackState(
        np.full((units, 3), np.nan), np.full((units, 3), np.nan), np.full((3, units), -np.inf), motion_init(units)
    )


def points_of_units(obstacles: Obstacles, units: int) -> FloatArray:
    """Where each unit of a skin shows an obstacle (K, 3) [m], NaN where it shows none; other sources are not in it."""
    points, own = np.full((units, 3), np.nan), obstacles.unit < units
    points[obstacles.unit[own]] = obstacles.point[own]
    return points


def sensor_poses(skin: Skin, kin: Kinematics) -> tuple[FloatArray, FloatArray]:
    """Positions (K, 3) [m] and orientations (K, 3, 3) of the sensors, base frame: T_O_link @ T_link_sensor."""
    return poses(kin.position, kin.rotation, skin.link, skin.T_link_sensor)


def placed_sensors(skin: Skin, kin: Kinematics) -> Sensors:
    """Return the sensors of a skin where they are in a posture."""
    return Sensors(*sensor_poses(skin, kin), skin.link)


@compiled
def poses(
    link_position: FloatArray, link_rotation: FloatArray, link: IntArray, T_link_sensor: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the poses of `sensor_poses` from those of the links."""
    position, rotation = np.empty((len(link), 3)), np.empty((len(link), 3, 3))
    for k in range(len(link)):
        pose_into(link_position[link[k]], link_rotation[link[k]], T_link_sensor[k], position[k], rotation[k])
    return position, rotation


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


def measured_distance(readings: RangeReadings, cones: Cones) -> FloatArray:
    """Distance (K,) [m] each reading stands for, NaN where it shows no target.

    A target nearer than the sensor can measure is taken to be at its minimum distance, never as gone. A number
    beyond what it can measure shows nothing, whatever its status.
    """
    shown = np.empty(len(readings.distance))
    measured(readings.distance, readings.status, cones, shown)
    return shown


def is_evidence(readings: RangeReadings, distance: FloatArray, cones: Cones) -> BoolArray:
    """Say which readings (K,) tell anything: that a target is there, or that none near returns enough light.

    A failure (hardware, synchronisation, cross-talk, no measurement yet, a distance that is negative or no number)
    tells nothing, and is no more free space than silence is. A target beyond what the sensor can measure is far away.
    `distance` is what `measured_distance` makes of the readings.
    """
    return tells_anything(readings.distance, readings.status, distance, cones)


# UM2356: 6 is a valid range whose wrap-around was not checked, 11 one of several pulses merged into one
_SHOWN = tuple(int(s) for s in (RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED))
# something is there, but the distance that comes with it is not used
_NEAR = (int(RangeStatus.MIN_RANGE), int(RangeStatus.MIN_CLIPPED))
_NO_TARGET = tuple(
    int(s) for s in (RangeStatus.SIGNAL, RangeStatus.SIGMA, RangeStatus.OUT_OF_BOUNDS, RangeStatus.WRAPPED)
)
"""Statuses of a sensor at work that sees nothing near: too little light, too noisy, or beyond its range."""


@compiled
def tells_anything(distance: FloatArray, status: IntArray, shown: FloatArray, cones: Cones) -> BoolArray:
    """Answer of `is_evidence`; `shown` (K,) is that of `measured_distance`."""
    tells = np.empty(len(status), np.bool_)
    for k in range(len(status)):
        # a number beyond the data sheet's range is no distance, but the sensor is at work; infinity and NaN are faults
        farthest = cones.range[cones.kind[k], 1]
        far = status[k] in _SHOWN and np.isfinite(distance[k]) and distance[k] > farthest
        tells[k] = not np.isnan(shown[k]) or far or status[k] in _NO_TARGET
    return tells


@compiled
def measured(distance: FloatArray, status: IntArray, cones: Cones, shown: FloatArray) -> None:
    """Write the answer (K,) of `measured_distance`."""
    for k in range(len(distance)):
        nearest, farthest = cones.range[cones.kind[k]]
        shown[k] = np.nan
        if status[k] in _NEAR:
            shown[k] = nearest
        elif status[k] in _SHOWN and 0 <= distance[k] <= farthest:  # false for NaN
            shown[k] = max(distance[k], nearest)


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
    point, times = tracks.point, tracks.times
    for k in range(len(stamp)):
        if fresh[k]:
            # a failure is used up but not heard, so it ages the unit as silence does
            times[USED, k] = stamp[k]
            if tells[k]:
                times[HEARD, k] = stamp[k]
            # a reading that is too old on arrival shows nothing: its point would be given up in this very step
            if shows[k] and now - stamp[k] <= persistence:
                times[SEEN, k] = stamp[k]
                for i in range(3):
                    point[k, i] = points[k, i]


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
    # of a unit with zones the unit is named, once
    names = ", ".join(dict.fromkeys(skin.boards[k] + _FAILURES.get(int(status[k]), "") for k in silent))
    # from 1 at `slow_after_s` to 0 at `silent_after_s`; the silence of a unit never heard is infinite
    return max(0.0, (params.silent_after_s - silence) / (params.silent_after_s - params.slow_after_s)), names


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
def give_up(
    point: FloatArray, seen: FloatArray, sensors: Sensors, told: BoolArray, distance: FloatArray, until: float
) -> None:  # fmt: skip
    """Give up each point (K, 3) last `seen` (K,) before `until` [s] through whose place its unit now looks.

    `told` (K,) are units with a new reading that tells something, `distance` (K,) [m] what they show, NaN for nothing.
    """
    for k in range(len(seen)):
        if told[k] and seen[k] < until:
            away = _on_axis(sensors.position[k], sensors.rotation[k], point[k])
            # what is nearer may hide the point: such a reading says nothing about it
            if away >= 0 and not distance[k] < away:
                seen[k] = -np.inf


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
def widen(
    ends: FloatArray, sigmas: float, position_sigma: FloatArray, orientation_sigma: FloatArray, distance: FloatArray,
    most: float,
) -> None:  # fmt: skip
    """Add to `ends` (K,) [m], up to which the arm and fixtures explain a reading, its spread, but no more than `most`.

    `distance` (K,) [m] is what each reading stands for.
    """
    for k in range(len(ends)):
        # an obstacle so close before the arm is not seen: `most` bounds how much a badly placed unit may hide
        ends[k] += min(spread(sigmas, position_sigma[k], orientation_sigma[k], distance[k]), most)


@kernel
def bring_nearer(
    body_distance: FloatArray, ee_distance: FloatArray, point: FloatArray, unit: IntArray, sigmas: float,
    skin: SkinArrays, kin: Kinematics,
) -> None:  # fmt: skip
    """Take its spread off the distances (M,) [m] of each point (M, 3), as far as the unit (M,) now is from it.

    The distance from the body may become negative, that from the end-effector is at least 0: eq. 3 makes a factor on
    the speed of it.
    """
    for m in range(len(point)):
        k = unit[m]
        # from the unit as it is now, not as it measured: at 5 degrees u is off by 3 mm at most, without a memory of it
        origin, R, away2 = kin.position[skin.link[k]], kin.rotation[skin.link[k]], 0.0
        for i in range(3):
            at = origin[i]
            for j in range(3):
                at += R[i, j] * skin.T_link_sensor[k, j, 3]
            away2 += (point[m, i] - at) ** 2
        turned = np.sqrt(skin.orientation_sigma[k] ** 2 + skin.cones.spread[skin.cones.kind[k]] ** 2)
        u = spread(sigmas, skin.position_sigma[k], turned, np.sqrt(away2))
        body_distance[m] -= u
        ee_distance[m] = max(0.0, ee_distance[m] - u)
