"""ROS 2 messages by rosbags: the standard ones, and ours of `msg/`, made of our classes and back to the bit."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from importlib.resources import files
from operator import attrgetter
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import pretouch
from pretouch.errors import RecordingError
from pretouch.recording.mcap_file import Contents
from pretouch.types import FloatArray

LIBRARY = f"pretouch {pretouch.__version__}"
"""Name of the library in a file's header."""
PACKAGE = "pretouch_msgs"
OWN = ("Contact", "Obstacles", "QpSolution", "Thresholds", "Touched", "Step", "Truth", "Packed", "UnitSample")
"""Our types, each after those that it holds; each has a file in `msg/`."""
PACKED, UNIT_SAMPLE = f"{PACKAGE}/msg/Packed", f"{PACKAGE}/msg/UnitSample"
"""Types of what is MessagePack, and of datagrams."""
READ_WITH = "read it with pretouch.units.skin_recording.read_skin, or open it in Foxglove"
"""Advice on a recording of sensor units, as the end of a sentence."""
JOINT_STATE, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
RANGE, IMU = "sensor_msgs/msg/Range", "sensor_msgs/msg/Imu"
TRANSFORMS, MARKERS = "tf2_msgs/msg/TFMessage", "visualization_msgs/msg/MarkerArray"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

Look = tuple[int, tuple[float, ...], tuple[float, ...]]
"""Kind of a marker, its size (3,) [m] and its colour: red, green, blue, opacity."""
_DTYPES = {"byte": "uint8", "octet": "uint8", "char": "uint8"}
_ROWS = ("point", "body_point", "direction", "force", "touch_velocity")
"""Fields of ours that are rows of three numbers, where a message has any number of them: there they lie one by one."""
_NAMED = {"ControlStep": "Step"}
"""Message of a class that is not named as it."""


