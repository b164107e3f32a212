"""What was learnt of an arm's free motion, in a TOML file beside what else is known of the arm.

The numbers are plain tables here; `free_motion` brings them and the detector together.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from pretouch.atomic_write import atomic_write
from pretouch.errors import RobotModelError
from pretouch.robot.model import RobotModel
from pretouch.toml_files import read_toml
from pretouch.types import FloatArray

FORMAT = 1
_LARGEST = 1e6
"""Largest number in a file: any larger one is a mistake."""
_LATEST = 253_402_300_800.0
"""The year 10 000 [s since 1970]."""
_ANEW = "let the arm learn its free motion again"


@dataclass(frozen=True, eq=False)
class Residual:
    """What a file holds."""

    numbers: dict[str, FloatArray]
    """Arrays by name."""
    robot: str
    """Which robot it was learnt of, as `panda at 172.16.0.2`."""
    since: float
    """When that began [s since 1970, UTC]."""
    saved: float
    """When it was written [s since 1970, UTC]."""


def save_residual(path: Path, model: RobotModel, residual: Residual) -> None:
    """Write a file for an arm; one that is there is replaced whole or, with a RobotModelError, not at all."""
    arrays = {name: {"shape": list(a.shape), "values": a.reshape(-1).tolist()} for name, a in residual.numbers.items()}
    text = tomli_w.dumps({
        "format": FORMAT, "arm": model.description.name, "joints": list(model.joints), "robot": residual.robot,
        "since": residual.since, "saved": residual.saved, "array": arrays,
    })  # fmt: skip
    try:
        atomic_write(path, text)
    except OSError as error:
        raise RobotModelError(f"The free-motion file {path} cannot be written: {error.strerror}.") from error


def load_residual(path: Path, model: RobotModel, shapes: dict[str, tuple[int, ...]]) -> Residual:
    """Read a file with arrays of these names and shapes. One for another arm or version is a RobotModelError."""
    try:
        data = read_toml(path)
    except OSError as error:
        raise RobotModelError(f"The file {path} cannot be read: {error.strerror}: give one that was saved.") from error
    except ValueError as error:  # not of TOML, or not UTF-8
        raise RobotModelError(f"The file {path} is not valid TOML: {error}: {_ANEW}.") from error
    for key, ours in (("format", FORMAT), ("arm", model.description.name), ("joints", list(model.joints))):
        if data.get(key) != ours:
            raise RobotModelError(f"{path} has {key} = {data.get(key)!r}, but {ours!r} is needed: {_ANEW}.")
    robot, since, saved = data.get("robot"), _instant(data.get("since")), _instant(data.get("saved"))
    if not isinstance(robot, str) or since is None or saved is None:
        raise RobotModelError(f"{path} does not name its robot and start time: {_ANEW}.")
    found = data.get("array")
    return Residual({name: _array(path, found, name, shape) for name, shape in shapes.items()}, robot, since, saved)


def _instant(given: Any) -> float | None:
    return float(given) if type(given) in (int, float) and 0.0 <= given < _LATEST else None


def _array(path: Path, found: Any, name: str, shape: tuple[int, ...]) -> FloatArray:
    entry = found.get(name) if isinstance(found, dict) else None
    values = entry.get("values") if isinstance(entry, dict) else None
    if not isinstance(entry, dict) or entry.get("shape") != list(shape) or not isinstance(values, list):
        raise RobotModelError(f"{path}: {name} is not of the shape {shape}: {_ANEW}.")
    if len(values) != np.prod(shape) or not all(type(v) in (int, float) and abs(v) <= _LARGEST for v in values):
        raise RobotModelError(f"{path}: {name} must be {np.prod(shape)} finite numbers: {_ANEW}.")
    return np.array(values, dtype=np.float64).reshape(shape)
