"""Where the sensed obstacles are: eq. 1, which readings count, and how long a point is kept."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import Cones, Kinematics, Sensors
from pretouch.perception.motion_compensation import motion_init
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles, RangeReadings, RangeStatus
from pretouch.values import value


@value
class TrackState:
    """The last point each of K units showed. NaN and -inf where there is none."""

    point: FloatArray
    """(K, 3) obstacle position, base frame [m]."""
    direction: FloatArray
    """(K, 3) last direction from the body to the point."""
    times: FloatArray
    """(3, K) instants `seen`, `used` and `heard` [s]."""
    motion: FloatArray
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


@compiled
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


class NewReadings(NamedTuple):
    """Readings of K units, as `take_in` takes them."""

    stamp: FloatArray
    """(K,) [s]."""
    points: FloatArray
    """(K, 3) where they are [m]."""
    fresh: BoolArray
    """(K,) whether each is new."""
    shows: BoolArray
    """(K,) whether it shows an obstacle."""
    tells: BoolArray
    """(K,) whether it tells anything."""


@compiled
def take_in(point: FloatArray, times: FloatArray, new: NewReadings, now: float, persistence: float) -> None:
    """Take new readings into the points (K, 3) and times (3, K) of a `TrackState`.

    A reading that shows something replaces its unit's point. One that shows nothing, or comes too late, leaves the
    point as it was, so one missed reading removes no obstacle. From the age `persistence` [s] on a point is given up.
    """
    stamp, points, fresh, shows, tells = new
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


@compiled
def newer(used: FloatArray, stamp: FloatArray, now: float) -> BoolArray:
    """Say which units (K,) have a reading newer than the last one used, and not from the future.

    A unit whose clock is ahead is so never heard: it must not pass for one that is well.
    """
    fresh = np.empty(len(stamp), np.bool_)
    for k in range(len(stamp)):
        fresh[k] = used[k] < stamp[k] <= now  # false for NaN, and for -inf: never heard
    return fresh
