"""Tables: CSV, TSV and Parquet files with columns that say their units, as time_s, force_x_N, q1_rad."""

import csv
import math
import re
from array import array
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.errors import ParameterError, RecordingError
from pretouch.imported_data.log import PARQUET, TORQUES, Choice, Log, Note, arm_of, joint_places, listed
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

_ANGLE, _TORQUE = {"rad": 1.0, "deg": math.pi / 180}, {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3}
_SPEED = {f"{unit}_s": factor for unit, factor in _ANGLE.items()}
_UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "force": {"N": 1.0, "kN": 1e3},
    "torque": _TORQUE,
    "q": _ANGLE,
    "dq": _SPEED,
    "dq_d": _SPEED,
    "tau_ext": _TORQUE,
    "tau": _TORQUE,
    "current": {"A": 1.0, "mA": 1e-3},
}
"""Units of each kind and what they are in SI; names of columns are read regardless of case."""
_OURS = re.compile(r"(time|force|torque|dq_d|qd_d|dq|qd|q|tau_ext|tau|current)(?:(\d{1,2})|_([xyz]))?(?:_(.+))?")
_LIBFRANKA = re.compile(r"(?:state\.)?(dq_d|dq|q|tau_j|tau_ext_hat_filtered)(?:\[(\d)\]|_(\d))")
"""Names in the logs of libfranka, and of arrays of a `franka::RobotState` that panda-py logs: all in SI."""
_JOINT = re.compile(r"(.+)_(rad|deg)")
"""Position of a joint by its name."""
_OTHERWISE = {"qd": "dq", "qd_d": "dq_d", "tau_j": "tau", "tau_ext_hat_filtered": "tau_ext"}
_BY_ROBOT = "tau_ext_hat_filtered"
_LONGEST_S = 30 * 86_400.0
"""A log longer than this [s] has another unit of time."""
_LATEST_S = 4e9
"""A time beyond this [s] is of no clock, nor since 1970."""
_LONGEST_LIST = 64
"""Places of a list in a Parquet file that are columns: more joints nobody has."""

_QUANTITIES = {
    "time": ("times", "time_s"),
    "q": ("joint positions", "q1_rad ..."),
    "dq": ("joint velocities", "dq1_rad_s ..."),
    "force": ("force", "force_x_N, force_y_N, force_z_N; of joints, q1_rad ... and tau1_Nm ..."),
    "tau_ext": ("torques", "tau_ext1_Nm ... or tau1_Nm ..."),
    "tau": ("torques", ""),
    "current": ("motor currents", ""),
}
"""Words for quantities in sentences, and their columns."""


@value
class _TableColumn:
    """Quantity, unit and joint of a column."""

    kind: str
    part: str
    """Axis, or joint as q1 or by its name; '' for the time."""
    unit: str
    """Unit in lower case; '' where its name has none."""
    by_robot: bool = False
    """True if its name tells that its torques are by the robot on its environment."""
    twice: bool = False
    """True if its name may come again, as in a log with the commands beside the states."""


