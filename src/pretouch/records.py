"""Records: quantities that are defined once, for Python, for compiled code and for recordings.

A record is a `NamedTuple`. Its fields are numbers, arrays that are annotated with their dimensions, and other records;
or a set of parameters, of which compiled code sees the plain numbers (`Checked.Numbers`).
Its numbers lie one behind the other in three flat blocks, of float64, int64 and bool. So the same compiled code works
for all arms, skins and profiles. Compiled code opens the blocks as the named tuple; Python looks single fields up.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache, partial, reduce
from operator import attrgetter
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
from numba.core import cgutils, types
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import populate_array

from pretouch.values import BoolArray, FloatArray, IntArray

Cell = Annotated[FloatArray, 1]
"""One number of a record that compiled code writes to."""
IntCell = Annotated[IntArray, 1]
"""One whole number of a record that compiled code writes to."""
BLOCK_TYPES = (np.float64, np.int64, np.bool_)
"""Number types of a record's blocks."""
_KINDS = {FloatArray: 0, IntArray: 1, BoolArray: 2, float: 0, int: 1, bool: 2}
"""Block of a field, by its annotation."""


Blocks = tuple[FloatArray, IntArray, BoolArray, IntArray]
"""The numbers of a record, of float64, int64 and bool, and where each field starts, and its shape."""


class FieldPlace(NamedTuple):
    """Place of a field in the blocks of a record."""

    kind: int
    """Index of its block."""
    at: slice
    shape: tuple[int, ...]
    """() of a number that compiled code only reads."""
    single: bool
    """True of a field that is one number, whatever the sizes of the record."""


@cache
def _hints(record: type) -> dict[str, Any]:
    record = getattr(record, "Numbers", record)
    has_fields = hasattr(record, "_fields") or is_dataclass(record)
    return get_type_hints(record, include_extras=True) if has_fields else {}


@cache
def _fields_at(path: str, record: type) -> list[tuple[str, str, type | None]]:
    """Return name, path and class (None unless a record) of each field of a record at a path."""
    return [(name, f"{path}.{name}", hint if _hints(hint) else None) for name, hint in _hints(record).items()]


class _RecordNode(NamedTuple):
    """A record with its fields, or a field with its entry in the table of places."""

    kind: type
    fields: "Mapping[str, _RecordNode]"
    block: int = 0
    entry: int = 0
    dimensions: tuple[str | int, ...] = ()


def _tree(kind: Any, entries: list[int]) -> _RecordNode:
    """Return the tree of a record or field; `entries` counts the table's numbers of the fields before."""
    if hints := _hints(kind):
        fields = {name: _tree(hint, entries) for name, hint in hints.items()}
        return _RecordNode(getattr(kind, "Numbers", kind), fields)
    array, *dimensions = get_args(kind) if get_origin(kind) is Annotated else (kind,)
    entry = entries[0]
    entries[0] += 1 + len(dimensions)
    return _RecordNode(array, {}, _KINDS[array], entry, tuple(dimensions))


def _leaves(part: _RecordNode, path: str = "") -> Iterator[tuple[str, _RecordNode]]:
    """Yield the fields of a record and of those in it, with their paths."""
    for name, inner in part.fields.items():
        if inner.fields:
            yield from _leaves(inner, f"{path}{name}.")
        else:
            yield path + name, inner


class Flat:
    """A record in flat blocks, whose fields are looked up by their path."""

    __slots__ = ("blocks", "places")

    def __init__(self, blocks: Blocks, places: Mapping[str, FieldPlace] | None = None) -> None:
        """Take the blocks, and the places of their fields, which a recording does not store."""
        self.blocks, self.places = blocks, places or {}

    @classmethod
    def of(cls, record: Any) -> "Flat":
        """Lay out a record; a dimension has one size in all fields of a record, otherwise this is a ValueError."""
        places, sizes, table, extents = dict[str, FieldPlace](), [0, 0, 0], list[int](), dict[tuple[str, str], int]()
        for path, (_, _, kind, _, dimensions) in _leaves(_tree(type(record), [0])):
            shape, owner = np.shape(attrgetter(path)(record)), path.rpartition(".")[0]
            named = zip(dimensions, shape, strict=False)
            sized = tuple(extents.setdefault((owner, d), s) if isinstance(d, str) else d for d, s in named)
            if sized != shape or len(dimensions) != len(shape):
                raise ValueError(f"{path} has the shape {shape}, where {dimensions} are {sized}")
            start = sizes[kind]
            sizes[kind] += int(np.prod(shape, dtype=int))
            places[path] = FieldPlace(kind, slice(start, sizes[kind]), shape, dimensions in ((), (1,)))
            table += [start, *shape]
        blocks: Any = (*map(np.empty, sizes, BLOCK_TYPES), np.array(table, np.int64))
        flat = cls(blocks, places)
        for path in places:
            flat.put(path, attrgetter(path)(record))
        return flat

    def copy(self) -> "Flat":
        """Return a copy whose numbers may be written to; booleans are shared."""
        f, i, b, table = self.blocks
        return Flat((f.copy(), i.copy(), b, table), self.places)

    def get(self, path: str) -> Any:
        """Return a field: an array as a view, a single number as such."""
        kind, at, shape, single = self.places[path]
        row = self.blocks[kind]
        return row.item(at.start) if single else row[at].reshape(shape)

    def put(self, path: str, value: Any) -> None:
        """Write a field."""
        kind, at, shape, _ = self.places[path]
        self.blocks[kind][at] = value if len(shape) < 2 else np.ravel(value)

    def part(self, path: str, record: type) -> Any:
        """Return a record in the record, its arrays as views, single numbers too."""
        fields = _fields_at(path, record)
        return record(*[self.part(inner, kind) if kind else self._row(inner) for _, inner, kind in fields])

    def fill(self, path: str, value: Any) -> None:
        """Write a record in the record."""
        for name, inner, kind in _fields_at(path, value.__class__):
            (self.fill if kind else self.put)(inner, getattr(value, name))

    def take(self, other: "Flat", names: Sequence[str]) -> None:
        """Take fields, or records with all of theirs, from another record of the same class, as far as shapes agree."""
        for path, place in self.places.items():
            if path.split(".")[0] in names and other.places[path].shape == place.shape:
                self.put(path, other.get(path))

    def _row(self, path: str) -> Any:
        kind, at, shape, _ = self.places[path]
        return self.blocks[kind][at].reshape(shape)


def zeros(record: Any, **sizes: int) -> Any:
    """Return a record of zeros, with these sizes of its dimensions."""
    return _maker(record, **sizes)()


@cache
def _maker(record: Any, **sizes: int) -> Callable[[], Any]:
    """Return a function that makes a record of zeros: a step has no time to work out the shapes."""
    if hints := _hints(record):
        makers = [_maker(hint, **sizes) for hint in hints.values()]
        return lambda: record(*[make() for make in makers])
    array, *dimensions = get_args(record)
    shape = tuple(sum(sizes[name] for name in d.split(" + ")) if isinstance(d, str) else d for d in dimensions)
    return partial(np.zeros, shape, BLOCK_TYPES[_KINDS[array]])


def opener(record: type, *paths: str) -> Callable[[Blocks], Any]:
    """Return a function, for Python and for compiled code, that makes views of some fields of a record from its blocks.

    It returns a tuple of them. A field that is not opened costs nothing: open no more than a function needs. A compiled
    view does not keep its block alive: it must not outlive the call that has the block as an argument.
    """
    whole = _tree(record, [0])
    parts = [reduce(lambda part, name: part.fields[name], path.split("."), whole) for path in paths]

    def open_parts(blocks: Blocks) -> Any:
        return tuple(_view(part, blocks) for part in parts)

    def type_parts(blocks: Any) -> Any:
        return types.BaseTuple.from_types([_type_of(part, blocks) for part in parts])

    type_callable(open_parts)(lambda context: type_parts)
    lower_builtin(open_parts, types.BaseTuple)(partial(_write_views, parts))
    return open_parts


def _view(part: _RecordNode, blocks: Blocks) -> Any:
    if part.fields:
        return part.kind(*(_view(field, blocks) for field in part.fields.values()))
    start, *shape = blocks[3][part.entry : part.entry + 1 + len(part.dimensions)]
    row = blocks[part.block][start : start + int(np.prod(shape, dtype=int))]
    return row.reshape(shape) if shape else row[0]


def _type_of(part: _RecordNode, blocks: Any) -> Any:
    """Return Numba's type of a field or a record."""
    if part.fields:
        return types.BaseTuple.from_types([_type_of(field, blocks) for field in part.fields.values()], part.kind)
    block = blocks[part.block]
    return block.copy(ndim=len(part.dimensions)) if part.dimensions else block.dtype


def _write_views(parts: Sequence[_RecordNode], context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Generate the machine code of views: each needs its start and its sizes, and counts no references."""
    blocks = [
        context.make_array(kind)(context, builder, value)
        for kind, value in zip(signature.args[0], cgutils.unpack_tuple(builder, arguments[0]), strict=True)
    ]

    def at(entry: int) -> Any:
        return builder.load(cgutils.gep_inbounds(builder, blocks[3].data, entry))

    def write(part: _RecordNode, kind: Any) -> Any:
        if part.fields:
            fields = map(write, part.fields.values(), kind.types)
            return context.make_tuple(builder, kind, list(fields))
        data = cgutils.gep_inbounds(builder, blocks[part.block].data, at(part.entry))
        if not part.dimensions:
            return context.unpack_value(builder, kind, data)
        view, size = context.make_array(kind)(context, builder), blocks[part.block].itemsize
        shape = [at(part.entry + 1 + d) for d in range(len(part.dimensions))]
        strides = [size]
        for length in shape[:0:-1]:
            strides.insert(0, builder.mul(length, strides[0]))
        populate_array(view, data, shape, strides, size, None)
        return view._getvalue()

    return context.make_tuple(builder, signature.return_type, list(map(write, parts, signature.return_type.types)))
