"""A recording in a CSV file: columns with names that say their units, as time_s, force_x_N, q1_rad."""

import csv
import math
import re
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pretouch import extras
from pretouch.errors import RecordingError
from pretouch.imported_data.renaming import listed, renamed
from pretouch.imported_data.source import Choice, Series, Source
from pretouch.types import FloatArray, IntArray

UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "force": {"n": 1.0, "kn": 1e3},
    "torque": {"nm": 1.0, "knm": 1e3},
    "q": {"rad": 1.0, "deg": math.pi / 180},
}
"""Allowed units and what they are in SI, in lower case: headers are read regardless of it."""
_SHOWN = {
    "time": "time_s, time_ms, time_us or time_ns",
    "force": "force_x_N or force_x_kN",
    "torque": "torque_x_Nm or torque_x_kNm",
    "q": "q1_rad or q1_deg",
}
_NAME = re.compile(r"(time|force|torque|q)(?:(?<=q)(\d{1,2})|_([xyz]))?(?:_([^_]*))?")
Rows = Iterator[tuple[int, list[str]]]
"""Lines with their numbers, split into cells."""
_LONGEST_S = 30 * 86_400.0
"""A recording longer than this [s] has another unit of time."""


def read_csv(place: Path, choice: Choice) -> Source:
    """Read a CSV file. RecordingError for what cannot be read, with the column, the row and the way out."""
    if choice.wrench or choice.joints:
        raise RecordingError(f"{place} is a CSV file and has no topics: leave out --wrench and --joints.")
    opened = open_table(place, choice.columns)
    columns, factors = _columns(place, opened.names)
    table, time, notes = opened.read({i: factors[key] for key, i in columns.items()})
    force = table[:, [k for k, key in enumerate(columns) if key.startswith(("force", "torque"))]]
    angles = [k for k, key in enumerate(columns) if key.startswith("q")]
    joints = Series(time, table[:, angles]) if angles and choice.posture else None
    return Source("the columns force_x, force_y, force_z", Series(time, force), "", joints, "auto", tuple(notes))


class OpenTable(NamedTuple):
    """A table whose header was read."""

    names: list[str]
    """Of its columns, by our names where a mapping says so."""
    read: Callable[[dict[int, float]], tuple[FloatArray, IntArray, list[str]]]
    """Reads columns as `read_table` does."""


def open_table(
    place: Path, mapping: tuple[tuple[str, str], ...] = (), example: str = "time_s,force_x_N,force_y_N,force_z_N"
) -> OpenTable:
    """Open a CSV or Parquet file; RecordingError for one that cannot be read, and for a mapping of columns it lacks.

    `example` is of a header, for the error of an empty file.
    """
    if place.suffix.lower() == ".parquet":
        extras.PARQUET.need("A Parquet file")
        from pretouch.imported_data.parquet import read_parquet

        theirs, columns = read_parquet(place)
        names = renamed(place, theirs, mapping)
        return OpenTable(names, lambda factors: in_si(place, columns(list(factors)), names, factors))
    rows, theirs = read_header(place, example)
    names = renamed(place, theirs, mapping)
    return OpenTable(names, lambda factors: read_table(place, rows, names, factors))


def read_header(place: Path, example: str) -> tuple[Rows, list[str]]:
    """Return the rows below the header, to be read on, and the columns' names; an empty file is a RecordingError."""
    rows = _rows(place)
    header = next(rows, None)
    if header is None:
        raise RecordingError(f"{place} is empty: give a CSV file with a header, as {example}.")
    return rows, [name.strip().lstrip("#").strip() for name in header[1]]


def _rows(place: Path) -> Rows:
    """Lines of the file that are not blank, with their numbers, split at the separator that the first one shows."""
    try:
        with place.open(encoding="utf-8-sig", newline="") as file:
            first = next((line for line in file if line.strip()), "")
            separator = max(",;\t", key=first.count)
            file.seek(0)
            lines = csv.reader(file, delimiter=separator, strict=True)
            for cells in lines:
                if any(cell.strip() for cell in cells):
                    yield lines.line_num, cells
    except UnicodeDecodeError as error:
        raise RecordingError(f"{place} is not UTF-8 text ({error.reason}): give a CSV file.") from error
    except csv.Error as error:
        raise RecordingError(f"{place} is not a CSV file ({error}): separate columns by , ; or a tab.") from error
    except OSError as error:
        raise RecordingError(f"{place} cannot be read: {error.strerror}.") from error


