"""Files that `pretouch skin calibrate` writes."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pretouch.cli.writing import check_writable, numbers_to
from pretouch.errors import CalibrationError

if TYPE_CHECKING:
    from pretouch.cli.calibrate.options import Calibrate, CalibrateArm

_WRITTEN = {"out", "json", "record"}


@dataclass(frozen=True)
class Outputs:
    """Where the answer goes, besides the terminal."""

    skin: Path | None
    write: Callable[[Any], None]
    """Takes the numbers."""


@contextmanager
def outputs_of(command: "Calibrate | CalibrateArm[Any]") -> Iterator[Outputs]:
    """Give what is asked for.

    CalibrationError or ExperimentError for what could not be written, or is also another input or output file.
    """
    _check_apart(command)
    skin = Path(command.out) if command.out else None
    if skin:
        check_free("skin file", skin, command.replace)
        check_writable("skin file", skin)
    check_free("file", Path(command.json), command.replace)
    with numbers_to(command.json) as write:
        yield Outputs(skin, write)


def check_free(what: str, place: Path, replace: bool) -> None:
    """Raise CalibrationError for a file that is there and not to be replaced."""
    if place.is_file() and not replace:
        raise CalibrationError(f"The {what} {place} exists already: give another name, or --replace.")


def same_file(one: Path, other: Path) -> bool:
    """Whether `other` is the file `one` by another name, be it there or not, or lies in the folder `one`."""
    if one.exists() and other.exists() and one.samefile(other):
        return True
    first, second = Path(os.path.realpath(one)), Path(os.path.realpath(other))
    return second.is_relative_to(first)


def _check_apart(command: "Calibrate | CalibrateArm[Any]") -> None:
    """Raise CalibrationError where a file to write is one to read, or another to write; --out may be --skin."""
    recorded, units = getattr(command, "recorded", None), getattr(command, "units", None)
    files = {
        "recording": getattr(recorded, "recording", ""),
        "joints": getattr(recorded, "joints", ""),
        "keys": getattr(units, "keys", ""),
        "skin": command.skin,
        "out": command.out,
        "json": command.json,
        "record": getattr(command, "record", ""),
    }
    for (one, first), (other, second) in combinations(((name, text) for name, text in files.items() if text), 2):
        if other in _WRITTEN and (one, other) != ("skin", "out") and same_file(Path(first), Path(second)):
            raise CalibrationError(
                f"--{other} {second} would be written over --{one} {first}: give --{other} another name."
            )
