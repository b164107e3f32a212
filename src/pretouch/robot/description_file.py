"""Description of an arm in a file: robot.toml, beside the MJCF that it names; and the arms that can be named."""

import os
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from pretouch.errors import RobotModelError
from pretouch.robot.description import RobotDescription, SpeedEnvelope, fr3, panda
from pretouch.toml_files import read_toml
from pretouch.types import FloatArray

FILE = "robot.toml"

_WORDS = ("name", "mjcf", "ee_body", "source")
_LISTS = {"qd_max": "rad/s", "qdd_max": "rad/s^2", "tau_max": "Nm", "q_ready": "rad"}
_ENVELOPE = {"offset": "rad/s", "slope": "rad/s^2", "q_upper": "rad", "q_lower": "rad"}
_LARGEST = 1e6
"""Largest number in a file: any larger one is a mistake."""


def load_description(path: Path | str) -> RobotDescription:
    """Read the description of an arm from robot.toml, or from the folder that holds it.

    What is wrong with it is a RobotModelError that names the file, the key, the value and the way out.
    """
    path = Path(path)
    if path.is_dir():
        path = path / FILE
    data = _read(path)
    _check_keys(path, data, (*_WORDS, *_LISTS, "envelope"))
    words = {key: _word(path, data, key) for key in _WORDS}
    n = len(_numbers(path, data, "q_ready", "rad", None))
    lists = {key: _numbers(path, data, key, unit, n) for key, unit in _LISTS.items()}
    try:
        arm = RobotDescription(
            name=words["name"],
            mjcf=path.parent / words["mjcf"],
            ee_body=words["ee_body"],
            qd_max=lists["qd_max"],
            qdd_max=lists["qdd_max"],
            tau_max=lists["tau_max"],
            q_ready=lists["q_ready"],
            source=words["source"],
            envelope=_envelope(path, data["envelope"], n) if "envelope" in data else None,
        )
    except (RobotModelError, OSError) as error:  # a file's name may be too long to look for
        raise RobotModelError(f"{error} (in {path})") from error
    return arm


def description_text(arm: RobotDescription, mjcf: str = "") -> str:
    """Return the robot.toml that `load_description` reads back to the same arm, beside its MJCF file of this name."""
    given = {"name": arm.name, "mjcf": mjcf or arm.mjcf.name, "ee_body": arm.ee_body, "source": arm.source}
    lists = {key: [float(v) for v in getattr(arm, key)] for key in _LISTS}
    return tomli_w.dumps(given | lists | ({} if arm.envelope is None else {"envelope": _envelope_table(arm.envelope)}))


def _envelope_table(envelope: SpeedEnvelope) -> dict[str, Any]:
    return {key: [float(v) for v in getattr(envelope, key)] for key in _ENVELOPE} | {"source": envelope.source}


def _envelope(path: Path, table: Any, n: int) -> SpeedEnvelope:
    if not isinstance(table, dict):
        raise RobotModelError(f"{path}: envelope is {_shown(table)}: give a table [envelope].")
    _check_keys(path, table, (*_ENVELOPE, "source"))
    numbers = {key: _numbers(path, table, key, unit, n) for key, unit in _ENVELOPE.items()}
    return SpeedEnvelope(**numbers, source=_word(path, table, "source"))


def _check_keys(path: Path, table: dict[str, Any], keys: tuple[str, ...]) -> None:
    unknown = sorted(set(table) - set(keys))
    if unknown:
        raise RobotModelError(f"{path}: the key {unknown[0]!r} is unknown: use {', '.join(keys)}.")


def files_digest(arm: RobotDescription) -> str:
    """Return the SHA-256 of an arm's description and MJCF file."""
    return sha256(description_text(arm).encode() + arm.mjcf.read_bytes()).hexdigest()


def _read(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise RobotModelError(
            f"The robot file {path} cannot be read: {reason}: give {FILE} or its folder, as `pretouch robot import`"
            " writes it."
        ) from error
    except UnicodeDecodeError as error:
        raise RobotModelError(f"The robot file {path} is not UTF-8 text: {error.reason} at {error.start}.") from error
    except ValueError as error:  # not TOML, an integer too long, brackets too deep
        raise RobotModelError(f"The robot file {path} is not valid TOML: {error}.") from error


def _word(path: Path, data: dict[str, Any], key: str) -> str:
    value = data.get(key)
    if not isinstance(value, str) or (key != "source" and not (value.isprintable() and value)):
        raise RobotModelError(f"{path}: {key} is {_shown(value)}: give printable text in quotes.")
    return value


def _numbers(path: Path, data: dict[str, Any], key: str, unit: str, n: int | None) -> FloatArray:
    value = data.get(key)
    ok = isinstance(value, list) and len(value) > 0 and n in (None, len(value))
    if not ok or not all(type(v) in (int, float) and abs(v) <= _LARGEST for v in value or []):
        count = "" if n is None else f"{n} "
        raise RobotModelError(
            f"{path}: {key} is {_shown(value)}: give a list of {count}finite numbers, one a joint [{unit}]."
        )
    return np.array(value, dtype=np.float64)


def _shown(value: Any) -> str:
    """Show a value in a message, cut where it is long. An integer may have more digits than Python writes out."""
    try:
        text = repr(value)
    except ValueError:
        return "too long to show"
    return text if len(text) <= 200 else f"{text[:200]} ..."


ROBOTS = {"panda": panda, "fr3": fr3}
"""Those that come with the package."""


def is_shipped(arm: RobotDescription) -> bool:
    """Whether an arm's model is one that comes with the package: a Panda or an FR3."""
    return arm.mjcf in (panda().mjcf, fr3().mjcf)


def robot_named(name: str) -> RobotDescription:
    """Return the description of an arm, by its name or by the folder or robot.toml that it was imported to.

    Raises RobotModelError where there is neither, or where the file is wrong.
    """
    if name in ROBOTS:
        return ROBOTS[name]()
    if not Path(name).exists():
        raise RobotModelError(
            f"There is no arm {name!r}: take one of {', '.join(ROBOTS)}, or a folder that"
            " `pretouch robot import FILE --out FOLDER` wrote."
        )
    return load_description(name)
