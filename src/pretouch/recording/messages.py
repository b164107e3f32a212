"""The message types of a recording: our own, from the files in `msg/`, and the standard ones of ROS 2."""

from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

import pretouch
from pretouch.errors import RecordingError

FORMAT = 1
"""Version of our messages: a change that older programs cannot read raises it."""

LIBRARY = f"pretouch {pretouch.__version__}"
"""What a file says it was written by."""

PACKAGE = "pretouch_msgs"
OWN = (
    "RobotState", "RangeReadings", "Inputs", "Obstacles", "Thresholds", "Contact", "QpSolution", "Touched", "Step",
    "Run", "State", "Truth", "UnitSample", "Touch", "ImuReadings", "SeenPoints",
)  # fmt: skip
"""Our types; each has a file in `msg/`."""
_ON_TOPICS = ("Run", "Inputs", "Step", "State", "Truth", "Touch", "SeenPoints")
TOPICS = {f"/pretouch/{name.lower()}": f"{PACKAGE}/msg/{name}" for name in _ON_TOPICS}
TOPICS["/pretouch/imu"] = f"{PACKAGE}/msg/ImuReadings"
"""Type of the messages on each of our topics."""

_HEAD = 4
"""Bytes of the encapsulation header before a CDR message."""
_PARTS = {
    "Inputs": ("RobotState", "RangeReadings"),
    "Step": ("Obstacles", "Thresholds", "Contact", "QpSolution", "Touched"),
}


class Item(NamedTuple):
    """One message to write."""

    topic: str
    kind: str
    sequence: int
    time: int
    """[ns]"""
    data: bytes


@cache
def own_definition(name: str) -> str:
    """Return the text of one of our message files, comments and all."""
    return (files("pretouch.recording") / "msg" / f"{name}.msg").read_text(encoding="utf-8")


@cache
def typestore() -> Typestore:
    """Return the types of ROS 2 Jazzy, and ours. Since Iron, sensor_msgs/Range has a variance."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in OWN:
        store.register(get_types_from_msg(own_definition(name), f"{PACKAGE}/msg/{name}"))
    return store


def definition(kind: str) -> str:
    """Return the full definition of a type as MCAP embeds it (encoding `ros2msg`): its own, and that of its parts."""
    package, _, name = kind.split("/")
    if package != PACKAGE:
        return typestore().generate_msgdef(kind, ros_version=2)[0]
    parts = [f"{'=' * 80}\nMSG: {PACKAGE}/{part}\n{own_definition(part)}" for part in _PARTS.get(name, ())]
    return "".join([own_definition(name), *parts])


def make(kind: str, *fields: Any) -> Any:
    """Make a message of a type from its fields, in order."""
    return typestore().types[kind](*fields)


def encoded(kind: str, message: Any) -> bytes:
    """Return a message as CDR."""
    return bytes(typestore().serialize_cdr(message, kind, little_endian=True))


def decoded(kind: str, data: bytes) -> Any:
    """Return the message that CDR bytes hold; its arrays are aligned and writable.

    Raises RecordingError for bytes that hold none.
    """
    # arrays are views into the buffer: four bytes in front of the header align them
    room = np.zeros(_HEAD + len(data), dtype=np.uint8)
    room[_HEAD:] = np.frombuffer(data, dtype=np.uint8)
    try:
        return typestore().deserialize_cdr(memoryview(room.data)[_HEAD:], kind)
    except SerdeError as error:
        raise RecordingError(f"A message of the type {kind} in the recording cannot be read: {error}") from error


def prepare(*kinds: Iterable[str]) -> None:
    """Have the code made that encodes types: at the first message, it would keep a control loop waiting."""
    for kind in chain(*kinds):
        typestore().get_msgdef(kind)


def plain_text(text: str) -> str:
    """Return a text that UTF-8 can hold."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
