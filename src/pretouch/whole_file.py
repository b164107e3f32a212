"""A text file that is replaced whole or not at all."""

import os
import shutil
from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Write a text file beside its place and put it there; into a device or pipe as it is. Raises OSError.

    Where the path is a symbolic link, the file it leads to is replaced. Whatever goes wrong, what was there stays.
    """
    place = Path(os.path.realpath(path))
    if place.exists() and not place.is_file() and not place.is_dir():
        place.write_text(text, encoding="utf-8")
        return
    unfinished = place.with_name(f".pretouch.{os.getpid()}.tmp")  # as short for a long name
    try:
        with unfinished.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        if place.is_file():
            shutil.copymode(place, unfinished)
        os.replace(unfinished, place)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise
