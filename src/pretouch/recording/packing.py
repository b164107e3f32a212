"""Values of ours as MessagePack with the names of their fields, and back to the bit, by their annotations.

A row of float64 is its bytes, little-endian; any other array is [dtype, shape, bytes]. What a part of the profile
remembers is annotated with `object`: it is {"part": group and name of the part, "value": ...}.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

import msgspec
import numpy as np

from pretouch.composition import Part
from pretouch.errors import PretouchError, RecordingError
from pretouch.recording.fields import hints_of, is_record, optional
from pretouch.records import BLOCK_TYPES, Flat

Value = TypeVar("Value")

_FLOAT = np.dtype(np.float64)
_BLOCKS: tuple[Any, ...] = (*BLOCK_TYPES, np.int64)
_NUMBERS = (bool, int, float, str)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype == _FLOAT and value.ndim == 1:
            return value.tobytes()
        if value.dtype.kind in "biuf":
            return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, Flat):
        return [block.tobytes() for block in value.blocks]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"a {type(value).__name__} cannot be kept")


def _array(hint: Any, plain: Any) -> Any:
    """Return what `_plain` made of an array or a record; numbers in a list come as an array too."""
    if hint is Flat:
        f, i, b, table = (np.frombuffer(bytearray(data), kind) for data, kind in zip(plain, _BLOCKS, strict=True))
        return Flat((f, i, b, table))
    if np.ndarray not in (hint, get_origin(hint)):
        raise TypeError(f"there is no {hint} in a recording")
    if isinstance(plain, bytes):
        return np.frombuffer(bytearray(plain), _FLOAT) if plain else np.zeros(0)
    if isinstance(plain, list) and len(plain) == 3 and isinstance(plain[2], bytes):
        dtype, shape, data = plain
        return np.frombuffer(bytearray(data), dtype).reshape(shape) if data else np.zeros(shape, dtype)
    array = np.asarray(plain)
    if array.dtype.kind not in "biuf":
        raise ValueError("numbers are none")
    return array


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_plain)


def packed(value: Any) -> bytes:
    """Return a value as MessagePack; a TypeError or OverflowError for what cannot be kept."""
    return _ENCODER.encode(value)


def unpacked(kind: type[Value], data: bytes) -> Value:
    """Return the value of a class that MessagePack holds; RecordingError if it holds none."""
    try:
        return _decoder(kind).decode(data)  # type: ignore[arg-type]
    except (msgspec.MsgspecError, ValueError, TypeError, RecursionError) as error:
        raise RecordingError(_unreadable(kind, error)) from error


def prepare(kind: type, state: type) -> None:
    """Make ready to unpack a class, and to pack one with parts: the first time takes some milliseconds."""
    _decoder(kind)
    _holds_parts(state)


@cache
def _decoder(kind: Any) -> Any:
    return msgspec.msgpack.Decoder(kind, dec_hook=_array)


def _unreadable(kind: Any, error: Exception) -> str:
    name = getattr(kind, "__name__", "value").strip("_")
    return (
        f"{name} in the recording cannot be read ({' '.join(str(error).split())}): it is damaged, or from another"
        " version: open it with the version that made it."
    )


def marked(hint: Any, value: Any) -> Any:
    """Return a value to pack, with the name of its part beside what is annotated with `object`."""
    if hint is object:
        if value is None or isinstance(value, _NUMBERS):
            return value
        if isinstance(value, np.ndarray):
            return {"part": "", "value": (value.dtype.str, value.shape, value.tobytes())}
        if not is_record(type(value)):
            raise RecordingError(
                f"A part of the profile remembers a {type(value).__name__}, which a recording cannot hold: let it"
                " remember a number, an array of numbers, or a class of such fields, named as `State` of the part."
            )
        return {"part": _owner(type(value)), "value": marked(type(value), value)}
    kind = optional(hint) or hint
    if value is None or not _holds_parts(kind):
        return value
    if get_origin(kind) is tuple:
        return [marked(inner, item) for inner, item in zip(_items(kind, len(value)), value, strict=True)]
    return {name: marked(inner, getattr(value, name)) for name, inner in hints_of(kind)}


def unmarked(hint: Any, plain: Any) -> Any:
    """Return the value of which `marked`, packed and decoded without a type, made plain values.

    RecordingError for what is none.
    """
    try:
        return _unmarked(hint, plain)
    except (msgspec.MsgspecError, ValueError, TypeError, LookupError, AttributeError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(_unreadable(hint, error)) from error


def _unmarked(hint: Any, plain: Any) -> Any:
    if hint is object:
        if not isinstance(plain, dict):
            return plain
        kind = _state_of(plain["part"]) if plain["part"] else np.ndarray
        return _unmarked(kind, plain["value"])
    kind = optional(hint) or hint
    if plain is None or not _holds_parts(kind):
        return msgspec.convert(plain, hint, dec_hook=_array)
    if get_origin(kind) is tuple:
        return tuple(_unmarked(inner, item) for inner, item in zip(_items(kind, len(plain)), plain, strict=True))
    return kind(**{name: _unmarked(inner, plain[name]) for name, inner in hints_of(kind)})


@cache
def _holds_parts(hint: Any) -> bool:
    """Whether something in a type is annotated with `object`."""
    kind = optional(hint) or hint
    if get_origin(kind) is tuple:
        return any(_holds_parts(inner) for inner in get_args(kind))
    return kind is object or (is_record(kind) and any(_holds_parts(inner) for _, inner in hints_of(kind)))


def _items(hint: Any, count: int) -> Iterator[Any]:
    """Types of the items of a tuple."""
    args = get_args(hint)
    return iter(args[:1] * count if args[-1] is Ellipsis else args)


def _owner(state: type) -> str:
    """Name the part whose state a class is: its group and its name."""
    for group, interface in Part.interfaces.items():
        for name, part in interface.known.items():
            if part.State is state:
                return f"{group} {name}"
    raise RecordingError(
        f"No named part of a profile has {state.__name__} as its `State`: name the class there, and give the part a"
        ' name, as class MyDetector(Detector, name="mine").'
    )


def _state_of(owner: str) -> type:
    """Return the class of the state of a part."""
    group, _, name = owner.partition(" ")
    try:
        return Part.interfaces[group].called(name).State
    except (KeyError, PretouchError) as error:
        raise RecordingError(f"The part {owner} of the recorded profile is not installed: {error}") from error
