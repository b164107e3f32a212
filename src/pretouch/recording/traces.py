"""What units' IMUs and an arm's joints measured, as standard messages, and read from these as traces."""

import struct
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.errors import RecordingError
from pretouch.recording.disk import Item
from pretouch.recording.messages import encoded, make
from pretouch.recording.standard import JOINT_STATE, header, nanoseconds
from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import FloatArray

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
        seconds, rest_ns, length = _HEAD.unpack_from(data)
        frame = data[_HEAD.size : _HEAD.size + max(length - 1, 0)]
        rows = self._rows.setdefault(frame, array("d"))
        rows.append(seconds + rest_ns / 1e9)
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


TOPIC = "/joint_states"


def check_joints(stamp: FloatArray, q: FloatArray, qd: FloatArray | None, names: Sequence[str]) -> None:
    """Refuse joint positions that are not one row for each instant and one column for each joint: RecordingError."""
    wanted = (len(stamp), len(names))
    for what, given in (("positions", q), ("velocities", q if qd is None else qd)):
        if given.shape != wanted:
            raise RecordingError(
                f"The joint {what} have the shape {given.shape}: give {wanted}, a row for each instant and a column for"
                " each joint's name."
            )


def joint_items(
    instead: int, stamp: FloatArray, q: FloatArray, qd: FloatArray | None, names: Sequence[str]
) -> Iterator[Item]:
    """Yield states of joints at instants (M,) [s]: (M, n) [rad], [rad/s]; what is no time stands at `instead` [ns]."""
    nothing, texts = np.zeros(0), list(names)
    for i, t in enumerate(stamp.tolist()):
        time = nanoseconds(t, instead)
        velocity = nothing if qd is None else np.array(qd[i], dtype=np.float64)
        state = make(JOINT_STATE, header(time, ""), texts, np.array(q[i], dtype=np.float64), velocity, nothing)
        yield Item(TOPIC, JOINT_STATE, 0, time, encoded(JOINT_STATE, state))


class JointRows:
    """Gathers the joint positions of one arm."""

    def __init__(self, place: Path, names: Sequence[str] = ()) -> None:
        """Begin with the joints' names if they are known; the first message tells them otherwise."""
        self._place, self.names = place, tuple(names)
        self._stamp: list[float] = []
        self._q: list[FloatArray] = []

    def add_message(self, message: Any) -> None:
        """Take in a JointState; one of other joints than before is a RecordingError."""
        names = tuple(message.name)
        self.names = self.names or names
        if names != self.names:
            raise RecordingError(
                f"{self._place} has states of the joints {', '.join(names)} and of {', '.join(self.names)}: record one"
                " arm per file."
            )
        at = message.header.stamp
        self.add(at.sec + at.nanosec / 1e9, message.position)

    def add(self, stamp: float, q: FloatArray) -> None:
        """Take in positions (n,) [rad] at an instant [s]; those that are not one number for each joint are left out."""
        if np.isfinite(stamp) and q.shape == (len(self.names),) and np.isfinite(q).all():
            self._stamp.append(stamp)
            self._q.append(q)

    def trace(self) -> JointTrace | None:
        """Return the positions by time, the later ones of two at one instant; None without any."""
        if not self._stamp:
            return None
        stamp = np.array(self._stamp)
        order = np.argsort(stamp, kind="stable")
        order = order[np.append(np.diff(stamp[order]) > 0, True)]
        return JointTrace(stamp[order], np.stack(self._q)[order])
