"""Joint positions of an arm in a recording of sensor units: sensor_msgs/JointState, to messages and back."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.errors import RecordingError
from pretouch.recording.messages import Item, encoded, make, plain_text
from pretouch.recording.standard import JOINT_STATE, header, nanoseconds
from pretouch.traces import JointTrace
from pretouch.types import FloatArray

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
    nothing, texts = np.zeros(0), [plain_text(name) for name in names]
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
