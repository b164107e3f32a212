"""Files that commands write: each is checked to be writable before the work begins."""

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.atomic_write import json_text, write_json
from pretouch.errors import ExperimentError

STANDARD_OUTPUT = "-"
"""Argument of --json for the standard output."""


@contextmanager
def unwritable_said(what: str, place: Path) -> Iterator[None]:
    """Turn what the system says of a file into an ExperimentError; `what` begins its sentence."""
    try:
        yield
    except OSError as error:
        raise ExperimentError(f"The {what} {place} cannot be written ({error.strerror}): give another file.") from error


def check_writable(what: str, place: Path) -> None:
    """Make the folder of a file, and raise ExperimentError if the file could not be written there."""
    with unwritable_said(what, place):
        if place.exists() and not place.is_file() and not place.is_dir():  # a device or pipe is written to as it is
            if not os.access(place, os.W_OK):
                raise PermissionError(13, "Permission denied")
            return
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=place.parent):
            pass
        with suppress(FileNotFoundError):
            os.stat(place)  # a name too long, for one
        if place.is_dir():
            raise IsADirectoryError(21, "Is a directory")


def check_outputs(outputs: Iterable[tuple[str, Path | None]], inputs: Iterable[Path | None], replace: bool) -> None:
    """Raise ExperimentError for a file to write that is read too, is there already, or cannot be written.

    Outputs are files with what they are; None and the standard output are none.
    """
    places = [place for place in inputs if place]
    for what, place in outputs:
        if place and str(place) != STANDARD_OUTPUT:
            if any(same_file(other, place) or same_file(place, other) for other in places):
                raise ExperimentError(f"The {what} {place} is also another input or output file: give another name.")
            if place.is_file() and not replace:
                raise ExperimentError(f"The {what} {place} exists already: give another name, or --replace.")
            check_writable(what, place)
            places.append(place)


def same_file(one: Path, other: Path) -> bool:
    """Return True if both paths lead to the same file, existing or not, or `other` lies in the folder `one`."""
    if one.exists() and other.exists() and one.samefile(other):
        return True
    first, second = Path(os.path.realpath(one)), Path(os.path.realpath(other))
    return second.is_relative_to(first)


@contextmanager
def numbers_to(place: str | Path | None) -> Iterator[Callable[[Any], None]]:
    """Yield a function that writes a command's numbers as JSON to --json: a file, '-', or nothing for '' and None.

    With '-' they go to standard output, and all text that is printed in the context to standard error. Raises
    ExperimentError, at once, for a file that cannot be written.
    """
    if not place:
        yield lambda _numbers: None
    elif str(place) == STANDARD_OUTPUT:
        out = sys.stdout
        with redirect_stdout(sys.stderr):
            yield lambda numbers: print(json_text(plain(numbers)), end="", file=out, flush=True)
    else:
        file = Path(place)
        check_writable("file", file)

        def write(numbers: Any) -> None:
            with unwritable_said("file", file):
                write_json(plain(numbers), file)
            print(f"Numbers: {file}", flush=True)

        yield write


def plain(value: Any) -> Any:
    """Return what JSON can hold: arrays and tuples become lists, numbers that are not finite None.

    A dataclass becomes a dictionary of its fields and properties.
    """
    if is_dataclass(value) and not isinstance(value, type):
        properties = [name for name, member in vars(type(value)).items() if isinstance(member, property)]
        return {name: plain(getattr(value, name)) for name in (*(field.name for field in fields(value)), *properties)}
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