class Messages:
    """Makes, encodes and decodes the messages of one ROS 2 distribution."""

    def __init__(self, distribution: str) -> None:
        self.store = get_typestore(Stores(f"ros2_{distribution}"))
        self.types = self.store.types
        """Classes by type name, as sensor_msgs/msg/JointState."""
        self.blank = cache(self._blank)

    def prepare(self, *kinds: str) -> None:
        """Make the code that encodes types: the first message would wait for it."""
        for kind in kinds:
            self.store.get_msgdef(kind)

    def make(self, kind: str, *fields: Any, **named: Any) -> Any:
        """Make a message from its fields in order, or from some by name: the others are zero or empty."""
        return self.types[kind](*fields) if fields else self.types[kind](**(self.blank(kind) | named))

    def header(self, stamp: tuple[int, int], frame: str) -> Any:
        """Return a header for a stamp, in seconds and nanoseconds, and a frame."""
        return self.make("std_msgs/msg/Header", self.make("builtin_interfaces/msg/Time", *stamp), frame)

    def xyz(self, kind: str, numbers: Any) -> Any:
        """Return three numbers as one of geometry_msgs' types, such as Point."""
        x, y, z = (float(v) for v in numbers)
        return self.make(f"geometry_msgs/msg/{kind}", x, y, z)

    def transform(self, stamp: tuple[int, int], parent: str, child: str, p: FloatArray, rotation: FloatArray) -> Any:
        """Return where a frame is in its parent: position (3,) [m] and rotation (3, 3)."""
        from scipy.spatial.transform import Rotation

        turn = self.make("geometry_msgs/msg/Quaternion", *Rotation.from_matrix(rotation).as_quat().tolist())
        pose = self.make("geometry_msgs/msg/Transform", self.xyz("Vector3", p), turn)
        return self.make("geometry_msgs/msg/TransformStamped", self.header(stamp, parent), child, pose)

    def marker(
        self,
        header: Any,
        look: Look,
        position: Any = (0.0, 0.0, 0.0),
        turn: Any = (0.0, 0.0, 0.0, 1.0),
        points: Any = (),
        **more: Any,
    ) -> Any:
        """Make a marker of a look: where it is, its turn (x, y, z, w), corners (M, 3) [m], and other fields by name."""
        kind, size, color = look
        place = self.xyz("Point", position), self.make("geometry_msgs/msg/Quaternion", *(float(v) for v in turn))
        return self.make(
            "visualization_msgs/msg/Marker",
            header=header,
            type=kind,
            pose=self.make("geometry_msgs/msg/Pose", *place),
            scale=self.xyz("Vector3", size),
            color=self.make("std_msgs/msg/ColorRGBA", *color),
            points=[self.xyz("Point", p) for p in points],
            **more,
        )

    def encoded(self, kind: str, message: Any) -> bytes:
        """Return a message as CDR."""
        return bytes(self.store.serialize_cdr(message, kind, little_endian=True))

    def _blank(self, kind: str) -> dict[str, Any]:
        """Return the fields of a type by name, all of them zero or empty."""
        return {name: self._nothing(*described) for name, described in self.store.fielddefs[kind][1]}

    def _nothing(self, node: Nodetype, of: Any) -> Any:
        if node == Nodetype.BASE:
            return {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(of[0], 0)
        if node == Nodetype.NAME:
            return self.types[of](**self.blank(of))
        (element, name), length = of
        if element == Nodetype.BASE and name[0] != "string":
            return np.zeros(length if node == Nodetype.ARRAY else 0, dtype=_DTYPES.get(name[0], name[0]))
        return [self._nothing(element, name) for _ in range(length)] if node == Nodetype.ARRAY else []


@cache
def messages() -> Messages:
    """Return the messages of ROS 2 Jazzy, and ours."""
    jazzy = Messages("jazzy")
    for name in OWN:
        jazzy.store.register(get_types_from_msg(own_definition(name), own(name)))
    return jazzy


def prepare(*kinds: str) -> None:
    """Make the code that encodes types, and all of ours: the first message would wait for it."""
    messages().prepare(*kinds)
    for name in OWN:
        _fields(own(name))


def own(name: str) -> str:
    """Return the full name of a type of ours."""
    return f"{PACKAGE}/msg/{name}"


def own_definition(name: str) -> str:
    """Return the text of one of our message files, comments and all."""
    return (files("pretouch.recording") / "msg" / f"{name}.msg").read_text(encoding="utf-8")


@cache
def definition(kind: str) -> str:
    """Return the full definition of a type as MCAP embeds it (encoding `ros2msg`): its own, and that of its parts."""
    return messages().store.generate_msgdef(kind, ros_version=2)[0]


def decoded(kind: str, data: bytes) -> Any:
    """Return the message that CDR bytes hold; its arrays are aligned and writable. RecordingError if they hold none."""
    try:
        return messages().store.deserialize_cdr(bytearray(data), kind)  # type: ignore[arg-type]
    except Exception as error:  # rosbags meets damaged bytes with exceptions of any kind
        raise RecordingError(f"A message of the type {kind} in the recording cannot be read: {error}") from error


def encode(value: Any, sequence: int) -> bytes:
    """Return a value of one of our classes as CDR. Raises ValueError for an array of another type than its field."""
    kind = _own_name(type(value))
    return messages().encoded(kind, _message(kind, value, sequence))


def packed_message(number: int, data: bytes) -> bytes:
    """Return packed data as CDR."""
    return messages().encoded(PACKED, messages().types[PACKED](number, np.frombuffer(data, np.uint8)))


def packed_data(message: bytes) -> bytes:
    """Return the packed data that CDR holds."""
    return decoded(PACKED, message).data.tobytes()


def check_version(place: Path, contents: Contents) -> None:
    """Refuse a file whose messages of a type of ours are defined otherwise."""
    for channel in contents.channels.values():
        schema = contents.schemas.get(channel.schema_id)
        if schema and schema.name in map(own, OWN) and schema.data != definition(schema.name).encode():
            raise RecordingError(
                f"{place} was recorded by another version of pretouch, with different messages on {channel.topic}: open"
                " it with that version."
            )


def value_of(kind: type, data: bytes) -> Any:
    """Return the value of one of our classes that CDR holds; RecordingError if it holds none."""
    message = decoded(_own_name(kind), data)
    try:
        return _maker(kind)(message)
    except ValueError as error:
        raise RecordingError(f"A {kind.__name__} in the recording cannot be read: {error}") from error


def _own_name(kind: type) -> str:
    return own(_NAMED.get(kind.__name__, kind.__name__))


def _message(kind: str, value: Any, sequence: int = 0) -> Any:
    """Return the message of a value; `sequence` is the number of its step."""
    parts = []
    for name, what, of in _fields(kind):
        part: Any = sequence if what == "sequence" else getattr(value, name)
        if what == "array":
            if part.dtype != of:
                raise ValueError(f"{name} is an array of {part.dtype}, not {of}")
            part = part.reshape(-1)
        elif what == "has":
            part = part is not None
        elif what == "message":
            part = messages().types[of](**messages().blank(of)) if part is None else _message(of, part)
        elif what == "string" and isinstance(part, Enum):
            part = part.value
        parts.append(part)
    return messages().types[kind](*parts)


@cache
def _fields(kind: str) -> tuple[tuple[str, str, Any], ...]:
    """Return of each field of a message the value's field that it is of, what it is, and its type or dtype."""
    fields = list[tuple[str, str, Any]]()
    of: Any
    for name, (node, of) in messages().store.fielddefs[kind][1]:
        if name.startswith("has_"):
            fields.append((name.removeprefix("has_"), "has", None))
        elif node == Nodetype.NAME:
            fields.append((name, "message", of))
        elif node == Nodetype.BASE:
            fields.append((name, "sequence" if name == "sequence" else of[0], None))
        else:
            fields.append((name, "array", np.dtype(of[0][1][0])))
    return tuple(fields)


@cache
def _maker(kind: type) -> Callable[[Any], Any]:
    """Return what makes a value of a class from a message."""
    described = dict(messages().store.fielddefs[_own_name(kind)][1])
    rows = {name for name in _ROWS if name in described and described[name][0] == Nodetype.SEQUENCE}
    ways = tuple(_way(name, hint, name in rows) for name, hint in hints_of(kind))
    return lambda message: kind(*[way(message) for way in ways])


def _way(name: str, hint: Any, rows: bool) -> Callable[[Any], Any]:
    """Return the function that makes a field of a class from a message."""
    get = attrgetter(name)
    if get_origin(hint) in (Union, UnionType):  # of a class and None
        (inner_hint,) = (inner for inner in get_args(hint) if inner is not NoneType)
        is_there, make = attrgetter(f"has_{name}"), _way(name, inner_hint, rows)
        return lambda message: make(message) if is_there(message) else None
    if isinstance(hint, type) and issubclass(hint, Enum):
        return lambda message: hint(get(message))
    if is_record(hint):
        inner = _maker(hint)
        return lambda message: inner(get(message))
    return (lambda message: get(message).reshape(-1, 3)) if rows else get


def is_record(hint: Any) -> bool:
    """Return True if a type is a dataclass or a named tuple."""
    return isinstance(hint, type) and (is_dataclass(hint) or hasattr(hint, "_fields"))


@cache
def hints_of(kind: type) -> tuple[tuple[str, Any], ...]:
    """Return names and annotations of the fields of a dataclass or named tuple, in order."""
    hints = get_type_hints(kind)
    return tuple((name, hints[name]) for name in (getattr(kind, "_fields", None) or [f.name for f in fields(kind)]))
