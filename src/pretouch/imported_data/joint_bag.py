"""Joint torques in a ROS bag or an MCAP file: efforts of sensor_msgs/JointState, and Franka's robot states."""

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from pretouch.errors import RecordingError
from pretouch.imported_data.bag import JOINTS, WRENCH, Topic, believed, fill, read_errors_said
from pretouch.imported_data.joint_source import JointSource
from pretouch.imported_data.source import Choice, Series, in_order, interpolated
from pretouch.types import FloatArray, IntArray

_STATES = ("franka_msgs/msg/FrankaState", "franka_msgs/msg/FrankaRobotState")
"""Of franka_ros and of franka_ros2."""
_EXTERNAL = "external_joint_torques"
"""Last part of the topic on which franka_ros2 publishes external torques, as efforts."""
_GAP_S = 0.1
"""Time between two samples within which joints are taken to move evenly [s]."""


def _reader(place: Path) -> AnyReader:
    with read_errors_said(place):
        reader = AnyReader([place], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    return reader


def kinds_in(place: Path) -> frozenset[str]:
    """Return which of force and torques a bag surely holds; RecordingError for one that cannot be read."""
    reader = _reader(place)
    try:
        there = [c for c in reader.connections if c.msgcount]
        force = {"force"} if any(c.msgtype == WRENCH for c in there) else set()
        named = any(c.msgtype in _STATES or c.topic.endswith(_EXTERNAL) for c in there)
        joints = [c for c in there if c.msgtype == JOINTS]
        efforts = not named and not force and joints and _efforts(place, reader, joints)
        return frozenset(force | ({"torques"} if named or efforts else set()))
    finally:
        reader.close()


def _efforts(place: Path, reader: AnyReader, connections: list[Any]) -> bool:
    """Whether the first message of joint states has positions and efforts."""
    with read_errors_said(place):
        for connection, _, raw in reader.messages(connections):
            message: Any = reader.deserialize(raw, connection.msgtype)
            return len(message.position) > 0 and len(message.effort) == len(message.position)
    return False


def read_joint_bag(place: Path, choice: Choice) -> JointSource:
    """Read a bag. RecordingError for topics that are missing or not clear, with those that are there."""
    reader = _reader(place)
    try:
        there = [c for c in reader.connections if c.msgcount]
        torques = _torque_topic(place, there, choice.torques)
        if torques.msgtype in _STATES:
            return _of_states(place, reader, [c for c in there if c.topic == torques.topic])
        return _of_joints(place, reader, there, torques.topic, choice)
    finally:
        reader.close()


def _torque_topic(place: Path, there: list[Any], named: str) -> Any:
    """A connection of the topic that has the torques."""
    able = [c for c in there if c.msgtype == JOINTS or c.msgtype in _STATES]
    topics = sorted({c.topic for c in able})
    if named:
        found = [c for c in able if c.topic == named]
    else:
        found = [c for c in able if c.topic.endswith(_EXTERNAL)] or [c for c in able if c.msgtype in _STATES] or able
    if not found:
        what = f"no topic {named!r}" if named else "no topic"
        raise RecordingError(
            f"{place} has {what} of sensor_msgs/JointState, FrankaState or FrankaRobotState: choose --torques from"
            f" those it has ({', '.join(topics) or 'none'})."
        )
    if len({c.topic for c in found}) > 1:
        raise RecordingError(
            f"{place} has several topics of joint torques: choose one by --torques, {', '.join(topics)}."
        )
    return found[0]


def _of_states(place: Path, reader: AnyReader, connections: list[Any]) -> JointSource:
    """Franka's robot states: all of a sample is in one message."""
    name = connections[0].topic
    topic = Topic(name, 28, _franka)
    fill(place, reader, connections, [topic])
    headers, notes = believed([topic])
    series = topic.series(headers)
    kinds = ("q", "dq", "dq_d", "tau_ext")
    parts = dict(zip(kinds, np.split(series.values, 4, axis=1), strict=True))
    return JointSource(f"the topic {name}", series.time, parts, True, "auto", notes)


def _franka(message: Any) -> tuple[float, ...]:
    if hasattr(message, "measured_joint_state"):
        measured, desired = message.measured_joint_state, message.desired_joint_state
        rows = measured.position, measured.velocity, desired.velocity, message.tau_ext_hat_filtered.effort
    else:
        rows = message.q, message.dq, message.dq_d, message.tau_ext_hat_filtered
    return tuple(float(value) for row in rows for value in row)


class _States:
    """Picks values of joints, in the order of their names or numbers, out of joint states."""

    def __init__(self) -> None:
        self.names: tuple[str, ...] = ()
        self.n = 0

    def __call__(self, message: Any) -> tuple[float, ...] | None:
        """Positions, velocities and efforts of all joints, NaN where there are none; None of other joints."""
        all_of = range(max(len(message.position), len(message.effort)))
        kept = [i for i, name in enumerate(message.name) if "finger" not in name] if message.name else [*all_of]
        names = tuple(message.name[i] for i in kept) if message.name else ()
        if not kept:
            return None
        order = sorted(range(len(names)), key=lambda i: names[i]) if _numbered(names) else range(len(kept))
        if not self.n:
            self.n, self.names = len(kept), tuple(names[i] for i in order) if names else ()
        if len(kept) != self.n or tuple(sorted(names)) != tuple(sorted(self.names)):
            return None
        at = [kept[names.index(name)] for name in self.names] if names else kept
        rows = message.position, message.velocity, message.effort
        return tuple(float(row[i]) if len(row) > i else np.nan for row in rows for i in at)


def _numbered(names: tuple[str, ...]) -> bool:
    """Whether the joints' names end in numbers that give their order: panda_joint1 to panda_joint7."""
    return bool(names) and all(name[-1:].isdigit() for name in names) and len(names) < 10


def _of_joints(place: Path, reader: AnyReader, there: list[Any], torques: str, choice: Choice) -> JointSource:
    """Efforts of joint states, and positions of the same topic or of another one."""
    effort, notes = _series(place, reader, there, torques)
    q = effort
    external = torques.endswith(_EXTERNAL)
    others = sorted({c.topic for c in there if c.msgtype == JOINTS and c.topic != torques})
    name = choice.joints or torques
    if not choice.joints and not np.isfinite(effort[0].values[:, 0]).any():
        measured = [other for other in others if "desired" not in other] or others
        if len(measured) != 1:
            raise RecordingError(
                f"{torques} of {place} has no positions: name the topic that has by --joints"
                f" ({', '.join(others) or 'there is none'})."
            )
        name = measured[0]
    if name != torques:
        q, _ = _series(place, reader, there, name)
        if q[1] != effort[1] and q[1] and effort[1]:
            raise RecordingError(f"{name} and {torques} of {place} name other joints: choose --joints and --torques.")
    return _joined(place, (name, *q), (torques, *effort), external, notes)


def _series(
    place: Path, reader: AnyReader, there: list[Any], name: str
) -> tuple[tuple[Series, tuple[str, ...]], tuple[str, ...]]:
    connections = [c for c in there if c.topic == name and c.msgtype == JOINTS]
    if not connections:
        raise RecordingError(f"{place} has no topic {name!r} of sensor_msgs/JointState: choose another --joints.")
    picker = _States()
    with read_errors_said(place):
        for connection, _, raw in reader.messages(connections):
            if picker(reader.deserialize(raw, connection.msgtype)) is not None:
                break
    if not picker.n:
        raise RecordingError(f"{name} of {place} has no message with joints: choose another topic.")
    topic = Topic(name, 3 * picker.n, picker)
    fill(place, reader, connections, [topic])
    headers, notes = believed([topic])
    series, more = in_order(topic.series(headers), name)
    return (series, picker.names), (*notes, *more)


def _joined(
    place: Path, joints: tuple[str, Series, tuple[str, ...]], torques: tuple[str, Series, tuple[str, ...]],
    external: bool, notes: tuple[str, ...],
) -> JointSource:  # fmt: skip
    """Positions and velocities at the instants of the torques."""
    name, states, names = joints
    time: IntArray = torques[1].time
    n = states.values.shape[1] // 3
    at: FloatArray = interpolated(states, time, _GAP_S)[:, : 2 * n]
    effort = torques[1].values[:, -n:]
    if torques[1].values.shape[1] != 3 * n or not np.isfinite(effort).any():
        raise RecordingError(f"{torques[0]} of {place} has no efforts of the joints: choose another --torques.")
    parts = {"q": at[:, :n], "dq": at[:, n:], "tau_ext" if external else "tau": effort}
    if not np.isfinite(parts["dq"]).any():
        del parts["dq"]
    whole = " ".join(names)
    arm = "fr3" if "fr3" in whole else "panda" if "panda" in whole else "auto"
    said = f"the topic {torques[0]}" + ("" if name == torques[0] else f", positions from {name}")
    return JointSource(said, time, parts, external, arm, notes, names)
