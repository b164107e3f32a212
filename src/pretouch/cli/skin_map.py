"""`pretouch skin map`: learn what distance an electrode's signal stands for, as a sensor type for a skin file."""

import csv
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tomli_w

from pretouch.calibration.field_map import FieldMap, learn_map
from pretouch.cli.writing import numbers_to
from pretouch.errors import CalibrationError
from pretouch.sensing.sensor import Capacitive
from pretouch.types import FloatArray

if TYPE_CHECKING:
    from pretouch.cli.skin_commands import Map

_COLUMNS = ("distance_m", "signal")


def skin_map(command: "Map") -> None:
    """Learn the map, and print the type's table for a skin file, with what it is worth as comments."""
    with numbers_to(command.json) as write:
        found = learn_map(*_measured(command))
        write(asdict(found))
        for line in _said(found):
            print(f"# {line}")
        table = {
            "like": Capacitive.name, "farthest_m": round(found.farthest_m, 3), "gain": _short(found.gain),
            "offset_m": _short(found.offset_m), "power": _short(found.power), "spread_1": _short(found.spread_1),
        }  # fmt: skip
        print(tomli_w.dumps({"sensor": {command.name: table}}), end="")


def _measured(command: "Map") -> tuple[FloatArray, FloatArray, list[str]]:
    """Return distances [m], signals and what approached; what is wrong with a file is a CalibrationError."""
    if command.table == "simulated":
        from pretouch.sim.approach import simulated_approach

        return simulated_approach(Capacitive(), command.seed)
    return _read(Path(command.table))


def _said(found: FieldMap) -> list[str]:
    more = f"{100 * found.spread_1:.0f} %"
    return [
        f"signal = {found.gain:.3g} / (distance + {found.offset_m:.3g} m)^{found.power:.3g}; noise {found.noise:.3g}.",
        f"Everything that approached is felt from {found.farthest_m:.3f} m on.",
        f"What comes may be nearer or farther than the map says, by {more} (standard deviation):",
        *(f"  {name or 'all'}: the map says {100 * off:+.0f} %" for name, off in found.of.items()),
    ]


def _short(number: float) -> float:
    return float(f"{number:.4g}")


def _read(place: Path) -> tuple[FloatArray, FloatArray, list[str]]:
    rows, things = list[tuple[float, float]](), list[str]()
    try:
        with place.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            missing = [name for name in _COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                raise CalibrationError(
                    f"The table {place} has no column {missing[0]!r}: its first line names distance_m, signal and, if"
                    " several things approached, thing."
                )
            for row in reader:
                rows.append(tuple(_number(row[name], name, place, reader.line_num) for name in _COLUMNS))  # type: ignore[arg-type]
                things.append(row.get("thing") or "")
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CalibrationError(f"The table {place} cannot be read: {error}.") from error
    table = np.array(rows).reshape(-1, 2)
    return table[:, 0], table[:, 1], things


def _number(text: str | None, name: str, place: Path, line: int) -> float:
    try:
        return float(text or "")
    except ValueError:
        raise CalibrationError(f"{name} is {text!r} in line {line} of {place}: give a number.") from None
