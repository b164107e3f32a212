"""ROS bags and MCAP files: WrenchStamped, JointState, and Franka's robot states."""

from array import array
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.errors import RecordingError
from pretouch.imported_data.bag_files import opened_bag
from pretouch.imported_data.log import Choice, Log, Note, arm_of, goes_on, joint_places, listed
from pretouch.recording.ros import JOINT_STATE, READ_WITH, UNIT_SAMPLE, WRENCH
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

_STATES = ("franka_msgs/msg/FrankaState", "franka_msgs/msg/FrankaRobotState")
"""States of franka_ros and of franka_ros2."""
_USED = (WRENCH, JOINT_STATE, *_STATES)
"""Types that are read."""
_EXTERNAL = "external_joint_torques"
"""Last part of the topic on which franka_ros2 publishes external torques, as efforts."""
_FIELDS = {WRENCH: ("force", "torque"), JOINT_STATE: ("q", "dq", "effort")}
_STATE_FIELDS = ("q", "dq", "dq_d", "tau_ext")
_WHAT = ("positions", "velocities", "efforts")
_PACE = 0.1
"""Difference in pace, as a share, from which on two clocks are not the same."""
_POSTURE_GAP_S, _MOTION_GAP_S = 0.2, 0.1
"""Time between two joint positions within which the arm is taken to move evenly [s]: for a force, and for torques."""


class Bag:
    """A bag or MCAP file."""

    def __init__(self, place: Path, choice: Choice) -> None:
        """See what it holds. RecordingError for what cannot be read."""
        self._place, self._choice = place, choice
        with opened_bag(place) as files:
            topics = [topic for file in files for topic in file.topics if topic.count]
            self._notes = [Note("cut", {})] * (not all(file.complete for file in files))
        self._types, self._decode, faults = dict[str, str](), dict[str, Callable[[bytes], Any]](), list[str]()
        for topic in topics:
            try:
                if topic.kind in _USED or "/msg/" not in topic.kind:  # the others are not read
                    self._decode[topic.name] = topic.decoder(place)
            except RecordingError as error:
                faults.append(str(error))
                self._notes += [Note("fault", {"reason": faults[-1]})] * (topic.kind in _USED)
            else:
                self._types[topic.name] = topic.kind
        types = set(self._types.values())
        if faults and not types & {*_USED, UNIT_SAMPLE}:
            raise RecordingError(
                f"{place} cannot be used, for {' and '.join(faults)}: record messages of ROS 2 by `ros2 bag record -s"
                " mcap`, which keeps their definitions, or write a table."
            )
        kinds = {"force"} if WRENCH in types else set()
        kinds |= {"q"} if types & {JOINT_STATE, *_STATES} else set()
        if self._of(*_STATES) or any(name.endswith(_EXTERNAL) for name in self._of(JOINT_STATE)):
            kinds.add("tau_ext")
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
            raise RecordingError(
                f"{name} of {self._place} has joint positions but no torques: it has no efforts of the joints. Record"
                " these too, or choose another --torques."
            )
        if "q" in log.arrays and self._choice.joints in ("", name):
            return log
        return _joined(self._read(name, self._position_topic(name)), _MOTION_GAP_S)

    def positions(self) -> Log:
        """Read joint positions."""
        return _with_positions(self._read(self._position_topic(""))[0])

    def _of(self, *types: str) -> list[str]:
        """Topics of some types."""
        return sorted(name for name, kind in self._types.items() if kind in types)

    def _position_topic(self, torques: str) -> str:
        """Topic of joint positions, other than that of torques which has none."""
        able = [name for name in self._of(JOINT_STATE) if name != torques] or self._of(*_STATES)
        if torques and not able and not self._choice.joints:
            raise RecordingError(f"{self._place} has joint torques, on {torques}, but no joint positions: record both.")
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
        with opened_bag(self._place) as files:
            for name, time, raw in (message for file in files for message in file.read(set(names))):
                topics[name].add(time, self._decode[name](raw))
        joints = [topic for topic in topics.values() if topic.fields[0] == "q"]
        model = arm_of([name for topic in joints for name in topic.names], self._choice)
        parts = [topic.rows(self._place, model if topic in joints else None) for topic in topics.values()]
        headers, notes = _clock(parts, self._choice.stamps)
        logs: list[Log] = []
        for topic, rows in zip(topics.values(), parts, strict=True):
            effort = "tau_ext" if topic.name.endswith(_EXTERNAL) else "tau"
            kinds = [effort if field == "effort" else field for field in topic.fields]
            arrays = {kind: rows.values[:, i] for i, kind in enumerate(kinds) if np.isfinite(rows.values[:, i]).any()}
            stamps, sources = rows.header if headers else rows.logged, dict.fromkeys(arrays, topic.name)
            row, own = f"message {{}} on {topic.name}", () if logs else (*self._notes, *notes)
            of = topic.frame, "tau_ext" in arrays, own
            logs.append(Log(self._place, model, stamps, rows.number, row, arrays, sources, *of).forward())
        return logs


