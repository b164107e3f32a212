"""The messages of a ROS 2 distribution, all from one source: the definitions that rosbags brings along.

rosbags makes values and bytes of them. DDS is told the same definitions as IDL types, under the names rmw gives them.
"""

from functools import cache
from typing import Any

import numpy as np
from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl import types as idl
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pretouch.errors import RobotError
from pretouch_ros2.params import Distribution

JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH = "geometry_msgs/msg/WrenchStamped"
RANGE = "sensor_msgs/msg/Range"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
CLOUD = "sensor_msgs/msg/PointCloud2"
TEXT = "std_msgs/msg/String"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
MARKERS = "visualization_msgs/msg/MarkerArray"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
STATUS = "diagnostic_msgs/msg/DiagnosticStatus"
TWIST = "geometry_msgs/msg/TwistStamped"
FRANKA_STATE = "franka_msgs/msg/FrankaRobotState"
USED = (
    JOINT_STATE, WRENCH, RANGE, TRAJECTORY, CLOUD, TEXT, TRANSFORMS, MARKERS, DIAGNOSTICS, STATUS,
    TWIST,
)  # fmt: skip
"""All standard types on our topics."""
_FRANKA = (
    "std_msgs/Header header\ngeometry_msgs/Vector3[4] cartesian\nfloat64[14] joint\n"
    "sensor_msgs/JointState measured\nsensor_msgs/JointState desired\nsensor_msgs/JointState motor\n"
    "float64[7] ddq_d\nfloat64[7] dtau_j\nsensor_msgs/JointState tau_ext_hat_filtered\n"
)
"""How a FrankaRobotState begins, bytes alike: its end differs by release, and is not read."""

_BASE: dict[str, Any] = {
    "bool": bool, "byte": idl.uint8, "octet": idl.uint8, "char": idl.uint8, "int8": idl.int8, "uint8": idl.uint8,
    "int16": idl.int16, "uint16": idl.uint16, "int32": idl.int32, "uint32": idl.uint32, "int64": idl.int64,
    "uint64": idl.uint64, "float32": idl.float32, "float64": idl.float64, "string": str,
}  # fmt: skip
_ARRAY: Any = idl.array
_SEQUENCE: Any = idl.sequence
_NUMPY = {"byte": "uint8", "octet": "uint8", "char": "uint8"}


def _as_it_is(message: Any, *_: Any, **__: Any) -> bytes:
    """Return the bytes of a message, in place of `IdlStruct.serialize`."""
    return message.cdr


def _held(cls: type[Any], data: bytes, *_: Any, **__: Any) -> Any:
    """Return a message that holds bytes, in place of `IdlStruct.deserialize` and, as none has a key, its like."""
    message = object.__new__(cls)
    message.cdr = bytes(data)
    return message


class Messages:
    """Makes, encodes and decodes the messages of one distribution."""

    def __init__(self, distribution: Distribution) -> None:
        self.distribution = distribution
        self._store = get_typestore(Stores(f"ros2_{distribution}"))
        self._store.register(get_types_from_msg(_FRANKA, FRANKA_STATE))
        self.types = self._store.types
        """Classes by type name, as sensor_msgs/msg/JointState."""
        self.idl_type = cache(self._idl_type)
        self.wire_type = cache(self._wire_type)
        self.blank = cache(self._blank)
        for kind in (*USED, FRANKA_STATE):
            self._store.get_msgdef(kind)  # makes the code that encodes: the first message would wait for it

    def make(self, kind: str, *fields: Any) -> Any:
        """Make a message from its fields, in order."""
        return self.types[kind](*fields)

    def header(self, stamp: tuple[int, int], frame: str) -> Any:
        """Return a header for a stamp, in seconds and nanoseconds, and a frame."""
        return self.make("std_msgs/msg/Header", self.make("builtin_interfaces/msg/Time", *stamp), frame)

    def xyz(self, kind: str, given: Any) -> Any:
        """Return three numbers as one of geometry_msgs' types, such as Point."""
        x, y, z = (float(v) for v in given)
        return self.make(f"geometry_msgs/msg/{kind}", x, y, z)

    def encoded(self, kind: str, message: Any) -> bytes:
        """Return a message as CDR."""
        return bytes(self._store.serialize_cdr(message, kind, little_endian=True))

    def decoded(self, kind: str, data: bytes) -> Any:
        """Return the message that bytes hold; those of another type or distribution are a RobotError."""
        try:
            if kind == FRANKA_STATE:  # more follows than is read
                definition = self._store.get_msgdef(kind)
                read = definition.deserialize_cdr_le if data[1] else definition.deserialize_cdr_be
                return read(data[4:], 0, definition.cls, self._store)[0]
            return self._store.deserialize_cdr(data, kind)
        except Exception as error:  # any bytes may come from a network
            raise RobotError(
                f"A message of {len(data)} bytes is not a {kind} of {self.distribution}: choose the sender's"
                " distribution."
            ) from error

    def type_hash(self, kind: str) -> str:
        """Return the hash of a type that rmw sends along since Iron; '' of one that is only known in part."""
        return "" if kind == FRANKA_STATE else self._store.hash_rihs01(kind)

    def _wire_type(self, kind: str) -> Any:
        """Class of a type's messages for DDS, which know their type and hold `cdr`: rosbags takes half the time."""
        made: Any = make_idl_struct(kind.rpartition("/")[2], _dds_name(kind), self._fields(kind))
        made.serialize = _as_it_is
        made.deserialize = made.deserialize_key = classmethod(_held)
        return made

    def _idl_type(self, kind: str) -> type[IdlStruct]:
        """Class of a type that cyclonedds can encode by itself."""
        return make_idl_struct(kind.rpartition("/")[2], _dds_name(kind), self._fields(kind))

    def _fields(self, kind: str) -> dict[str, Any]:
        return {name: self._field(*described) for name, described in self._store.fielddefs[kind][1]}

    def _field(self, node: Nodetype, of: Any) -> Any:
        if node == Nodetype.BASE:
            return _BASE[of[0]]
        if node == Nodetype.NAME:
            return self.idl_type(of)
        element, length = self._field(*of[0]), of[1]
        if node == Nodetype.ARRAY:
            return _ARRAY[element, length]
        return _SEQUENCE[element, length] if length else _SEQUENCE[element]

    def _blank(self, kind: str) -> dict[str, Any]:
        """Return the fields of a type by name, all of them zero or empty."""
        return {name: self._nothing(*described) for name, described in self._store.fielddefs[kind][1]}

    def _nothing(self, node: Nodetype, of: Any) -> Any:
        if node == Nodetype.BASE:
            return {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(of[0], 0)
        if node == Nodetype.NAME:
            return self.types[of](**self.blank(of))
        (element, name), length = of
        if element == Nodetype.BASE and name[0] != "string":
            return np.zeros(length if node == Nodetype.ARRAY else 0, dtype=_NUMPY.get(name[0], name[0]))
        return [self._nothing(element, name) for _ in range(length)] if node == Nodetype.ARRAY else []


def _dds_name(kind: str) -> str:
    """Name of a type on the wire: sensor_msgs/msg/Range is sensor_msgs::msg::dds_::Range_."""
    package, folder, name = kind.split("/")
    return f"{package}::{folder}::dds_::{name}_"
