"""Values of ours as MessagePack with the names of their fields, and back to the bit, by their annotations.

A row of float64 is its bytes, little-endian; any other array is [dtype, shape, bytes]. What a part of the profile
remembers is {"part": group and name of the part, "value": ...}.
"""

from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast, get_args, get_origin

import msgspec
import numpy as np

from pretouch.composition import Part
from pretouch.errors import PretouchError, RecordingError
from pretouch.recording.ros import hints_of, is_record
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


def custom(hint: Any, plain: Any) -> Any:
    """Return a value of a type that msgspec does not know, of what it was packed as.

    Numbers in a list come as an array too. `object` is what a part remembers.
    """
    if hint is object:
        if not isinstance(plain, dict):
            return plain
        kind = _state_of(plain["part"]) if plain["part"] else np.ndarray
        return msgspec.convert(plain["value"], kind, dec_hook=custom)
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


@cache
def decoder(kind: Any) -> Any:
    """Return what decodes values of a type: the first time takes some milliseconds."""
    return msgspec.msgpack.Decoder(kind, dec_hook=custom)


def unpacked(kind: type[Value], data: bytes) -> Value:
    """Return the value of a class that MessagePack holds; RecordingError if it holds none."""
    try:
        return cast(Value, decoder(cast(Any, kind)).decode(data))
    except RecordingError:
        raise
    except (msgspec.MsgspecError, ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        raise RecordingError(
            f"{kind.__name__.strip('_')} in the recording cannot be read ({' '.join(str(error).split())}): it is"
            " damaged, or from another version: open it with the version that made it."
        ) from error


def with_parts(value: Any) -> Any:
    """Return a record to pack, with the name of its part beside what is annotated with `object`."""
    kind: Any = type(value)
    hints = hints_of(kind)
    if not any(hint is object for _, hint in hints):
        return value
    fields = {name: _named(hint, getattr(value, name)) for name, hint in hints}
    return fields if is_dataclass(value) else list(fields.values())


def _named(hint: Any, value: Any) -> Any:
    if hint is not object or value is None or isinstance(value, _NUMBERS):
        return value
    if isinstance(value, np.ndarray):
        return {"part": "", "value": value}
    kind: Any = type(value)
    buried = [name for name, own in hints_of(kind) if _buries(own)] if is_record(kind) else []
    if buried or not is_record(kind):
        within = f" with `object` within {buried[0]}" if buried else ""
        raise RecordingError(
            f"A part of the profile remembers a {kind.__name__}{within}, which a recording cannot hold: let it"
            " remember a number, an array of numbers, or a class of such fields, named as `State` of the part."
        )
    return {"part": _owner(kind), "value": with_parts(value)}


@cache
def _buries(hint: Any, above: tuple[Any, ...] = ()) -> bool:
    """Return True if a type contains `object`: no part's name can be written beside it there."""
    inner = [own for _, own in hints_of(hint)] if is_record(hint) and hint not in above else get_args(hint)
    return any(one is object or _buries(one, (*above, hint)) for one in inner)


def _owner(state: type) -> str:
    """Name the part whose state a class is: its group and its name."""
    for group, interface in Part.interfaces.items():
        for name, part in interface.registry.items():
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