@value
class _Rows:
    """Rows of a topic, in the order of the file."""

    number: IntArray
    """(N,) of its messages, from 1."""
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
        self._groups: dict[tuple[str, ...], tuple[array[int], array[float]]] = {}
        self._count = 0
        self._unequal: dict[tuple[str, ...], str] = {}

    @property
    def names(self) -> list[str]:
        """Names of all joints."""
        return list(dict.fromkeys(name for names in self._groups for name in names))

    def add(self, time: int, message: Any) -> None:
        """Take in a message that was recorded at a time [ns]."""
        names, parts = self._parts(message)
        self.frame, self._count = self.frame or message.header.frame_id, self._count + 1
        times, values = self._groups.setdefault(names, (array("q"), array("d")))
        times.extend((self._count, time, message.header.stamp.sec * 10**9 + message.header.stamp.nanosec))
        for what, part in zip((*_WHAT, "values"), parts, strict=False):
            if len(part) not in (0, len(names)):
                counts = f"names {len(names)} joints and has {len(part)} {what}"
                self._unequal.setdefault(names, f"Message {self._count} on {self.name} of {{}} {counts}")
            values.frombytes(
                np.asarray(part if len(part) == len(names) else [np.nan] * len(names), np.float64).tobytes()
            )

    def rows(self, place: Path, model: RobotModel | None) -> _Rows:
        """Return the messages that have all joints of a model, in its order; without one, all messages."""
        names = self.names
        order = [names[i] for i in joint_places(place, names, model)] if model else names
        times, tables = [], []
        for group, (instants, values) in self._groups.items():
            if not set(order) <= set(group):
                continue
            if group in self._unequal:
                raise RecordingError(f"{self._unequal[group].format(place)}: record as many, or choose another topic.")
            times.append(np.array(instants).reshape(-1, 3))
            table = np.array(values).reshape(-1, len(self.fields), len(group))
            tables.append(table[:, :, [group.index(name) for name in order]])
        if not times:
            raise RecordingError(
                f"No message on {self.name} of {place} has all of {listed(order)}: choose another topic."
            )
        columns, table = np.concatenate(times), np.concatenate(tables)
        by_number = np.argsort(columns[:, 0])
        number, logged, header = columns[by_number].T
        return _Rows(number, logged, header, table[by_number])


def _clock(parts: Sequence[_Rows], choice: str) -> tuple[bool, list[Note]]:
    """Return whether the times of messages are those of their headers, and what is to be said of that."""
    # a simulation's stamps may begin with one of zero
    stamped = all(np.count_nonzero(rows.header == 0) <= 1 for rows in parts)
    logged = all(goes_on(rows.logged) for rows in parts)
    headers = stamped and (all(goes_on(rows.header) for rows in parts) or not logged)
    if choice != "auto" or (headers and not logged):
        return headers if choice == "auto" else choice == "headers", []
    if not headers:
        return False, [Note("headers_back" if stamped else "no_stamps", {})]
    own, other = (float(np.ptp(np.quantile(time, (0.05, 0.95)))) for time in (parts[0].header, parts[0].logged))
    pace = own / max(other, 1.0)
    return True, [] if abs(pace - 1.0) < _PACE or len(parts[0].number) < 3 else [Note("pace", {"pace": pace})]


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


def _joined(logs: Sequence[Log], gap_s: float) -> Log:
    """Return the first of two logs with the positions and velocities of the other one at its instants."""
    log, joints = logs[0], _with_positions(logs[1]).in_order("q")
    at = {kind: interpolated(joints, kind, log.time, gap_s) for kind in ("q", "dq") if kind in joints.arrays}
    sources = log.sources | dict.fromkeys(at, joints.sources["q"])
    return replace(log, arrays=log.arrays | at, sources=sources, notes=(*log.notes, *joints.notes))


def interpolated(log: Log, kind: str, ticks: IntArray, longest_s: float) -> FloatArray:
    """Values (S, m) at each tick [ns], linear between samples that are at most so far apart [s], or else NaN.

    The log is in order. The last value is held for as long; before the first there is none.
    """
    time, values = log.time, log.arrays[kind]
    at = np.full((len(ticks), values.shape[1]), np.nan)
    left = np.searchsorted(time, ticks, side="right") - 1
    right = np.minimum(left + 1, len(time) - 1)
    gap = np.where(left == right, ticks - time[left], time[right] - time[left])
    inside = (left >= 0) & (gap <= 1e9 * longest_s)
    i, j = left[inside], right[inside]
    share = (ticks[inside] - time[i]) / np.maximum(gap[inside], 1)
    at[inside] = values[i] + share[:, None] * (values[j] - values[i])
    return at


def _with_positions(log: Log) -> Log:
    """Return a log; RecordingError for one without joint positions."""
    if "q" not in log.arrays:
        raise RecordingError(f"{log.place} has joint states without a position for each joint: name another topic.")
    return log
