"""What IMUs measured, read from a recording: sensor_msgs/Imu as `standard.imu_item` writes it."""

import struct
from array import array

import numpy as np

from pretouch.traces import ImuTrace

_HEAD = struct.Struct("<4xiII")
"""Encapsulation header, seconds, nanoseconds, and length of the frame's name with its end."""
_TAIL = struct.Struct("<3d72x3d72x")
"""Angular velocity and acceleration, each before its covariance, at the end of a message."""


class ImuRows:
    """Gathers Imu messages by unit: there are thousands a second, so that only what is needed is decoded."""

    def __init__(self) -> None:
        self._rows: dict[bytes, array[float]] = {}

    def add(self, data: bytes) -> None:
        """Take in a message, as CDR; what is too short to be one is left out."""
        if len(data) < _HEAD.size + _TAIL.size:
            return
        seconds, nanoseconds, length = _HEAD.unpack_from(data)
        frame = data[_HEAD.size : _HEAD.size + max(length - 1, 0)]
        rows = self._rows.setdefault(frame, array("d"))
        rows.append(seconds + nanoseconds / 1e9)
        rows.extend(_TAIL.unpack_from(data, len(data) - _TAIL.size))

    def traces(self) -> dict[str, ImuTrace]:
        """Return what each unit measured, by its name, in the order of time."""
        return {frame.decode(errors="replace"): _trace(rows) for frame, rows in self._rows.items()}


def no_imu() -> ImuTrace:
    """Return what a unit without an IMU measured."""
    return _trace(array("d"))


def _trace(rows: "array[float]") -> ImuTrace:
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    table = table[np.argsort(table[:, 0], kind="stable")]
    return ImuTrace(table[:, 0], table[:, 4:], table[:, 1:4])
