"""Files of results: whole or not at all, and what is said where they could not be written."""

import json
import os
from collections.abc import Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

from pretouch.errors import ExperimentError


def write_json(value: Any, path: Path) -> None:
    """Write a JSON file, whole or not at all; into a device or pipe as it is, never in its place."""
    text = json.dumps(value, indent=1, allow_nan=False) + "\n"
    if path.exists() and not path.is_file() and not path.is_dir():
        path.write_text(text, encoding="utf-8")
        return
    path = Path(os.path.realpath(path))
    name = sha256(os.fsencode(path.name)).hexdigest()[:16]  # as short for a long name
    temporary = path.with_name(f".{name}.{os.getpid()}.tmp")
    try:
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


@contextmanager
def failure_said(out: Path) -> Iterator[None]:
    """Turn a worker that was killed, or results that could not be written, into an ExperimentError."""
    try:
        yield
    except BrokenProcessPool as error:
        raise ExperimentError(
            "A worker process was killed, for want of memory perhaps: the same command with the same --out goes on."
        ) from error
    except OSError as error:
        raise ExperimentError(
            f"Results could not be written to {out} ({error.strerror or error}): remove the cause, and the same command"
            " with the same --out goes on."
        ) from error
