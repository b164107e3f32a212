"""Parameters and facts as JSON, and back with checks."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.errors import PretouchError, RecordingError

JSON = Any
"""What JSON can hold: None, bool, numbers, text, and lists and dicts with text keys of these."""


def as_json(value: JSON) -> str:
    """Return a value as JSON; one that JSON cannot hold is a RecordingError."""
    try:
        return json.dumps(value, default=_plain)
    except (TypeError, ValueError, RecursionError) as error:
        raise RecordingError(
            f"The description of the run cannot be written as JSON ({error}): give plain values."
        ) from error


def _plain(value: Any) -> Any:
    """Return a number or array of NumPy, or a path, as JSON has it."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{value!r} is no plain value")


def from_json(text: str) -> dict[str, JSON]:
    """Return the table that JSON holds; anything else is a RecordingError."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"The description of the run in the recording is damaged: {error}") from error
    if not isinstance(found, dict):
        raise RecordingError("The description of the run in the recording is damaged: it is not a table.")
    return found


def sound(made: Callable[[], Any]) -> Any:
    """Return what is made; what cannot be made from a recording is a RecordingError."""
    try:
        return made()
    except RecordingError:
        raise
    except (PretouchError, ValueError, TypeError, LookupError, AttributeError, OverflowError, OSError) as error:
        why = " ".join(str(error).split())
        raise RecordingError(f"The recording does not describe a controller that can be made again: {why}") from error
