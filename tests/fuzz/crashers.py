"""What once ended a program, kept it busy, or took its memory: each begins the fuzz of whoever reads it."""

import struct

import lz4.frame
import msgspec
import zstandard

from tests.importing.made import six_axis


def chunk_of(packed: bytes, size: int, compression: bytes = b"zstd", more: int = 0) -> bytes:
    """A chunk's record that says it holds `size` bytes, and that it has `more` packed ones than are there."""
    text = struct.pack("<I", len(compression)) + compression + struct.pack("<Q", len(packed) + more) + packed
    body = struct.pack("<QQQI", 0, 0, size, 0) + text
    return struct.pack("<BQ", 0x06, len(body) + more) + body


def _mjcf(inner: str, beside: str = "") -> bytes:
    """An arm of one joint with more in it."""
    joint, capsule = '<joint name="j" range="-1 1" limited="true"/>', '<geom type="capsule" size=".1 .1" mass="1"/>'
    body = f'<body name="tip">{joint}{capsule}{inner}</body>'
    return f"<mujoco><worldbody>{body}</worldbody>{beside}</mujoco>".encode()


_MAGIC = b"\x89MCAP0\r\n"
_EMPTY = bytes(100_000_000)
_REPLICATE = '<replicate count="999">' * 4 + '<geom size="1"/>' + "</replicate>" * 4
MCAP = [
    _MAGIC + chunk_of(zstandard.compress(_EMPTY), 100),
    _MAGIC + chunk_of(zstandard.compress(_EMPTY), len(_EMPTY)),
    _MAGIC + chunk_of(lz4.frame.compress(_EMPTY[: 1 << 24]), 10, b"lz4"),
    _MAGIC + chunk_of(b"", 10, more=10_000_000) * 2000,
    _MAGIC + b"\0\1" * 50_000,
]
MJCF = [
    _mjcf(_REPLICATE),
    _mjcf('<flexcomp name="f" type="grid" count="99 99 99"/>'),
    _mjcf("", '<size nkey="900000000"/>'),
    _mjcf("", '<include file="/etc/passwd"/>'),
    _mjcf('<geom type="capsule" size=".1 .1" mass="1"/>' * 1900),
]
_LINKS = "".join(f'<link name="l{k}"/><joint name="j{k}"><parent link="l{k}"/></joint>' for k in range(2000))
URDF = [
    b'<?xml version="1.0"?><!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>',
    f'<robot name="r">{_LINKS}</robot>'.encode(),
    six_axis(tail="<link name='a'>" * 900 + "</link>" * 900).encode(),
]
TOML = [
    b"a = " + b"[" * 50_000,
    b'a = """' * 5000,
    b'[[unit]]\nid = "u"\nlink = "panda_link5"\n' * 3000,
]
PAGE = [
    msgspec.msgpack.encode(message)
    for message in (
        {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": float("nan")}},
        {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"removed": True}},
        {"type": "ShareUrlRequest"},
        {"type": ["a"]},
    )
] + [b"\x91" * 3000]
ANSWERS = [
    b"[" * 100_000,
    b'[{"key": "abc", "metrics": {}, "seconds": 1}]',
    b'[{"key": ["abc"], "seconds": NaN}]',
    b"\x80\x04\x95cos\nsystem\n",
]
