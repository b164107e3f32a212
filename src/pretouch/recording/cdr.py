"""Messages as bytes and back: ROS 2's Common Data Representation (OMG, XCDR1), little-endian.

Every number begins at a multiple of its own size, counted from behind the four bytes of the encapsulation header.
Strings and rows of any length begin with how many follow, as uint32; a string ends with a zero byte.
"""

import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import make_dataclass
from enum import Enum
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_HEADER = b"\0\1\0\0"
"""Encapsulation header of little-endian CDR."""
_NUMPY = {"bool": "?", "byte": "u1", "float32": "<f4", "float64": "<f8"} | {
    f"{sign}int{8 * size}": f"<{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4, 8)
}
_STRUCT = {"bool": "?", "byte": "B", "float32": "<f", "float64": "<d"} | {
    f"{sign}int{8 * size}": f"<{code.upper() if sign else code}"
    for sign in ("", "u")
    for size, code in ((1, "b"), (2, "h"), (4, "i"), (8, "q"))
}
_COUNT = struct.Struct("<I")
_count: Callable[[Any, int], tuple[Any, ...]] = _COUNT.unpack_from
_FIELD = re.compile(r"([\w/]+)(\[(\d*)\])? +(\w+)")
_SHAPE = re.compile(r" *\(\w+((?:, \d+)+)\)")
"""Begins the comment on an array that is kept row by row: (K, 3)."""

Append = Callable[[Any], None]
"""Takes the next bytes, or an array."""
Writer = Callable[[Append, int, Any], int]
"""Appends a value at a place of the bytes; returns the place behind it."""
Values = Callable[[Any, dict[str, Any]], list[Any]]
"""Takes the values of all fields of a message, in order; some are given by name."""
Reader = Callable[[NDArray[np.uint8], int], tuple[Any, int]]
"""Reads a value at a place of the bytes; returns it, and the place behind it."""


class DecodeError(ValueError):
    """Bytes hold no message of a type."""


class Field(NamedTuple):
    """One field of a message."""

    name: str
    kind: str
    """A number, `string`, or the type of a message, as `std_msgs/msg/Header`."""
    length: int | None
    """How many; None for one, 0 for a row of any length."""
    shape: tuple[int, ...] = ()
    """Of each row of an array with more than one dimension: in a message such an array lies row by row."""


def parsed(definition: str, package: str) -> tuple[Field, ...]:
    """Return the fields that a message definition of a package lists. Constants are no fields."""
    found = []
    for line in definition.splitlines():
        text, _, comment = line.partition("#")
        given = _FIELD.fullmatch(text.strip())
        if given is None:
            continue
        kind, row, length, name = given.groups()
        if kind not in _NUMPY and kind != "string":
            kind = f"{kind.rpartition('/')[0] or package}/msg/{kind.rpartition('/')[2]}"
        shape = _SHAPE.match(comment) if row else None
        sizes = tuple(int(size) for size in shape[1].split(",")[1:]) if shape else ()
        found.append(Field(name, kind, int(length or 0) if row else None, sizes))
    return tuple(found)


