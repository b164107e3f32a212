"""Bytes on the wire: rosbags, which makes them, against cyclonedds' own encoder of the same definitions."""

from functools import cache
from typing import Any, get_args

import numpy as np
import pytest
from rosbags.interfaces import Nodetype

from pretouch.errors import RobotError
from pretouch_ros2.messages import JOINT_STATE, RANGE, TRAJECTORY, TRANSFORMS, USED, WireMessages
from pretouch_ros2.params import Distribution

FLOATS = (np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324, 1.5)
SPANS = {"int8": 7, "uint8": 8, "byte": 7, "octet": 7, "char": 8, "int16": 15, "uint16": 16, "int32": 31, "uint32": 32}


@cache
def messages_of(distribution: Distribution) -> WireMessages:
    return WireMessages(distribution)


class Drawn:
    """Draws messages of any type: as rosbags has them, and as cyclonedds has them."""

    def __init__(self, messages: WireMessages, seed: int) -> None:
        self.messages, self.rng = messages, np.random.default_rng(seed)

    def pair(self, kind: str) -> tuple[Any, Any]:
        fields = {name: self.field(*of) for name, of in self.messages.store.fielddefs[kind][1]}
        ours = self.messages.types[kind](**{name: a for name, (a, _) in fields.items()})
        return ours, self.messages.idl_type(kind)(**{name: b for name, (_, b) in fields.items()})

    def field(self, node: Nodetype, of: Any) -> tuple[Any, Any]:
        if node == Nodetype.BASE:
            value = self.base(of[0])
            return value, value
        if node == Nodetype.NAME:
            return self.pair(of)
        element, length = of
        count = length if node == Nodetype.ARRAY else int(self.rng.choice([0, 1, 2, 5]))
        drawn = [self.field(*element) for _ in range(count)]
        ours: Any = [a for a, _ in drawn]
        if element[0] == Nodetype.BASE and element[1][0] != "string":
            ours = np.array(ours, dtype={"byte": "uint8", "octet": "uint8"}.get(element[1][0], element[1][0]))
        return ours, [b for _, b in drawn]

    def base(self, kind: str) -> Any:
        if kind == "string":
            return self.rng.choice(["", "a", "panda_link0", "ümlaut", "x" * 3000]).item()
        if kind == "bool":
            return bool(self.rng.integers(2))
        if kind.startswith("float"):
            return float(np.dtype(kind).type(self.rng.choice([*FLOATS, self.rng.normal()])))
        bits = SPANS[kind]
        signed = not kind.startswith("u") and kind.startswith("int")
        return int(self.rng.integers(-(2**bits) if signed else 0, 2**bits))


@pytest.mark.parametrize("distribution", get_args(Distribution))
@pytest.mark.parametrize("kind", USED)
def test_both_encoders_make_the_same_bytes_and_one_decodes_what_the_other_makes(kind, distribution):
    messages = messages_of(distribution)
    for seed in range(15):
        ours, theirs = Drawn(messages, seed).pair(kind)
        encoded = messages.encoded(kind, ours)
        made = theirs.__idl__.serialize(theirs, use_version_2=False)
        # XTypes pads what follows the message, and says by how much in its header
        assert encoded == made[:2] + b"\0\0" + made[4 : len(made) - (made[3] & 3)]
        assert repr(messages.idl_type(kind).deserialize(encoded)) == repr(theirs)  # NaN is equal to itself there
        # with the padding that cyclonedds puts on the wire
        again = messages.decoded(kind, encoded.ljust(4, b"\0") + b"\0" * (-len(encoded) % 4))
        assert messages.encoded(kind, again) == encoded


def test_names_are_those_of_rmw():
    names = [messages_of("humble").wire_type(kind).__idl_typename__ for kind in (JOINT_STATE, TRAJECTORY)]
    assert names == ["sensor_msgs::msg::dds_::JointState_", "trajectory_msgs::msg::dds_::JointTrajectory_"]


@pytest.mark.parametrize(("sender", "receiver"), [("humble", "jazzy"), ("jazzy", "humble"), ("foxy", "iron")])
def test_a_range_of_another_layout_is_refused_and_names_the_way_out(sender, receiver):
    theirs, ours = messages_of(sender), messages_of(receiver)
    sent = theirs.encoded(RANGE, theirs.types[RANGE](**theirs.blank(RANGE)))
    with pytest.raises(RobotError, match=r"is not a sensor_msgs/msg/Range of .*: choose the sender's distribution"):
        ours.decoded(RANGE, sent)


@pytest.mark.parametrize("cut", [0, 3, 4, 11, 40])
def test_a_message_cut_off_is_refused(cut):
    messages = messages_of("jazzy")
    ours, _ = Drawn(messages, 3).pair(TRANSFORMS)
    with pytest.raises(RobotError, match="is not a tf2_msgs/msg/TFMessage of jazzy"):
        messages.decoded(TRANSFORMS, messages.encoded(TRANSFORMS, ours)[:cut])


def test_the_hash_of_a_type_is_that_of_ros():
    # as `ros2 topic info --verbose` prints it
    assert messages_of("jazzy").store.hash_rihs01("std_msgs/msg/String") == (
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )
