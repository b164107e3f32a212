"""What was learnt of an arm's free motion, in a TOML file beside what else is known of the arm.

The numbers are plain tables here: this layer knows no detector. `pretouch.session` and others bring them together.
"""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from pretouch.errors import RobotModelError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

FORMAT = 1
_LARGEST = 1e6
"""Largest number in a file: any larger one is a mistake."""


def save_residual(path: Path, model: RobotModel, numbers: dict[str, FloatArray]) -> None:
    """Write arrays by name, for an arm. What cannot be written is a RobotModelError."""
    arrays = {name: {"shape": list(a.shape), "values": a.reshape(-1).tolist()} for name, a in numbers.items()}
    text = tomli_w.dumps(
        {"format": FORMAT, "arm": model.description.name, "joints": list(model.joints), "array": arrays}
    )
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RobotModelError(f"What was learnt cannot be written to {path}: {error.strerror}.") from error


def load_residual(path: Path, model: RobotModel, shapes: dict[str, tuple[int, ...]]) -> dict[str, FloatArray]:
    """Read the arrays of these names and shapes. One for another arm, or of another version, is a RobotModelError."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RobotModelError(f"The file {path} cannot be read: {error.strerror}: give one that was saved.") from error
    except (ValueError, RecursionError) as error:  # not of TOML, or not UTF-8
        raise RobotModelError(f"The file {path} is not valid TOML: {error}: save it anew.") from error
    for key, ours in (("format", FORMAT), ("arm", model.description.name), ("joints", list(model.joints))):
        if data.get(key) != ours:
            raise RobotModelError(
                f"{path} has {key} = {data.get(key)!r}, but {ours!r} is needed: let the arm learn its free motion anew."
            )
    found = data.get("array")
    return {name: _array(path, found, name, shape) for name, shape in shapes.items()}


def _array(path: Path, found: Any, name: str, shape: tuple[int, ...]) -> FloatArray:
    entry = found.get(name) if isinstance(found, dict) else None
    values = entry.get("values") if isinstance(entry, dict) else None
    if not isinstance(entry, dict) or entry.get("shape") != list(shape) or not isinstance(values, list):
        raise RobotModelError(f"{path}: {name} is not of the shape {shape}: let the arm learn its free motion anew.")
    if len(values) != np.prod(shape) or not all(type(v) in (int, float) and abs(v) <= _LARGEST for v in values):
        raise RobotModelError(
            f"{path}: {name} holds something else than {np.prod(shape)} finite numbers: save it anew."
        )
    return np.array(values, dtype=np.float64).reshape(shape)