class Codec:
    """Encodes and decodes messages of the types that a source of definitions knows.

    A message is whatever has its fields as attributes. Where one is None, what is written is empty or zero; a field
    `has_x` says whether x is there, for objects without such an attribute of their own.
    """

    def __init__(self, fields: Callable[[str], tuple[Field, ...]]) -> None:
        """Take what returns the fields of a type, as `std_msgs/msg/Header`."""
        self.fields = fields
        self.type = cache(self._type)
        """Class of a type's messages: a dataclass with its fields in order."""
        self._writer, self._reader = cache(self._make_writer), cache(self._make_reader)
        self._writers = cache(lambda kind: [self._writer_of(field) for field in fields(kind)])
        self._values = cache(self._make_values)

    def prepare(self, kind: str) -> None:
        """Make ready to encode a type: it takes some milliseconds, once."""
        self._writer(kind)

    def encoded(self, kind: str, message: Any, **given: Any) -> bytes:
        """Return a message as CDR, some fields `given` in place of its own.

        Raises ValueError for a value that does not fit its field.
        """
        out: list[Any] = [_HEADER]
        try:
            at, values = 0, self._values(kind, tuple(given))(message, given)
            for write, value in zip(self._writers(kind), values, strict=True):
                at = write(out.append, at, value)
            return _joined(out)
        except (struct.error, BufferError, TypeError) as error:
            raise ValueError(f"no {kind}: {error}") from error

    def decoded(self, kind: str, data: bytes) -> Any:
        """Return the message that CDR bytes hold; its arrays are aligned and writable. Raises DecodeError."""
        if data[:2] != _HEADER[:2]:
            raise DecodeError("its header is not little-endian CDR")
        try:
            body = np.frombuffer(data, np.uint8, offset=len(_HEADER)).copy()
            message, end = self._reader(kind)(body, 0)
        except (struct.error, ValueError) as error:
            raise DecodeError(str(error)) from error
        if end + 3 < len(body):  # up to three bytes fill it up to a multiple of four
            raise DecodeError(f"{len(body) - end} bytes are left over")
        return message

    def _type(self, kind: str) -> type[Any]:
        names = [field.name for field in self.fields(kind)]
        return make_dataclass(kind.rpartition("/")[2], names, slots=True)

    def _make_writer(self, kind: str) -> Writer:
        """Return what writes the fields of a message one after the other."""
        writers, values_of = self._writers(kind), self._values(kind, ())
        blank = {"string": ""} | dict.fromkeys(_STRUCT, 0)
        nothing = self.type(kind)(*(None if f.length is not None else blank.get(f.kind) for f in self.fields(kind)))

        def write(append: Append, at: int, message: Any) -> int:
            for each, value in zip(writers, values_of(nothing if message is None else message, {}), strict=True):
                at = each(append, at, value)
            return at

        return write

    def _make_values(self, kind: str, given: tuple[str, ...]) -> Values:
        """Return what takes the values of a message's fields in order, those of some names from a table."""
        names = [field.name for field in self.fields(kind)]
        own = [name for name in names if name not in given]
        getters = [_flag(name) if name.startswith("has_") else attrgetter(name) for name in own]
        order = [[*own, *given].index(name) for name in names]

        def values(message: Any, table: dict[str, Any]) -> list[Any]:
            found = [*[get(message) for get in getters], *table.values()]
            return [found[i] for i in order] if table else found

        return values

    def _writer_of(self, field: Field) -> Writer:
        if field.length is not None and field.kind in _NUMPY:
            return _array_writer(np.dtype(_NUMPY[field.kind]), field.length)
        one = _one_writer(field.kind) or self._writer(field.kind)
        return one if field.length is None else _row_writer(one, field.length)

    def _make_reader(self, kind: str) -> Reader:
        """Return what reads a message field by field."""
        made, readers = self.type(kind), [self._reader_of(field) for field in self.fields(kind)]

        def read(data: NDArray[np.uint8], at: int) -> tuple[Any, int]:
            values = []
            for each in readers:
                value, at = each(data, at)
                values.append(value)
            return made(*values), at

        return read

    def _reader_of(self, field: Field) -> Reader:
        if field.length is not None and field.kind in _NUMPY:
            return _array_reader(np.dtype(_NUMPY[field.kind]), field.length)
        one = _one_reader(field.kind) or self._reader(field.kind)
        return one if field.length is None else _row_reader(one, field.length)

    def parts(self, kind: str) -> Iterator[str]:
        """Yield the types of messages in messages of a type, each once, in the order of their first field."""
        seen = {kind}

        def within(outer: str) -> Iterator[str]:
            for field in self.fields(outer):
                if "/" in field.kind and field.kind not in seen:
                    seen.add(field.kind)
                    yield field.kind
                    yield from within(field.kind)

        yield from within(kind)


def _flag(name: str) -> Callable[[Any], Any]:
    """Return what tells the field `has_x` of a message; of an object without it, whether x is there."""
    part = attrgetter(name.removeprefix("has_"))
    return lambda message: getattr(message, name, part(message) is not None)


def _joined(parts: list[Any]) -> bytes:
    try:
        return b"".join(parts)
    except BufferError:  # an array that is part of another one
        return b"".join([p.tobytes() if isinstance(p, np.ndarray) else p for p in parts])


