"""Records: quantities that are defined once, for Python, for compiled code and for recordings.

A record is a `NamedTuple`. Its fields are numbers, arrays that are annotated with their dimensions, and other records.
Its numbers lie one behind the other in three flat blocks, of float64, int64 and bool. So the same compiled code works
for all arms, skins and profiles. Compiled code opens the blocks as the named tuple; Python looks single fields up.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from pretouch.compiled import inlined
from pretouch.values import BoolArray, FloatArray, IntArray

Cell = Annotated[FloatArray, 1]
"""One number of a record that compiled code writes to."""
IntCell = Annotated[IntArray, 1]
"""One whole number of a record that compiled code writes to."""
BLOCK_TYPES = (np.float64, np.int64, np.bool_)
"""Of a record's numbers."""
_KINDS = {FloatArray: 0, IntArray: 1, BoolArray: 2, float: 0, int: 1, bool: 2}
"""Block of a field, by its annotation."""


Blocks = tuple[FloatArray, IntArray, BoolArray, IntArray]
"""The numbers of a record, of float64, int64 and bool, and where each field starts, ends, and its shape."""


class Place(NamedTuple):
    """Where a field lies."""

    kind: int
    """Index of its block."""
    at: slice
    shape: tuple[int, ...]
    """() of a number that compiled code only reads."""
    single: bool
    """Whether it is one number, whatever the sizes of this record are."""


def _leaves(record: type, path: str = "") -> Iterator[tuple[str, int, tuple[str | int, ...]]]:
    """Yield the fields of a record and of those in it: path, index of the block, and dimensions."""
    for name, hint in _hints(record).items():
        if hasattr(hint, "_fields"):
            yield from _leaves(hint, f"{path}{name}.")
        else:
            kind, *dimensions = get_args(hint) if get_origin(hint) is Annotated else (hint,)
            yield path + name, _KINDS[kind], tuple(dimensions)


@cache
def _hints(record: type) -> dict[str, Any]:
    return get_type_hints(record, include_extras=True)


def _at(record: Any, path: str) -> Any:
    for name in path.split("."):
        record = getattr(record, name)
    return record


class Flat:
    """A record in flat blocks, whose fields are looked up by their path."""

    __slots__ = ("blocks", "places")

    def __init__(self, blocks: Blocks, places: Mapping[str, Place] | None = None) -> None:
        """Take the blocks, and where their fields lie; a recording does not say that."""
        self.blocks, self.places = blocks, places or {}

    @classmethod
    def of(cls, record: Any) -> "Flat":
        """Lay out a record; a dimension has one size in all fields of the record that names it, else: ValueError."""
        places, sizes, table, known = dict[str, Place](), [0, 0, 0], list[int](), dict[tuple[str, str], int]()
        for path, kind, dimensions in _leaves(type(record)):
            shape, owner = np.shape(_at(record, path)), path.rpartition(".")[0]
            named = zip(dimensions, shape, strict=False)
            sized = tuple(known.setdefault((owner, d), s) if isinstance(d, str) else d for d, s in named)
            if sized != shape or len(dimensions) != len(shape):
                raise ValueError(f"{path} has the shape {shape}, where {dimensions} are {sized}")
            start = sizes[kind]
            sizes[kind] += int(np.prod(shape, dtype=int))
            places[path] = Place(kind, slice(start, sizes[kind]), shape, dimensions in ((), (1,)))
            table += [start, sizes[kind], *shape] if shape else [start]
        blocks: Any = (*map(np.empty, sizes, BLOCK_TYPES), np.array(table, np.int64))
        flat = cls(blocks, places)
        for path in places:
            flat.put(path, _at(record, path))
        return flat

    def copy(self) -> "Flat":
        """Return a copy whose numbers may be written to; yes and no are shared."""
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
        return record(*(
            self.part(f"{path}.{name}", hint) if hasattr(hint, "_fields") else self._row(f"{path}.{name}")
            for name, hint in _hints(record).items()
        ))  # fmt: skip

    def fill(self, path: str, value: Any) -> None:
        """Write a record in the record."""
        record: type = type(value)
        for name, hint in _hints(record).items():
            (self.fill if hasattr(hint, "_fields") else self.put)(f"{path}.{name}", getattr(value, name))

    def take(self, other: "Flat", names: Sequence[str]) -> None:
        """Take fields, or records with all of theirs, from another record of the same class, as far as shapes agree."""
        for path, place in self.places.items():
            if path.split(".")[0] in names and other.places[path].shape == place.shape:
                self.put(path, other.get(path))

    def _row(self, path: str) -> Any:
        kind, at, shape, _ = self.places[path]
        return self.blocks[kind][at].reshape(shape)


def opener(record: type, *paths: str) -> Callable[[Blocks], Any]:
    """Return compiled code that makes views of fields of a record, or of records in it, from its blocks; it is inlined.

    It is a tuple of them. What is not opened costs nothing: open no more than a function needs.
    """
    scope, index, entries = dict[str, Any](__name__=record.__module__), dict[str, int](), 0
    for path, _, dimensions in _leaves(record):
        index[path], entries = entries, entries + (2 + len(dimensions) if dimensions else 1)

    def made(hint: Any, path: str) -> str:
        if hasattr(hint, "_fields"):
            scope[f"record_{len(scope)}"], name = hint, f"record_{len(scope)}"
            return f"{name}({', '.join(made(inner, f'{path}.{field}') for field, inner in _hints(hint).items())})"
        kind, *dimensions = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        block, at = "fib"[_KINDS[kind]], index[path]
        if not dimensions:
            return f"{block}[at[{at}]]"
        shape = ", ".join(f"at[{at + 2 + d}]" for d in range(len(dimensions)))
        return f"{block}[at[{at}] : at[{at + 1}]]" + (f".reshape(({shape}))" if len(dimensions) > 1 else "")

    def hint_of(path: str) -> Any:
        hint: Any = record
        for name in path.split("."):
            hint = _hints(hint)[name]
        return hint

    views = "".join(made(hint_of(path), path) + ", " for path in paths)
    text = f"def opened(blocks):\n    f, i, b, at = blocks\n    return {views}\n"
    exec(compile(text, f"<views of {record.__name__}>", "exec"), scope)  # noqa: S102  of names of fields
    return inlined(scope["opened"])
