"""A recording in a ROS bag or an MCAP file: geometry_msgs/WrenchStamped and sensor_msgs/JointState."""

import re
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from pretouch.errors import RecordingError
from pretouch.imported_data.source import Choice, Series, Source
from pretouch.recording.skin_recording import READ_WITH, UNIT_SAMPLE

WRENCH, JOINTS = "geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/JointState"
_HELD = {WRENCH: "force", JOINTS: "joint positions"}
_JOINT = re.compile(r"(?!.*finger).*joint_?([1-7])")
"""Names of the joints of the arms that are known: panda_joint1, fr3_joint1, joint_1."""
Row = tuple[float, ...]
_CLOCKS_APART_S = 5.0
"""How far header stamps may drift from the times of recording [s] before they are not believed."""


class Topic:
    """What was read of one topic."""

    def __init__(self, name: str, width: int, row: Callable[[Any], Row | None]) -> None:
        self.name, self.frame = name, ""
        self.logged, self.header = array("q"), array("q")
        self._width, self._row = width, row
        self._values = array("d")

    def add(self, time: int, message: Any) -> None:
        """Take in a message that was recorded at a time [ns]."""
        row = self._row(message)
        if row is not None:
            if len(row) != self._width:
                raise RecordingError(f"A message on {self.name} has {len(row)} numbers, not {self._width}: check it.")
            self.frame = self.frame or message.header.frame_id
            self.logged.append(time)
            self.header.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
            self._values.extend(row)

    def series(self, headers: bool) -> Series:
        """Return what was read, at the headers' stamps or else at the times of recording."""
        stamps = np.array(self.header if headers else self.logged, dtype=np.int64)
        return Series(stamps, np.array(self._values, dtype=np.float64).reshape(-1, self._width))