def _aligned(form: str) -> list[struct.Struct]:
    """Return one number's form with the padding before it, by the place of the bytes modulo 8."""
    size = struct.calcsize(form)
    return [struct.Struct(f"<{-at % size}x{form[-1]}") for at in range(8)]


_COUNTS = [(form.pack, form.size) for form in _aligned("<I")]


def _one_writer(kind: str) -> Writer | None:
    """Return what writes one number or string; None for other types."""
    if kind == "string":

        def write_text(append: Append, at: int, text: str | Enum) -> int:
            given = text.value if isinstance(text, Enum) else text
            raw = given.encode("utf-8", "backslashreplace") + b"\0"
            count, ahead = _COUNTS[at & 7]
            append(count(len(raw)))
            append(raw)
            return at + ahead + len(raw)

        return write_text
    if kind not in _STRUCT:
        return None
    forms = [(form.pack, form.size) for form in _aligned(_STRUCT[kind])]

    def write(append: Append, at: int, value: Any) -> int:
        pack, size = forms[at & 7]
        append(pack(value))
        return at + size

    return write


def _one_reader(kind: str) -> Reader | None:
    """Return what reads one number or string; None for other types."""
    if kind == "string":

        def read_text(data: NDArray[np.uint8], at: int) -> tuple[str, int]:
            at += -at & 3
            (length,) = _count(data, at)
            end = at + 4 + length
            if not length or end > len(data):
                raise DecodeError("a text in it is cut off")
            return data[at + 4 : end - 1].tobytes().decode(), end

        return read_text
    if kind not in _STRUCT:
        return None
    form = struct.Struct(_STRUCT[kind])
    unpack: Callable[[Any, int], tuple[Any, ...]] = form.unpack_from
    size, odd = form.size, form.size - 1

    def read(data: NDArray[np.uint8], at: int) -> tuple[Any, int]:
        at += -at & odd
        return unpack(data, at)[0], at + size

    return read


def _array_writer(dtype: np.dtype[Any], length: int) -> Writer:
    """Return what writes a row of numbers, of a fixed length or of any (0)."""
    size = dtype.itemsize
    paddings = [bytes(-at % size) for at in range(8)]
    blank = np.zeros(length, dtype)

    def write(append: Append, at: int, array: NDArray[Any] | None) -> int:
        if array is None:
            array = blank
        if array.dtype != dtype:
            raise ValueError(f"a row is of {array.dtype}, not {dtype}")
        number = array.size
        if not length:
            count, ahead = _COUNTS[at & 7]
            append(count(number))
            at += ahead
        elif number != length:
            raise ValueError(f"a row has {number} values, not {length}")
        if number:
            padding = paddings[at & 7]
            append(padding)
            append(array)
            at += len(padding) + size * number
        return at

    return write


def _array_reader(dtype: np.dtype[Any], length: int) -> Reader:
    """Return what reads a row of numbers."""
    size, odd = dtype.itemsize, dtype.itemsize - 1

    def read(data: NDArray[np.uint8], at: int) -> tuple[NDArray[Any], int]:
        count = length
        if not length:
            at += -at & 3
            (count,) = _count(data, at)
            at += 4
        if count:
            at += -at & odd
        end = at + count * size
        if end > len(data):
            raise DecodeError("a row in it is cut off")
        return data[at:end].view(dtype), end

    return read


def _row_writer(one: Writer, length: int) -> Writer:
    """Return what writes a row of texts or messages."""

    def write(append: Append, at: int, values: Any) -> int:
        if not length:
            count, ahead = _COUNTS[at & 7]
            append(count(len(values)))
            at += ahead
        elif len(values) != length:
            raise ValueError(f"a row has {len(values)} values, not {length}")
        for value in values:
            at = one(append, at, value)
        return at

    return write


def _row_reader(one: Reader, length: int) -> Reader:
    """Return what reads a row of texts or messages."""

    def read(data: NDArray[np.uint8], at: int) -> tuple[list[Any], int]:
        count = length
        if not length:
            at += -at & 3
            (count,) = _count(data, at)
            at += 4
        found = []
        for _ in range(count):
            value, at = one(data, at)
            found.append(value)
        return found, at

    return read
