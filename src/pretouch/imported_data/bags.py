"""ROS bags and MCAP files: WrenchStamped, JointState, and Franka's robot states."""

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from pretouch.errors import RecordingError
from pretouch.imported_data.log import Choice, Log, Note, arm_of, check_steps_back, interpolated, joint_places, listed
from pretouch.recording.ros import JOINT_STATE, READ_WITH, UNIT_SAMPLE, WRENCH
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

_STATES = ("franka_msgs/msg/FrankaState", "franka_msgs/msg/FrankaRobotState")
"""States of franka_ros and of franka_ros2."""
_EXTERNAL = "external_joint_torques"
"""Last part of the topic on which franka_ros2 publishes external torques, as efforts."""
_FIELDS = {WRENCH: ("force", "torque"), JOINT_STATE: ("q", "dq", "effort")}
_STATE_FIELDS = ("q", "dq", "dq_d", "tau_ext")
_LATE_NS = 500_000_000
"""How far a stamp may lie before an earlier one [ns]: messages overtake each other by less."""
_POSTURE_GAP_S, _MOTION_GAP_S = 0.2, 0.1
"""Time between two joint positions within which the arm is taken to move evenly [s]: for a force, and for torques."""
_LOOKED_AT = 1000
"""Messages among which efforts are looked for."""