def read_bag(place: Path, choice: Choice) -> Source:
    """Read a bag or MCAP file. RecordingError for what cannot be read, and for topics that are not clear."""
    with read_errors_said(place):
        reader = AnyReader([place], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    try:
        wanted, picker = _wanted(place, reader, choice), JointPicker(7, _numbered)
        force = Topic(wanted[WRENCH][0].topic, 6, _wrench)
        joints = Topic(wanted[JOINTS][0].topic, 7, picker) if wanted[JOINTS] else None
        topics = [force, *([joints] if joints else [])]
        fill(place, reader, [c for connections in wanted.values() for c in connections], topics)
    finally:
        reader.close()
    if joints and not joints.logged:
        raise RecordingError(
            f"{joints.name} of {place} names the joints {picker.seen()}, but those of a Panda or FR3 are needed,"
            " joint1 to joint7."
        )
    headers, notes = believed(topics)
    return Source(
        f"the topic {force.name}",
        force.series(headers),
        force.frame,
        joints.series(headers) if joints else None,
        picker.arm,
        notes,
    )


@contextmanager
def read_errors_said(place: Path) -> Iterator[None]:
    """Say in a sentence what rosbags finds wrong: it meets broken files with exceptions of any kind."""
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:
        what = " ".join(str(error).split())[:200] or type(error).__name__
        mend = "; `mcap recover` repairs a truncated one"
        raise RecordingError(
            f"{place} cannot be read as a bag or MCAP file ({what}): give a complete"
            f" file{mend if place.suffix == '.mcap' else ''}."
        ) from error


def _wanted(place: Path, reader: AnyReader, choice: Choice) -> dict[str, list[Any]]:
    """Connections to read, by type: one topic of forces, and one of joints if needed."""
    there = [c for c in reader.connections if c.msgcount]
    wanted = {WRENCH: one_topic(place, there, WRENCH, "--wrench", choice.wrench)}
    wanted[JOINTS] = one_topic(place, there, JOINTS, "--joints", choice.joints) if choice.posture else []
    return wanted


def one_topic(place: Path, there: list[Any], kind: str, option: str, named: str) -> list[Any]:
    """Connections of the one topic of a type, or of the one that is named. RecordingError if that is not clear."""
    topics = sorted({c.topic for c in there if c.msgtype == kind})
    short = kind.replace("/msg/", "/")
    if not topics and any(c.msgtype == UNIT_SAMPLE for c in there):
        raise RecordingError(f"{place} holds samples of sensor units, but no {_HELD[kind]}: {READ_WITH}.")
    if not topics:
        held = ", ".join(sorted({f"{c.topic} ({c.msgtype.replace('/msg/', '/')})" for c in there})) or "nothing"
        raise RecordingError(f"{place} has no topic of type {short}; it holds {held}.")
    if named and named not in topics:
        raise RecordingError(f"{place} has no topic {named!r} of {short}: choose {option} from {', '.join(topics)}.")
    if not named and len(topics) > 1:
        raise RecordingError(f"{place} has several topics of {short}: choose one by {option}, {', '.join(topics)}.")
    chosen = named or topics[0]
    return [c for c in there if c.msgtype == kind and c.topic == chosen]


def fill(place: Path, reader: AnyReader, connections: list[Any], topics: list[Topic]) -> None:
    """Read the messages of connections into their topics."""
    by_name = {topic.name: topic for topic in topics}
    with read_errors_said(place):
        for connection, time, raw in reader.messages(connections):
            by_name[connection.topic].add(time, reader.deserialize(raw, connection.msgtype))


def believed(topics: list[Topic]) -> tuple[bool, tuple[str, ...]]:
    """Whether the headers' stamps can be believed, or else the times of recording are to be used, and why."""
    logged = np.concatenate([np.array(topic.logged, dtype=np.int64) for topic in topics])
    header = np.concatenate([np.array(topic.header, dtype=np.int64) for topic in topics])
    if not len(logged) or not np.ptp(logged):
        return True, ()
    if any(topic.header.count(0) > 1 for topic in topics):  # a simulation's may begin with one
        return False, ("Some headers have no stamp, so the times of recording are used.",)
    drift = float(np.ptp(header - logged)) / 1e9
    if drift > _CLOCKS_APART_S:
        return False, (
            f"The headers' stamps and the times of recording drift {drift:.3g} s apart, so the times of recording are"
            " used.",
        )
    return True, ()


def _wrench(message: Any) -> Row:
    f, t = message.wrench.force, message.wrench.torque
    return f.x, f.y, f.z, t.x, t.y, t.z


class JointPicker:
    """Picks the joints of an arm out of messages: their order may differ, and a gripper's states lie between."""

    def __init__(self, n: int, places: Callable[[tuple[str, ...]], dict[int, int]]) -> None:
        """Take the number of joints, and what finds where each of them stands among names."""
        self._n, self._places = n, places
        self._orders: dict[tuple[str, ...], list[int]] = {}

    def __call__(self, message: Any) -> Row | None:
        """Positions of all joints in order, or None of a message that has not all of them."""
        names, n = tuple(message.name), self._n
        if names not in self._orders:
            places = self._places(names)
            unnamed = list(range(n)) if not names and len(message.position) == n else []
            self._orders[names] = [places[j] for j in range(n)] if len(places) == n else unnamed
        order = self._orders[names]
        if not order or len(message.position) <= max(order):
            return None
        return tuple(float(message.position[i]) for i in order)

    @property
    def arm(self) -> str:
        """The arm the names tell of, if they do."""
        named = " ".join(name for names, order in self._orders.items() if order for name in names)
        return "fr3" if "fr3" in named else "panda" if "panda" in named else "auto"

    def seen(self) -> str:
        """All joints that were named."""
        return "; ".join(", ".join(names) for names in self._orders) or "none"


def _numbered(names: tuple[str, ...]) -> dict[int, int]:
    """Where joints 1 to 7 stand among names."""
    return {int(found[1]) - 1: i for i, name in enumerate(names) if (found := _JOINT.fullmatch(name))}