def _key(name: str) -> tuple[str, str, str] | None:
    """Quantity, which one of it, and unit that a column's name tells, in lower case; None for one of no use."""
    found = _NAME.fullmatch(name.lower())
    if found is None:
        return None
    quantity, number, axis, unit = found.groups()
    which = number or axis or ""
    if (quantity == "time") == bool(which) or (quantity == "q") != bool(number):
        return None
    return quantity, which, unit or ""


def _columns(place: Path, names: list[str]) -> tuple[dict[str, int], dict[str, float]]:
    """Which column holds what, as force_x or q1, and the factor that brings it to SI."""
    columns: dict[str, int] = {}
    factors: dict[str, float] = {}
    for i, name in enumerate(names):
        found = _key(name)
        if found is None:
            continue
        quantity, which, unit = found
        if unit not in UNITS[quantity]:
            what = f"the unit {unit!r}" if unit else "no unit"
            raise RecordingError(f"The column {name!r} of {place} has {what}: write {_SHOWN[quantity]}.")
        key = quantity + which if quantity == "q" else "_".join(filter(None, (quantity, which)))
        if key in columns:
            raise RecordingError(f"{place} has two columns for {key}, {names[columns[key]]!r} and {name!r}: keep one.")
        columns[key], factors[key] = i, UNITS[quantity][unit]
    for needed in ("time", "force_x", "force_y", "force_z"):
        if needed not in columns:
            shown = _SHOWN[needed[:-2] if "_" in needed else needed].replace("_x", needed[-2:])
            raise RecordingError(f"{place} has no column {needed} (it has {listed(names)}): add one named {shown}.")
    order = [k for k in ("time", *(f"{q}_{a}" for q in ("force", "torque") for a in "xyz")) if k in columns]
    if sum(key.startswith("torque") for key in order) not in (0, 3):
        raise RecordingError(f"{place} has only some of torque_x, torque_y and torque_z: give all three, or none.")
    order += sorted((key for key in columns if key.startswith("q")), key=lambda key: int(key[1:]))
    return {key: columns[key] for key in order}, factors


def read_table(
    place: Path, rows: Rows, names: list[str], factors: dict[int, float]
) -> tuple[FloatArray, IntArray, list[str]]:
    """Read columns, the first of which is the time, times the factors that bring them to SI.

    Returns:
        Numbers (N, m) of the rows that have a time, NaN where a cell is empty; instants (N,) [ns] since the first; and
        what is to be said of the file.
    """
    cells = array("d")
    wanted = list(factors)
    for line, row in rows:
        try:
            cells.extend([float(row[i]) for i in wanted])
        except (ValueError, IndexError):
            cells.extend([_number(place, line, names, row, i) for i in wanted])
    return in_si(place, np.array(cells, dtype=np.float64).reshape(-1, len(wanted)), names, factors)


def in_si(
    place: Path, numbers: FloatArray, names: list[str], factors: dict[int, float]
) -> tuple[FloatArray, IntArray, list[str]]:
    """Bring columns (N, m) that were read to what `read_table` returns."""
    table = np.where(np.isfinite(numbers), numbers, np.nan) * np.array(list(factors.values()))
    time, notes = _relative_time(place, table[:, 0])
    unused = [name for i, name in enumerate(names) if i not in factors]
    if unused:
        notes.append(f"Columns that are not used: {listed(unused)}.")
    return table[np.isfinite(table[:, 0])], time, notes


def _number(place: Path, line: int, names: list[str], cells: list[str], i: int) -> float:
    if i >= len(cells):
        raise RecordingError(f"{place}, line {line}: {len(cells)} cells for {len(names)} columns: complete the line.")
    cell = cells[i].strip()
    if not cell:
        return math.nan
    try:
        return float(cell)
    except ValueError:
        hint = "use a decimal point" if re.fullmatch(r"[-+]?\d+,\d+", cell) else "write a number or leave it empty"
        raise RecordingError(f"{place}, line {line}: {names[i]} is {cell[:40]!r}: {hint}.") from None


def _relative_time(place: Path, seconds: FloatArray) -> tuple[IntArray, list[str]]:
    """Instants [ns] since the first, of the rows that have one, and what is to be said of the others."""
    known = seconds[np.isfinite(seconds)]
    if not len(known):
        raise RecordingError(f"{place} has no row with a time: add rows below the header.")
    span = float(known.max() - known.min())
    if span > _LONGEST_S:
        raise RecordingError(f"The times of {place} span {span:.3g} s: check their unit, or cut the file.")
    without = len(seconds) - len(known)
    said = "1 row has no time and was" if without == 1 else f"{without} rows have no time and were"
    notes = [f"{said} left out."] if without else []
    return np.round((known - known[0]) * 1e9).astype(np.int64), notes
