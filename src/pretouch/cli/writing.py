"""Files to write: that they can be written is found out first, and said in a sentence."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pretouch.errors import ExperimentError


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