class Table:
    """A table whose header was read."""

    def __init__(self, place: Path, choice: Choice) -> None:
        """Read the header. RecordingError for a table without one, and for a renaming of columns that it lacks."""
        if choice.wrench or choice.joints or choice.torques:
            raise RecordingError(f"{place} is a table and has no topics: leave out the option that names one.")
        self._place, self._choice = place, choice
        self._parquet = _parquet(place) if place.suffix.lower() == PARQUET else None
        self._names = renamed(place, _header(place) if self._parquet is None else list(self._parquet), choice.columns)
        self._columns = _columns([name.lower() for name in self._names])
        self.kinds = frozenset(column.kind for column in self._columns.values())
        self._dated = False

    def force(self, posture: bool) -> Log:
        """Read the force, and where asked for the joint positions at its instants."""
        return self._read("force", *(["q"] if posture else []), also=("torque",))

    def torques(self) -> Log:
        """Read one of `TORQUES`, with joint positions and perhaps velocities."""
        torque = next((kind for kind in TORQUES if kind in self.kinds), TORQUES[0])
        return self._read("q", torque, also=("dq", "dq_d"))

    def positions(self) -> Log:
        """Read joint positions."""
        return self._read("q")

    def _read(self, *needed: str, also: tuple[str, ...] = ()) -> Log:
        if missing := [kind for kind in ("time", *needed) if kind not in self.kinds]:
            there = [name for kind, (name, _) in _QUANTITIES.items() if kind in self.kinds] or ["columns"]
            lacking = ["no {} ({})".format(*_QUANTITIES[kind]) for kind in missing]
            raise RecordingError(
                f"{self._place} has {' and '.join(there)}, but {' and '.join(lacking)}: add columns of these names, or"
                f" name them by `pretouch detect --columns`; it has {listed(self._names)}."
            )
        joints = list(self._parts("q")) if "q" in needed else []
        model = arm_of(joints, self._choice)
        places, sources = {}, {}
        for kind in sorted({*needed, *also} & self.kinds, key=list(_UNITS).index):
            parts = self._parts(kind)
            if kind == "q":
                joints = [joints[i] for i in joint_places(self._place, joints, model)]
                places[kind] = [parts[joint] for joint in joints]
            else:
                axes = kind in ("force", "torque")
                numbered = joints if joints and joints[0] in parts else [f"q{j + 1}" for j in range(model.n)]
                order = ["x", "y", "z"] if axes else numbered
                if sorted(parts) != sorted(order):
                    raise RecordingError(
                        f"{self._place} has {kind} of {', '.join(parts)}, but of {', '.join(order)} it is needed: add"
                        " columns or leave them out."
                    )
                places[kind] = [parts[part] for part in order]
            sources[kind] = self._names[places[kind][0]]
        used = [*self._parts("time").values(), *(i for indices in places.values() for i in indices)]
        factors = [self._factor(i) for i in used]
        table, rows = self._numbers(used)
        table = np.where(np.isfinite(table), table, np.nan) * factors
        timed = np.isfinite(table[:, 0])
        time = np.zeros(len(table), dtype=np.int64)
        time[timed] = self._instants(table[timed, 0])
        notes = [Note("dates", {"column": self._names[used[0]]})] if self._dated else []
        if unused := [name for i, name in enumerate(self._names) if i not in used]:
            notes.append(Note("unused", {"names": listed(unused)}))
        row = "line {}" if self._parquet is None else "row {}"
        ends = np.cumsum([1, *map(len, places.values())])
        arrays = {kind: table[:, a:b] for kind, a, b in zip(places, ends[:-1], ends[1:], strict=True)}
        by_robot = "tau_ext" in places and self._columns[places["tau_ext"][0]].by_robot
        log = Log(self._place, model, time, rows, row, arrays, sources, "", by_robot, tuple(notes))
        return log.without("no_time", ~timed).forward()

    def _parts(self, kind: str) -> dict[str, int]:
        """Return the column of each part of a kind; the first where a log has two."""
        parts: dict[str, int] = {}
        for i, column in self._columns.items():
            if column.kind != kind:
                continue
            other = parts.setdefault(column.part, i)
            if other != i and not column.twice:
                raise RecordingError(
                    f"{self._place} has two columns of one thing, {self._names[other]!r} and {self._names[i]!r}: keep"
                    " one."
                )
        return parts

    def _factor(self, i: int) -> float:
        """Return the factor that brings a column to SI."""
        column, name = self._columns[i], self._names[i]
        units = _UNITS[column.kind]
        for unit, factor in units.items():
            if unit.lower() == column.unit:
                return factor
        stem = name[: len(name) - len(column.unit)].rstrip("_") if column.unit else name
        what = f"the unit {column.unit!r}" if column.unit else "no unit"
        ways = " or ".join(f"{stem}_{unit}" for unit in units)
        raise RecordingError(f"The column {name!r} of {self._place} has {what}: write {ways}.")

    def _numbers(self, used: list[int]) -> tuple[FloatArray, IntArray]:
        """Columns (N, m) of all rows, NaN where a cell is empty, and the numbers (N,) of their lines."""
        if self._parquet is not None:
            columns = list(self._parquet.items())
            table = np.column_stack([_floats(self._place, *columns[i]) for i in used])
            return table, np.arange(1, len(table) + 1)
        lines, cells, rows = array("q"), array("d"), _rows(self._place)
        next(rows)
        width = max(i for i, name in enumerate(self._names) if name) + 1
        for line, row in rows:
            if len(row) < width or any(cell.strip() for cell in row[width:]):
                hint = ", with decimal points" if len(row) > width else " (it ends early)"
                raise RecordingError(
                    f"{self._place}, line {line}: {len(row)} cells for {width} columns: give each line as many{hint}."
                )
            try:
                numbers = [float(row[i].replace("_", "?")) for i in used]  # Python takes 1_0 for a number
            except ValueError:
                numbers = [self._number(line, i, row[i].strip()) for i in used]
            cells.extend(numbers)
            lines.append(line)
        return np.array(cells).reshape(-1, len(used)), np.array(lines, dtype=np.int64)

    def _number(self, line: int, i: int, cell: str) -> float:
        with suppress(ValueError):
            return float(cell.replace("_", "?") or "nan")
        is_time, hint = self._columns[i].kind == "time", "write a number or leave it empty"
        if is_time:
            with suppress(ValueError):
                instant, self._dated = datetime.fromisoformat(cell), True
                return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp() / self._factor(i)
            hint = "write a number, or a date as 2026-10-25T02:59:40.25"
        if re.fullmatch(r"[-+]?\d+,\d+", cell):
            hint = "use a decimal point"
        raise RecordingError(f"{self._place}, line {line}: {self._names[i]} is {cell[:40]!r}: {hint}.")

    def _instants(self, seconds: FloatArray) -> IntArray:
        """Instants (N,) [ns]."""
        if not len(seconds):
            raise RecordingError(f"{self._place} has no row with a time: add rows below the header.")
        first, last = float(seconds.min()), float(seconds.max())
        if last - first > _LONGEST_S or max(-first, last) > _LATEST_S:
            raise RecordingError(
                f"The times of {self._place} go from {first:.6g} to {last:.6g} s: check their unit, or cut the file."
            )
        return round(float(seconds[0]) * 1e9) + np.round((seconds - seconds[0]) * 1e9).astype(np.int64)


