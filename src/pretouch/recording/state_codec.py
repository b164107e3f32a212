"""All the controller remembers, to a message and back, to the bit.

Both ways follow the annotations of `ControllerState`, so a field added there is kept without a change here. What a part
of the profile remembers is annotated with `object`, and kept with the name of the part whose `State` it is.
"""

from collections.abc import Iterator
from dataclasses import is_dataclass
from enum import Enum
from typing import Any, get_args, get_origin

import numpy as np

from pretouch.composition import Part
from pretouch.controller import ControllerState
from pretouch.errors import PretouchError, RecordingError
from pretouch.recording.codec import hints_of, optional
from pretouch.recording.messages import PACKAGE, decoded, encoded, make
from pretouch.types import IntArray

STATE = f"{PACKAGE}/msg/State"

_UNREAD = "watch.robot.tau_ext"
"""Made an array of numbers by each step; what a caller puts there may be anything, and is kept only if it is one."""


def _is_made_of_fields(hint: Any) -> bool:
    """Whether a type is a dataclass or a named tuple."""
    return is_dataclass(hint) or hasattr(hint, "_fields")


class _Parts:
    """The lists of a State message while it is being made."""

    def __init__(self) -> None:
        self.name: list[str] = []
        self.kind: list[str] = []
        self.shape: list[str] = []
        self.numbers: list[Any] = []
        self.wholes: list[int] = []
        self.texts: list[str | Enum] = []

    def add(self, name: str, kind: str, shape: str = "") -> None:
        self.name.append(name)
        self.kind.append(kind)
        self.shape.append(shape)


def encode_state(sequence: int, state: ControllerState, anew: bool) -> bytes:
    """Return the state a step begins with as CDR; `anew` if it does not follow from the step before."""
    parts = _Parts()
    _take(parts, "", ControllerState, state)
    numbers = np.concatenate(parts.numbers) if parts.numbers else np.zeros(0)
    wholes = np.array(parts.wholes, dtype=np.int64)
    p = parts
    return encoded(STATE, make(STATE, sequence, anew, p.name, p.kind, p.shape, numbers, wholes, p.texts))


def _take(parts: _Parts, name: str, hint: Any, value: Any) -> None:
    """Add a value annotated with a type to a message."""
    if name == _UNREAD:
        value = _readable(value)
    hint, kind = _kind(hint, value)
    if kind == "state":
        parts.add(name, kind, _owner(hint))
    if kind in ("parts", "state"):
        for field, inner in hints_of(hint):
            _take(parts, f"{name}.{field}" if name else field, inner, getattr(value, field))
    elif kind == "tuple":
        parts.add(name, kind, str(len(value)))
        for i, (inner, item) in enumerate(zip(_inner(hint, len(value)), value, strict=True)):
            _take(parts, f"{name}.{i}", inner, item)
    elif kind == "array":
        parts.add(name, kind, " ".join(map(str, value.shape)))
        parts.numbers.append(value.reshape(-1))
    else:
        parts.add(name, kind)
        if kind == "float":
            parts.numbers.append(np.array([value], dtype=np.float64))
        elif kind in ("int", "bool"):
            parts.wholes.append(int(value))
        elif kind == "text":
            parts.texts.append(value)


def _readable(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return value
    return np.zeros(0)


def _kind(hint: Any, value: Any) -> tuple[Any, str]:
    """Return the type a value is annotated with, without None, and how it is kept."""
    if hint is object:
        if value is None or _is_made_of_fields(type(value)):
            return type(value), "none" if value is None else "state"
        hint = np.ndarray if isinstance(value, np.ndarray) else type(value)
    if (left := optional(hint)) is not None:
        if value is None:
            return hint, "none"
        hint = left
    if _is_made_of_fields(hint):
        return hint, "parts"
    if get_origin(hint) is tuple:
        return hint, "tuple"
    if np.ndarray in (hint, get_origin(hint)):
        return hint, "array"
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint, "text"
    if hint not in _PLAIN.values():
        raise RecordingError(
            f"A part of the profile remembers a {hint.__name__}, which a recording cannot hold: let it remember a"
            " number, an array of numbers, or a class of such fields, named as `State` of the part."
        )
    return hint, next(kind for kind, plain in _PLAIN.items() if plain is hint)


_PLAIN: dict[str, Any] = {"float": float, "int": int, "bool": bool, "text": str}


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


def _inner(hint: Any, count: int) -> Iterator[Any]:
    """Types of the items of a tuple."""
    args = get_args(hint)
    return iter(args[:1] * count if args[-1] is Ellipsis else args)


class _Reading:
    """The parts of a State message, to be taken in turn."""

    def __init__(self, message: Any) -> None:
        self._parts = list(zip(message.name, message.kind, message.shape, strict=True))
        self._at = 0
        self._numbers, self._used = message.numbers, 0
        self._wholes = iter(message.wholes.tolist())
        self._texts = iter(message.texts)

    def none(self, name: str) -> bool:
        """Whether nothing was kept under a name: then it is taken."""
        found = self._at < len(self._parts) and self._parts[self._at][:2] == (name, "none")
        self._at += int(found)
        return found

    def of_part(self, name: str) -> Any:
        """Return the type of what a part remembered, kept under a name."""
        _, kind, shape = self._parts[self._at]
        if kind != "state":
            return _PLAIN.get(kind, np.ndarray)
        self.next(name)
        return _state_of(shape)

    def next(self, name: str) -> tuple[str, str]:
        if self._at == len(self._parts):
            raise ValueError(f"nothing where {name!r} belongs")
        found, kind, shape = self._parts[self._at]
        self._at += 1
        if found != name:
            raise ValueError(f"{found!r} where {name!r} belongs")
        return kind, shape

    def numbers(self, shape: tuple[int, ...]) -> Any:
        count = int(np.prod(shape))
        start, self._used = self._used, self._used + count
        return self._numbers[start : self._used].reshape(shape).copy()

    def whole(self) -> int:
        return int(next(self._wholes))

    def text(self) -> str:
        return str(next(self._texts))


def decode_state(data: bytes) -> tuple[bool, ControllerState]:
    """Return the state a step began with, and whether it did not follow from the step before.

    That of a differing version is a RecordingError.
    """
    message = decoded(STATE, data)
    try:
        return message.anew, _give(_Reading(message), "", ControllerState)
    except (ValueError, TypeError, KeyError, IndexError, StopIteration, OverflowError) as error:
        raise RecordingError(
            f"The controller's state in the recording is from another version ({error}): open it with the version that"
            " made it."
        ) from error


def _give(parts: _Reading, name: str, hint: Any) -> Any:
    """Return the next value, annotated with a type."""
    if hint is object or (left := optional(hint)) is not None:
        if parts.none(name):
            return None
        hint = parts.of_part(name) if hint is object else left
    if _is_made_of_fields(hint):
        kind = hint if isinstance(hint, type) else type(hint)
        return kind(*[_give(parts, f"{name}.{field}" if name else field, inner) for field, inner in hints_of(kind)])
    kind_name, shape = parts.next(name)
    if kind_name == "tuple":
        return tuple(_give(parts, f"{name}.{i}", inner) for i, inner in enumerate(_inner(hint, int(shape))))
    if kind_name == "array":
        numbers = parts.numbers(tuple(map(int, shape.split())))
        return numbers.astype(np.int64) if hint == IntArray else numbers
    if kind_name == "text":
        return hint(parts.text())
    if kind_name == "float":
        return float(parts.numbers((1,))[0])
    return hint(parts.whole())
