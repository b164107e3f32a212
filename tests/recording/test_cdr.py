"""Our own CDR against rosbags, over messages of all our types and of the standard ones that recordings have."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from rosbags.interfaces import Nodetype

from pretouch.errors import RecordingError
from pretouch.recording.messages import OWN, PACKAGE, decoded, definition, encoded, make, prepare
from pretouch.recording.scene import DRAWN
from pretouch.recording.skin_recording import DIAGNOSTICS
from pretouch.recording.standard import STANDARD
from tests.recording.oracle import typestore

KINDS = [*(f"{PACKAGE}/msg/{name}" for name in OWN), *STANDARD, *DRAWN, DIAGNOSTICS]
TEXT = st.text(st.characters(blacklist_categories=["Cs"], blacklist_characters="\0"), max_size=9)


def number(name: str) -> st.SearchStrategy[Any]:
    if name == "bool":
        return st.booleans()
    if name.startswith("float"):
        return st.floats(width=int(name[5:]))
    if name == "byte":  # unsigned in ROS, signed in rosbags
        return st.integers(0, 127)
    bits = int(name.removeprefix("u").removeprefix("int"))
    signed = name.startswith("int")
    return st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else st.integers(0, 2**bits - 1)


def value(node: Nodetype, of: Any) -> st.SearchStrategy[Any]:
    """Values of a field as rosbags describes it, made of our own classes."""
    if node == Nodetype.BASE:
        return TEXT if of[0] == "string" else number(of[0])
    if node == Nodetype.NAME:
        return messages(of)
    (inner, name), length = of
    count = length if node == Nodetype.ARRAY else None
    if inner == Nodetype.BASE and name[0] != "string":
        return npst.arrays(name[0], count if count else st.integers(0, 4))
    most = count if count else 3
    return st.lists(value(inner, name), min_size=count or 0, max_size=most)


def messages(kind: str) -> st.SearchStrategy[Any]:
    fields = [value(*described) for _, described in typestore().fielddefs[kind][1]]
    return st.tuples(*fields).map(lambda given: make(kind, *given))


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=10)
@given(data=st.data())
def test_bytes_are_those_of_rosbags_and_come_back(kind: str, data: st.DataObject):
    message = data.draw(messages(kind))
    ours = encoded(kind, message)
    assert ours == bytes(typestore().serialize_cdr(message, kind, little_endian=True))
    assert encoded(kind, decoded(kind, ours)) == ours
    assert encoded(kind, decoded(kind, ours + bytes(3))) == ours, "filled up to a multiple of four"


@pytest.mark.parametrize("kind", [*STANDARD, *DRAWN, DIAGNOSTICS])
def test_definitions_are_those_of_ros(kind: str):
    assert definition(kind) == typestore().generate_msgdef(kind, ros_version=2)[0]


def test_types_are_prepared():
    prepare(KINDS)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda data: b"", "header"),
        (lambda data: b"\0\0" + data[2:], "header is not little-endian"),
        (lambda data: data[:4], "requires a buffer"),
        (lambda data: data[:-1], "a row in it is cut off"),
        (lambda data: data + bytes(4), "4 bytes are left over"),
    ],
)
def test_bytes_that_are_no_message(spoil, said):
    kind = f"{PACKAGE}/msg/RangeReadings"
    data = encoded(kind, make(kind, np.ones(2), np.ones(2), np.ones(2, np.int64)))
    with pytest.raises(RecordingError, match=said):
        decoded(kind, spoil(data))


@pytest.mark.parametrize("text", [b"\0\0\0\0", b"\xff\0\0\0a\0", b"\2\0\0\0\xff\0"])
def test_texts_that_are_none(text):
    with pytest.raises(RecordingError, match=r"cut off|decode"):
        decoded("std_msgs/msg/Header", b"\0\1\0\0" + bytes(8) + text)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("RangeReadings", (np.ones(2), np.ones(2), np.ones(2))),
        ("RangeReadings", (np.ones(2), np.ones(4)[::2], np.ones(2, np.int64))),
        ("Contact", (np.ones(4), np.ones(3, np.bool_))),
    ],
)
def test_values_that_do_not_fit_are_no_message(kind, values):
    kind = f"{PACKAGE}/msg/{kind}"
    with pytest.raises(ValueError, match=r"no |row|bytes-like"):
        encoded(kind, make(kind, *values))
