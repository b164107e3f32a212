"""The messages of a ROS 2 distribution on DDS, all from one source: the definitions that rosbags brings along.

`pretouch.recording.ros` makes values and bytes of them. DDS is told the same definitions as IDL types, under the names
that rmw gives them.
"""

from functools import cache
from typing import Any

from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl import types as idl
from rosbags.interfaces import Nodetype

from pretouch.errors import RobotError
from pretouch.recording import ros
from pretouch.recording.ros import DIAGNOSTICS as DIAGNOSTICS
from pretouch.recording.ros import JOINT_STATE as JOINT_STATE
from pretouch.recording.ros import RANGE as RANGE
from pretouch.recording.ros import TRANSFORMS as TRANSFORMS
from pretouch.recording.ros import WRENCH as WRENCH
from pretouch_ros2.params import Distribution

TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
CLOUD = "sensor_msgs/msg/PointCloud2"
TEXT = "std_msgs/msg/String"
STATUS = "diagnostic_msgs/msg/DiagnosticStatus"
TWIST = "geometry_msgs/msg/TwistStamped"
USED = (JOINT_STATE, WRENCH, RANGE, TRAJECTORY, CLOUD, TEXT, TRANSFORMS, DIAGNOSTICS, STATUS, TWIST)
"""All types on our topics."""

_NUMBERS = "int8 uint8 int16 uint16 int32 uint32 int64 uint64 float32 float64"
_BASE: dict[str, Any] = {name: getattr(idl, name) for name in _NUMBERS.split()} | {
    **dict.fromkeys(("byte", "octet", "char"), idl.uint8),
    "bool": bool,
    "string": str,
}
_ARRAY: Any = idl.array
_SEQUENCE: Any = idl.sequence


def _held(cls: type[Any], data: bytes, *_: Any, **__: Any) -> Any:
    """Return a message that holds bytes, in place of `IdlStruct.deserialize` and, as none has a key, its like."""
    message = object.__new__(cls)
    message.cdr = bytes(data)
    return message


class WireMessages(ros.Messages):
    """Makes, encodes and decodes the messages of one distribution."""

    def __init__(self, distribution: Distribution) -> None:
        super().__init__(distribution)
        self.distribution = distribution
        self.idl_type = cache(self._idl_type)
        self.wire_type = cache(self._wire_type)
        self.prepare(*USED)

    def decoded(self, kind: str, data: bytes) -> Any:
        """Return the message that bytes hold; those of another type or distribution are a RobotError."""
        try:
            return self.store.deserialize_cdr(data, kind)
        except Exception as error:  # any bytes may come from a network
            raise RobotError(
                f"A message of {len(data)} bytes is not a {kind} of {self.distribution}: choose the sender's"
                " distribution."
            ) from error

    def _wire_type(self, kind: str) -> Any:
        """Class of a type's messages for DDS, which know their type and hold `cdr`: rosbags takes half the time."""
        message_type: Any = make_idl_struct(kind.rpartition("/")[2], _dds_name(kind), self._fields(kind))
        message_type.serialize = lambda message, *_, **__: message.cdr
        message_type.deserialize = message_type.deserialize_key = classmethod(_held)
        return message_type

    def _idl_type(self, kind: str) -> type[IdlStruct]:
        """Class of a type that cyclonedds can encode by itself."""
        return make_idl_struct(kind.rpartition("/")[2], _dds_name(kind), self._fields(kind))

    def _fields(self, kind: str) -> dict[str, Any]:
        return {name: self._field(*described) for name, described in self.store.fielddefs[kind][1]}

    def _field(self, node: Nodetype, of: Any) -> Any:
        if node == Nodetype.BASE:
            return _BASE[of[0]]
        if node == Nodetype.NAME:
            return self.idl_type(of)
        element, length = self._field(*of[0]), of[1]
        if node == Nodetype.ARRAY:
            return _ARRAY[element, length]
        return _SEQUENCE[element, length] if length else _SEQUENCE[element]


def _dds_name(kind: str) -> str:
    """Name of a type on the wire: sensor_msgs/msg/Range is sensor_msgs::msg::dds_::Range_."""
    package, folder, name = kind.split("/")
    return f"{package}::{folder}::dds_::{name}_"