def _columns(names: list[str]) -> dict[int, _TableColumn]:
    """Return the columns that are used, by their names in lower case."""
    logs = {i: log for i, name in enumerate(names) if (log := _LIBFRANKA.fullmatch(name))}
    first = 1 if any("0" in log.groups() for log in logs.values()) else 0
    columns: dict[int, _TableColumn] = {}
    for i, name in enumerate(names):
        if log := logs.get(i):
            kind = _OTHERWISE.get(log[1], log[1])
            unit = next(iter(_UNITS[kind])).lower()
            columns[i] = _TableColumn(kind, f"q{int(log[2] or log[3]) + first}", unit, log[1] == _BY_ROBOT, twice=True)
        elif ours := _OURS.fullmatch(name):
            kind, number, axis, unit = _OTHERWISE.get(ours[1], ours[1]), ours[2], ours[3], ours[4] or ""
            if bool(axis) == (kind in ("force", "torque")) and bool(number) == (
                kind not in ("time", "force", "torque")
            ):
                columns[i] = _TableColumn(kind, axis or (f"q{int(number)}" if number else ""), unit)
        elif joint := _JOINT.fullmatch(name):
            columns[i] = _TableColumn("q", joint[1], joint[2])
    if logs and not any(column.kind == "time" and column.unit for column in columns.values()):
        # libfranka logs milliseconds: of `duration` up to 0.8, of `time` with the names of its newer logs
        clock = "time" if any(log[0].startswith("state.") for log in logs.values()) else "duration"
        columns |= {i: _TableColumn("time", "", "ms") for i, name in enumerate(names) if name == clock}
    return columns


def _header(place: Path) -> list[str]:
    """Return the names of the columns of a file of text."""
    header = next(_rows(place), None)
    names = [name.strip().lstrip("#").strip() for name in header[1]] if header else []
    if not any(names):
        raise RecordingError(f"{place} is empty: give a table with a header, as time_s,q1_rad,tau_ext1_Nm and so on.")
    if not any(re.search("[a-zA-Z]", name) for name in names):
        raise RecordingError(f"{place} has no header: write the names of the columns in its first line.")
    return names


