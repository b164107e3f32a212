"""The standard ROS 2 topics of a recording: a copy of what was measured, for tools that do not know our messages."""

import math
import struct
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from pretouch.controller import Controller
from pretouch.recording.codec import decode_inputs
from pretouch.recording.disk import Item
from pretouch.recording.messages import encoded, make
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor
from pretouch.types import ControlStep, FloatArray, RangeReadings, RangeStatus

JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH = "geometry_msgs/msg/WrenchStamped"
RANGE = "sensor_msgs/msg/Range"
IMU = "sensor_msgs/msg/Imu"
STANDARD = (JOINT_STATE, WRENCH, RANGE, IMU)
"""Types of what is measured."""
HEADER, TIME = "std_msgs/msg/Header", "builtin_interfaces/msg/Time"
VECTOR, QUATERNION = "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Quaternion"

_LATEST = (2**31 - 1) * 10**9
"""Latest time a ROS message can hold [ns]."""
_INFRARED = 1
_ACCURACY_M = 0.025
"""Ranging error of the VL53L1X, at most [m] (data sheet DS12385)."""
_SHOWN = (RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED)
_HEAD = 4
"""Bytes of the encapsulation header before a CDR message; the stamp follows."""
_STAMP, _VECTOR = struct.Struct("<iI"), struct.Struct("<3d")
_ANGULAR_VELOCITY, _ACCELERATION = -8 * (3 + 9 + 3 + 9), -8 * (3 + 9)
"""Where an Imu message holds these, from its end: each is followed by its covariance."""
_UNKNOWN = np.array([-1.0, *np.zeros(8)])
"""Covariance that says a quantity is not there (sensor_msgs/Imu)."""


def nanoseconds(stamp: float, instead: int) -> int:
    """Return a stamp [s] in ns, within what ROS and MCAP can hold; one that is no number as `instead`."""
    if stamp != stamp:
        return instead
    return round(min(max(stamp, 0.0), _LATEST / 1e9) * 1e9)


def header(time: int, frame: str) -> Any:
    """Return a ROS header for an instant [ns] and a frame."""
    return make(HEADER, make(TIME, time // 10**9, time % 10**9), frame)


@cache
def topic_name(name: str) -> str:
    """Return a unit's id as ROS allows it in a topic: ASCII letters, digits and underscores, no digit first."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in name)
    return f"_{plain}" if plain[0].isdigit() else plain


class Standard:
    """Makes what is measured in one controller's cycles into the standard topics."""

    def __init__(self, controller: Controller) -> None:
        model = controller.model
        self._units = controller.skin.units
        self._base = model.links[0]
        self._joints = list(model.joints)
        self._newest = np.full(len(self._units), -np.inf)

    def items(self, given: bytes | None, step: ControlStep, sequence: int, time: int) -> Iterator[Item]:
        """Yield the messages of one cycle; without the inputs, as CDR, those that a step can tell."""
        at = header(time, self._base)
        torque = np.zeros(3)
        qd = effort = np.zeros(0)
        inputs = None if given is None else decode_inputs(given)[1]
        if inputs is not None:
            qd, effort = _fitting(inputs.robot.qd, step.q), _fitting(inputs.robot.tau_ext, step.q)
            if inputs.robot.wrench is not None and len(inputs.robot.wrench) == 6:
                torque = inputs.robot.wrench[3:]
            yield from self._ranges(inputs.readings, sequence, time)
        joints = make(JOINT_STATE, at, self._joints, step.q, qd, effort)
        yield Item("/joint_states", JOINT_STATE, sequence, time, encoded(JOINT_STATE, joints))
        if step.force[0] == step.force[0]:
            wrench = make("geometry_msgs/msg/Wrench", vector(step.force), vector(torque))
            yield Item("/wrench", WRENCH, sequence, time, encoded(WRENCH, make(WRENCH, at, wrench)))

    def _ranges(self, readings: RangeReadings, sequence: int, time: int) -> Iterator[Item]:
        """Yield a message for each unit whose reading is not the one before."""
        stamps, distances, statuses = readings.stamp, readings.distance, readings.status
        if not len(stamps) == len(distances) == len(statuses) == len(self._units):
            return
        fresh = np.flatnonzero((stamps != self._newest) & np.isfinite(stamps))
        self._newest = stamps
        for k in fresh.tolist():
            reading = float(stamps[k]), float(distances[k]), int(statuses[k])
            yield range_item(self._units[k].id, sequence, time, *reading, self._units[k].sensor)


def range_item(
    unit_id: str, sequence: int, time: int, stamp: float, distance: float, status: int, sensor: Sensor = PAPER_SENSOR
) -> Item:  # fmt: skip
    """Return a unit's reading measured at a stamp [s], logged at an instant [ns]: distance [m] and `RangeStatus`."""
    at = header(nanoseconds(stamp, time), unit_id)
    shown = _single(distance) if status in _SHOWN else math.inf
    sees = sensor.angle, sensor.nearest_m, sensor.farthest_m
    message = make(RANGE, at, _INFRARED, *sees, shown, _ACCURACY_M**2)
    return Item(f"/skin/{topic_name(unit_id)}/range", RANGE, sequence, time, encoded(RANGE, message))


def imu_item(unit_id: str, time: int, acceleration: FloatArray, angular_velocity: FloatArray) -> Item:
    """Return what a unit's IMU measured at an instant [ns]."""
    name, blank = _blank_imu(unit_id)
    data = bytearray(blank)
    _STAMP.pack_into(data, _HEAD, time // 10**9, time % 10**9)
    _VECTOR.pack_into(data, len(data) + _ANGULAR_VELOCITY, *angular_velocity.tolist())
    _VECTOR.pack_into(data, len(data) + _ACCELERATION, *acceleration.tolist())
    return Item(name, IMU, 0, time, bytes(data))


def imu_items(
    unit_id: str, instead: int, stamp: FloatArray, acceleration: FloatArray, angular_velocity: FloatArray
) -> Iterator[Item]:
    """Yield what a unit's IMU measured at instants (M,) [s]; one that is no time stands at `instead` [ns]."""
    for t, a, w in zip(stamp.tolist(), acceleration, angular_velocity, strict=True):
        yield imu_item(unit_id, nanoseconds(t, instead), a, w)


@cache
def _blank_imu(unit_id: str) -> tuple[str, bytes]:
    """Topic of a unit's IMU, and a message of it with zeros.

    Thousands come each second, and differ in three places only.
    """
    nothing = vector(np.zeros(3))
    message = make(
        IMU, header(0, unit_id), make(QUATERNION, 0.0, 0.0, 0.0, 1.0), _UNKNOWN, nothing, np.zeros(9), nothing,
        np.zeros(9),
    )  # fmt: skip
    return f"/skin/{topic_name(unit_id)}/imu", encoded(IMU, message)


def vector(given: FloatArray) -> Any:
    """Return a (3,) array as geometry_msgs/Vector3."""
    x, y, z = (float(v) for v in given)
    return make(VECTOR, x, y, z)


def _fitting(array: FloatArray, like: FloatArray) -> FloatArray:
    """Return an array if it is as long as another one, and else an empty one."""
    return array if array.shape == like.shape else np.zeros(0)


def _single(number: float) -> float:
    """Return a number that float32 can hold: one beyond is infinite."""
    with np.errstate(over="ignore"):
        return float(np.float32(number))
