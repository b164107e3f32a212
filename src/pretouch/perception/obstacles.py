"""Where the sensed obstacles are: eq. 1, which readings count, and how long a point is kept."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pretouch.perception.vectors import rotated
from pretouch.robot.model import Kinematics
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import MAX_DISTANCE, MIN_DISTANCE
from pretouch.types import BoolArray, FloatArray, IntArray, RangeReadings, RangeStatus


@dataclass(frozen=True, slots=True)
class TrackState:
    """The last point each of K units showed. NaN and -inf where there is none."""

    point: FloatArray
    """(K, 3) obstacle position, base frame [m]."""
    seen: FloatArray
    """(K,) instant of the measurement that showed it [s]."""
    used: FloatArray
    """(K,) stamp of the newest reading taken into account [s]."""
    heard: FloatArray
    """(K,) stamp of the newest reading that told anything [s]."""
    direction: FloatArray
    """(K, 3) last direction from the body to the point."""


def track_init(units: int) -> TrackState:
    """Return the state before any reading."""
    return TrackState(
        np.full((units, 3), np.nan),
        np.full(units, -np.inf),
        np.full(units, -np.inf),
        np.full(units, -np.inf),
        np.full((units, 3), np.nan),
    )


def sensor_poses(skin: Skin, kin: Kinematics) -> tuple[FloatArray, FloatArray]:
    """Positions (K, 3) [m] and orientations (K, 3, 3) of the sensors, base frame: T_O_link @ T_link_sensor."""
    return _poses(kin.position, kin.rotation, skin.link, skin.T_link_sensor)


@njit(cache=True)
def _poses(
    link_position: FloatArray, link_rotation: FloatArray, link: IntArray, T_link_sensor: FloatArray
) -> tuple[FloatArray, FloatArray]:
    position, rotation = np.empty((len(link), 3)), np.empty((len(link), 3, 3))
    for k in range(len(link)):
        R_O_link = link_rotation[link[k]]
        position[k] = link_position[link[k]] + rotated(R_O_link, T_link_sensor[k, :3, 3])
        for column in range(3):
            rotation[k, :, column] = rotated(R_O_link, T_link_sensor[k, :3, column])
    return position, rotation


def locate(position: FloatArray, rotation: FloatArray, distance: FloatArray) -> FloatArray:
    """Obstacle positions h_k = r_SUk + R_SUk [0 0 d_k]^T (K, 3) [m] in the base frame, eq. 1 of the paper.

    `position` (K, 3) [m] and `rotation` (K, 3, 3) are the sensors' poses, `distance` (K,) the readings [m].
    """
    return position + rotation[:, :, 2] * distance[:, None]


def measured_distance(readings: RangeReadings) -> FloatArray:
    """Distance (K,) [m] each reading stands for, NaN where it shows no target.

    A target nearer than the sensor can measure is taken to be at its minimum distance, never as gone. A number
    beyond what it can measure shows nothing, whatever its status.
    """
    return _measured(readings.distance, readings.status)


def is_evidence(readings: RangeReadings, distance: FloatArray) -> BoolArray:
    """Say which readings (K,) tell anything: that a target is there, or that none near returns enough light.

    A failure (hardware, synchronisation, cross-talk, no measurement yet, a distance that is negative or no number)
    tells nothing, and is no more free space than silence is. A target beyond what the sensor can measure is far away.
    `distance` is what `measured_distance` makes of the readings.
    """
    return _tells(readings.distance, readings.status, distance)


_SHOWN = tuple(int(s) for s in (RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED))
_NEAR = (int(RangeStatus.MIN_RANGE), int(RangeStatus.MIN_CLIPPED))
_NO_TARGET = tuple(
    int(s) for s in (RangeStatus.SIGNAL, RangeStatus.SIGMA, RangeStatus.OUT_OF_BOUNDS, RangeStatus.WRAPPED)
)
"""Statuses of a sensor at work that sees nothing near: too little light, too noisy, or beyond its range."""


@njit(cache=True)
def _tells(distance: FloatArray, status: IntArray, shown: FloatArray) -> BoolArray:
    tells = np.isfinite(shown)
    for k in range(len(status)):
        far = status[k] in _SHOWN and np.isfinite(distance[k]) and distance[k] > MAX_DISTANCE
        tells[k] = tells[k] or far or status[k] in _NO_TARGET
    return tells


@njit(cache=True)
def _measured(distance: FloatArray, status: IntArray) -> FloatArray:
    shown = np.full(len(distance), np.nan)
    for k in range(len(distance)):
        if status[k] in _NEAR:
            shown[k] = MIN_DISTANCE
        elif status[k] in _SHOWN and 0 <= distance[k] <= MAX_DISTANCE:
            shown[k] = max(distance[k], MIN_DISTANCE)
    return shown


def track(
    state: TrackState,
    readings: RangeReadings,
    points: FloatArray,
    shows: BoolArray,
    tells: BoolArray,
    now: float,
    persistence: float,
) -> TrackState:
    """Take new readings in.

    A reading that shows something replaces its unit's point. One that shows nothing, or comes too late, leaves the
    point as it was, so one missed reading removes no obstacle.

    Args:
        state: points known so far.
        readings: the newest reading of each unit.
        points: (K, 3) where the readings are, base frame [m].
        shows: (K,) whether the reading shows an obstacle.
        tells: (K,) whether it tells anything at all.
        now: instant of this step [s].
        persistence: age at which a point is given up [s].
    """
    fresh = is_fresh(state, readings, now)
    take = fresh & shows & (now - readings.stamp <= persistence)
    return TrackState(
        point=np.where(take[:, None], points, state.point),
        seen=np.where(take, readings.stamp, state.seen),
        used=np.where(fresh, readings.stamp, state.used),
        heard=np.where(fresh & tells, readings.stamp, state.heard),
        direction=state.direction,
    )


def is_fresh(state: TrackState, readings: RangeReadings, now: float) -> BoolArray:
    """Say which units (K,) have a reading newer than the last one used, and not from the future.

    A unit whose clock is ahead is so never heard: it must not pass for one that is well.
    """
    return (readings.stamp > state.used) & (readings.stamp <= now)
