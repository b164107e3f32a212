"""A table in a Parquet file. A column of lists is one column for each place in them, `q[0]` and so on."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet

from pretouch.errors import RecordingError
from pretouch.types import FloatArray

_LONGEST_LIST = 64
"""Places of a list that are columns: more joints nobody has."""


def read_parquet(place: Path) -> tuple[list[str], Callable[[list[int]], FloatArray]]:
    """Return the columns' names, and what gives some of them (N, m), NaN where a cell is empty."""
    try:
        table = parquet.read_table(place)
    except (OSError, pa.ArrowException) as error:
        said = " ".join(str(error).split())[:200]
        raise RecordingError(f"{place} cannot be read as a Parquet file ({said}): give a complete file.") from error
    columns = {name: part for field in table.column_names for name, part in _parts(field, table[field]).items()}

    def numbers(wanted: list[int]) -> FloatArray:
        return np.column_stack([_floats(place, *list(columns.items())[i]) for i in wanted])

    return list(columns), numbers


def _parts(name: str, column: pa.ChunkedArray) -> dict[str, pa.ChunkedArray]:
    kind = column.type
    if not (pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)):
        return {name: column}
    length = pc.min(pc.list_value_length(column)).as_py() or 0
    return {f"{name}[{i}]": pc.list_element(column, i) for i in range(min(length, _LONGEST_LIST))}


def _floats(place: Path, name: str, column: pa.ChunkedArray) -> FloatArray:
    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        column = column.cast(pa.int64())  # of epoch nanoseconds, a float64 keeps 0.3 us
    elif not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_null(kind)):
        raise RecordingError(f"The column {name!r} of {place} holds {kind}: give numbers.")
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
