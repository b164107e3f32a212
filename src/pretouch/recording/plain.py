"""Parameters and facts as JSON, and back with checks."""

import json
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.errors import PretouchError, RecordingError
from pretouch.params import Profile
from pretouch.recording.messages import plain_text

JSON = Any
"""What JSON can hold: None, bool, numbers, text, and lists and dicts with text keys of these."""


def as_json(value: JSON) -> str:
    """Return a value as JSON; one that JSON cannot hold is a RecordingError."""
    try:
        return plain_text(json.dumps(value, default=_plain))
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


def profile_from(given: dict[str, Any]) -> tuple[Profile, tuple[str, ...]]:
    """Make a profile from the numbers of each group, and name what another version knew that this one does not.

    What is missing gets this version's default, what is unknown is left out; both are named.
    """
    made: dict[str, Any] = {}
    kinds = {f.name: f.type for f in fields(Profile)}
    unlike = sorted(set(given) ^ set(kinds))
    for name, kind in kinds.items():
        if name not in given:
            continue
        if kind is str:
            made[name] = str(given[name])
            continue
        if not isinstance(given[name], dict) or not isinstance(kind, type):
            raise RecordingError(f"The group {name} of the recorded profile is {given[name]!r}: it must be a table.")
        known = {f.name for f in fields(kind)}
        unlike += [f"{name}.{other}" for other in sorted(set(given[name]) ^ known)]
        chosen = {key: value for key, value in given[name].items() if key in known}
        _same_kinds(name, chosen, kind())
        made[name] = sound(partial(kind, **chosen))
    return Profile(**made), tuple(unlike)


def _same_kinds(group: str, given: dict[str, Any], usual: object) -> None:
    """Refuse a number where there is a text or a yes or no, and the other way round."""
    for name, value in given.items():
        for kind in (bool, str):
            if isinstance(value, kind) != isinstance(getattr(usual, name), kind):
                raise RecordingError(
                    f"The recorded parameter {group}.{name} is {value!r}, which is not one of its values."
                )


def sound(made: Callable[[], Any]) -> Any:
    """Return what is made; what cannot be made from a recording is a RecordingError."""
    try:
        return made()
    except RecordingError:
        raise
    except (PretouchError, ValueError, TypeError, KeyError, OSError) as error:
        why = " ".join(str(error).split())
        raise RecordingError(f"The recording does not describe a controller that can be made again: {why}") from error
