"""Atomic writes: a file has its old content or all of its new one."""

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def atomic_write(path: Path, text: str, private: bool = False) -> None:
    """Write a text file beside its place and put it there; into a device or pipe as it is. Raises OSError.

    Where the path is a symbolic link, the file it leads to is replaced. Whatever goes wrong, what was there stays. Only
    its owner can read a `private` file, at any moment.
    """
    place = Path(os.path.realpath(path))
    if place.exists() and not place.is_file() and not place.is_dir():
        place.write_text(text, encoding="utf-8")
        return
    with atomic_replacement(place, private) as unfinished, unfinished.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def atomic_replacement(place: Path, private: bool = False) -> Iterator[Path]:
    """Give a new file beside a file's place; what is written there replaces the file, or is gone after an exception.

    Its name cannot be foreseen, and it is there alone: nobody else can make it a link to a file of theirs or yours.
    Only its owner can read a `private` file; another has the mode of the one that it replaces.
    """
    unfinished = place.with_name(f".{os.urandom(8).hex()}.tmp")
    os.close(os.open(unfinished, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o600 if private else 0o666))
    try:
        yield unfinished
        if place.is_file() and not private:
            shutil.copymode(place, unfinished)
        os.replace(unfinished, place)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def write_json(value: Any, path: Path) -> None:
    """Write a value as JSON by `atomic_write`. Raises OSError, and ValueError for numbers that are not finite."""
    atomic_write(path, json_text(value))


def json_text(value: Any) -> str:
    """Return a value as JSON, indented. Raises ValueError for numbers that are not finite."""
    return json.dumps(value, indent=1, allow_nan=False) + "\n"