class Bag:
    """A bag or MCAP file."""

    def __init__(self, place: Path, choice: Choice) -> None:
        """See what it holds. RecordingError for what cannot be read."""
        self._place, self._choice = place, choice
        with self._opened() as reader:
            self._types = {c.topic: c.msgtype for c in reader.connections if c.msgcount}
            types = set(self._types.values())
            kinds = {"force"} if WRENCH in types else set()
            kinds |= {"q"} if types & {JOINT_STATE, *_STATES} else set()
            if self._of(*_STATES) or any(name.endswith(_EXTERNAL) for name in self._of(JOINT_STATE)):
                kinds.add("tau_ext")
            elif "force" not in kinds and self._has_efforts(reader):  # beside a force, efforts may be anything
                kinds.add("tau")
        self.kinds = frozenset(kinds)
        """Kinds of `Log` that it certainly contains."""

    def force(self, posture: bool) -> Log:
        """Read the force, and where asked for the joint positions at its instants."""
        wrenches = self._of(WRENCH)
        name = self._one(wrenches, wrenches, "geometry_msgs/WrenchStamped", self._choice.wrench, "--wrench")
        if not posture:
            return self._read(name)[0]
        return _joined(self._read(name, self._position_topic("")), _POSTURE_GAP_S)

    def torques(self) -> Log:
        """Read one of `TORQUES`, with joint positions and perhaps velocities."""
        able = self._of(JOINT_STATE, *_STATES)
        external = [name for name in able if name.endswith(_EXTERNAL)]
        what = "sensor_msgs/JointState, FrankaState or FrankaRobotState"
        best = external or self._of(*_STATES) or able
        name = self._one(best, able, what, self._choice.torques, "--torques")
        (log,) = self._read(name)
        if not {"tau_ext", "tau"} & set(log.arrays):
            raise RecordingError(f"{name} of {self._place} has no efforts of the joints: choose another --torques.")
        if "q" in log.arrays and self._choice.joints in ("", name):
            return log
        return _joined(self._read(name, self._position_topic(name)), _MOTION_GAP_S)

    def positions(self) -> Log:
        """Read joint positions."""
        return _with_positions(self._read(self._position_topic(""))[0])

    @contextmanager
    def _opened(self) -> Iterator[AnyReader]:
        """Open it, and say in a sentence what is wrong: rosbags meets broken files with exceptions of any kind."""
        try:
            with AnyReader([self._place], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
                yield reader
        except RecordingError:
            raise
        except Exception as error:
            what = " ".join(str(error).split())[:200] or type(error).__name__
            raise RecordingError(
                f"{self._place} cannot be read as a bag or MCAP file ({what}): give a complete one, of messages of"
                " ROS with their definitions; `mcap recover` repairs one that was cut short."
            ) from error

    def _of(self, *types: str) -> list[str]:
        """Topics of some types."""
        return sorted(name for name, kind in self._types.items() if kind in types)

    def _has_efforts(self, reader: AnyReader) -> bool:
        """Return True if one of the first messages of joint states has positions and efforts of as many joints."""
        joints = [c for c in reader.connections if c.msgcount and c.msgtype == JOINT_STATE]
        for count, (connection, _, raw) in enumerate(reader.messages(joints) if joints else ()):
            message: Any = reader.deserialize(raw, connection.msgtype)
            if len(message.position) and len(message.effort) == len(message.position):
                return True
            if count == _LOOKED_AT:
                break
        return False

    def _position_topic(self, torques: str) -> str:
        """Topic of joint positions, other than that of torques which has none."""
        able = [name for name in self._of(JOINT_STATE) if name != torques] or self._of(*_STATES)
        best = [name for name in able if "desired" not in name and not name.endswith(_EXTERNAL)] or able
        option = "--joints (--topic of `pretouch skin calibrate`)"
        return self._one(best, able, "sensor_msgs/JointState", self._choice.joints, option)

    def _one(self, best: Sequence[str], able: Sequence[str], types: str, name: str, option: str) -> str:
        """The topic that is named, or the best one; RecordingError if that is not clear."""
        if name in able:
            return name
        if name:
            among = ", ".join(able) or "none"
            raise RecordingError(f"{self._place} has no topic {name!r} of {types}: choose {option} from {among}.")
        if not best and UNIT_SAMPLE in self._types.values():
            raise RecordingError(f"{self._place} holds samples of sensor units, but none of {types}: {READ_WITH}.")
        if not best:
            content = ", ".join(f"{t} ({c.replace('/msg/', '/')})" for t, c in sorted(self._types.items())) or "nothing"
            raise RecordingError(f"{self._place} has no topic of {types}; it holds {content}.")
        if len(best) > 1:
            raise RecordingError(
                f"{self._place} has several topics of {types}: choose one by {option}, {', '.join(able)}."
            )
        return best[0]

    def _read(self, *names: str) -> list[Log]:
        """Read topics, joints in the order of the arm that all their names tell of, on one clock."""
        topics = {name: _Topic(name, self._types[name]) for name in names}
        with self._opened() as reader:
            connections = [c for c in reader.connections if c.msgcount and c.topic in topics]
            for connection, time, raw in reader.messages(connections):
                topics[connection.topic].add(time, reader.deserialize(raw, connection.msgtype))
        joints = [topic for topic in topics.values() if topic.fields[0] == "q"]
        model = arm_of([name for topic in joints for name in topic.names], self._choice)
        parts = [topic.rows(self._place, model if topic in joints else None) for topic in topics.values()]
        # a simulation's stamps may begin with one of zero
        headers = all(np.count_nonzero(rows.header == 0) <= 1 for rows in parts)
        notes = () if headers else (Note("no_stamps", {}),)
        logs: list[Log] = []
        for topic, rows in zip(topics.values(), parts, strict=True):
            if headers:
                _check_header(self._place, topic.name, rows)
            effort = "tau_ext" if topic.name.endswith(_EXTERNAL) else "tau"
            kinds = [effort if field == "effort" else field for field in topic.fields]
            arrays = {kind: rows.values[:, i] for i, kind in enumerate(kinds) if np.isfinite(rows.values[:, i]).any()}
            stamps, sources = rows.header if headers else rows.logged, dict.fromkeys(arrays, topic.name)
            by_robot, own = "tau_ext" in arrays, () if logs else notes
            logs.append(Log(self._place, model, stamps, arrays, sources, topic.frame, by_robot, own))
        return logs


@value
class _Rows:
    """Rows of a topic, in the order of its recording."""

    logged: IntArray
    """(N,) when it was recorded [ns]."""
    header: IntArray
    """(N,) stamps of the headers [ns]."""
    values: FloatArray
    """(N, fields, n)."""


class _Topic:
    """Messages of one topic by the names of their joints."""

    def __init__(self, name: str, kind: str) -> None:
        self.name, self.frame = name, ""
        self.fields = _FIELDS.get(kind, _STATE_FIELDS)
        self._parts = {WRENCH: _wrench, JOINT_STATE: _joint_state}.get(kind, _franka_state)
        self._groups: dict[tuple[str, ...], tuple[array[int], array[int], array[float]]] = {}
        self._unequal: dict[tuple[str, ...], int] = {}

    @property
    def names(self) -> list[str]:
        """Names of all joints."""
        return list(dict.fromkeys(name for names in self._groups for name in names))

    def add(self, time: int, message: Any) -> None:
        """Take in a message that was recorded at a time [ns]."""
        names, parts = self._parts(message)
        self.frame = self.frame or message.header.frame_id
        logged, header, values = self._groups.setdefault(names, (array("q"), array("q"), array("d")))
        logged.append(time)
        header.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
        for part in parts:
            if len(part) not in (0, len(names)):
                self._unequal[names] = len(part)
            values.extend(part if len(part) == len(names) else [np.nan] * len(names))

    def rows(self, place: Path, model: RobotModel | None) -> _Rows:
        """Return the messages that have all joints of a model, in its order; without one, all messages."""
        names = self.names
        order = [names[i] for i in joint_places(place, names, model)] if model else names
        parts = []
        for group, (logged, header, values) in self._groups.items():
            if not set(order) <= set(group):
                continue
            if group in self._unequal:
                raise RecordingError(
                    f"A message on {self.name} of {place} names {len(group)} joints and has {self._unequal[group]}"
                    " values: record as many, or choose another topic."
                )
            table = np.array(values).reshape(len(logged), len(self.fields), len(group))
            parts.append((np.array(logged), np.array(header), table[:, :, [group.index(name) for name in order]]))
        if not parts:
            raise RecordingError(
                f"No message on {self.name} of {place} has all of {listed(order)}: choose another topic."
            )
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        by_time = np.argsort(columns[0], kind="stable")
        return _Rows(*(column[by_time] for column in columns))


def _wrench(message: Any) -> tuple[tuple[str, ...], list[Sequence[float]]]:
    f, t = message.wrench.force, message.wrench.torque
    return ("x", "y", "z"), [(f.x, f.y, f.z), (t.x, t.y, t.z)]


def _joint_state(message: Any) -> tuple[tuple[str, ...], list[Sequence[float]]]:
    parts = [message.position, message.velocity, message.effort]
    return tuple(message.name) or tuple(str(j + 1) for j in range(max(map(len, parts)))), parts


def _franka_state(message: Any) -> tuple[tuple[str, ...], list[Sequence[float]]]:
    names = tuple(f"joint{j}" for j in range(1, 8))
    if hasattr(message, "measured_joint_state"):
        measured, desired = message.measured_joint_state, message.desired_joint_state
        return names, [measured.position, measured.velocity, desired.velocity, message.tau_ext_hat_filtered.effort]
    return names, [message.q, message.dq, message.dq_d, message.tau_ext_hat_filtered]


def _check_header(place: Path, name: str, rows: _Rows) -> None:
    """Refuse stamps that go back, unless it is the clock of the recording that did."""
    back = np.count_nonzero(np.diff(rows.header) < -_LATE_NS)
    logged = rows.logged[np.argsort(rows.header, kind="stable")]
    if back and back <= np.count_nonzero(np.diff(logged) < -_LATE_NS):
        check_steps_back(place, rows.header, lambda i: f"message {i + 1} on {name}")


def _joined(logs: Sequence[Log], gap_s: float) -> Log:
    """Return the first of two logs with the positions and velocities of the other one at its instants."""
    log, joints = logs[0], _with_positions(logs[1]).in_order("q")
    at = {kind: interpolated(joints, kind, log.time, gap_s) for kind in ("q", "dq") if kind in joints.arrays}
    sources = log.sources | dict.fromkeys(at, joints.sources["q"])
    return replace(log, arrays=log.arrays | at, sources=sources, notes=(*log.notes, *joints.notes))


def _with_positions(log: Log) -> Log:
    """Return a log; RecordingError for one without joint positions."""
    if "q" not in log.arrays:
        raise RecordingError(f"{log.place} has joint states without a position for each joint: name another topic.")
    return log