def _rows(place: Path) -> Iterator[tuple[int, list[str]]]:
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
        raise RecordingError(f"{place} is not UTF-8 text ({error.reason}): save it as UTF-8.") from error
    except csv.Error as error:
        raise RecordingError(f"{place} is not a CSV file ({error}): separate columns by , ; or a tab.") from error
    except OSError as error:
        raise RecordingError(f"{place} cannot be read: {error.strerror}.") from error


def _parquet(place: Path) -> dict[str, Any]:
    """Columns of a Parquet file by their names; one of lists is one for each place in them, `q[0]` and so on."""
    import pyarrow as pa
    import pyarrow.compute as pc
    from pyarrow import parquet

    try:
        table = parquet.read_table(place)
    except (OSError, pa.ArrowException) as error:
        begun = place.is_file() and place.read_bytes()[:4] == b"PAR1"
        what = f"{' '.join(str(error).split())[:200]}): " + ("give a complete file" if begun else "it is none")
        raise RecordingError(f"{place} cannot be read as a Parquet file ({what}.") from error
    columns: dict[str, Any] = {}
    for name in table.column_names:
        column, types = table[name], pa.types
        if types.is_timestamp(column.type) or types.is_duration(column.type):  # the type tells the unit
            columns[f"{re.sub('_(s|ms|us|ns)$', '', name)}_{column.type.unit}"] = column.cast(pa.int64())
        elif types.is_list(column.type) or types.is_large_list(column.type) or types.is_fixed_size_list(column.type):
            lengths = pc.list_value_length(column).to_numpy()
            if (other := np.flatnonzero(lengths != lengths[:1])).size:
                row, counts = other[0] + 1, f"{lengths[other[0]]:g} values, and {lengths[0]:g} in row 1"
                raise RecordingError(f"{place}, row {row}: {name} has {counts}: give each row as many.")
            length = min(int(lengths[0]) if len(lengths) else 0, _LONGEST_LIST)
            columns |= {f"{name}[{i}]": pc.list_element(column, i) for i in range(length)}
        else:
            columns[name] = column
    return columns


def _floats(place: Path, name: str, column: Any) -> FloatArray:
    """Numbers (N,) of a column, NaN where there is none."""
    import pyarrow as pa

    kind = column.type
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_null(kind)):
        raise RecordingError(f"The column {name!r} of {place} holds {kind}: give numbers.")
    # of epoch nanoseconds a float64 keeps 0.3 us
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)


def renamed(place: Path, names: list[str], mapping: str) -> list[str]:
    """Return columns' names with those of a mapping in place of theirs: pairs THEIRS=OURS separated by commas.

    `*` is the number of a joint, from 0 or 1 on: where there is a column with 0, they count from 0. ParameterError for
    what is no pair, RecordingError for a column that is not there.
    """
    columns = list(names)
    for pair in filter(None, map(str.strip, mapping.split(","))):
        theirs, _, ours = (part.strip() for part in pair.rpartition("="))
        if not (theirs and ours):
            raise ParameterError(f"--columns has {pair!r}: write THEIRS=OURS, as tau_J_0=tau1_Nm.")
        numbers = _numbers(names, theirs) if "*" in theirs else {names.index(theirs): ""} if theirs in names else {}
        if not numbers:
            raise RecordingError(f"{place} has no column {theirs!r} (it has {listed(names)}): change --columns.")
        first = 1 if "0" in numbers.values() else 0
        for i, number in numbers.items():
            columns[i] = ours.replace("*", str(int(number) + first)) if number else ours
    return columns


def _numbers(names: list[str], pattern: str) -> dict[int, str]:
    """Return the columns that fit a name with a *, and the number that stands for it."""
    form = re.compile(r"(\d{1,2})".join(re.escape(part) for part in pattern.split("*", 1)))
    fits = {i: form.fullmatch(name) for i, name in enumerate(names)}
    return {i: fit[1] for i, fit in fits.items() if fit}
