"""Which robots' force sign a guided push has confirmed: a small file, replaced whole or not at all."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pretouch.atomic_write import atomic_write
from pretouch.errors import RobotError

_FILE = "force-sign.json"


@dataclass(frozen=True)
class Identity:
    """A robot, and through what it is spoken to: with any of it changed, the push is asked for again."""

    kind: str
    """As `panda`, `fr3`, `ros2`."""
    address: str
    """Where it is."""
    connection: str
    """Library, driver settings and versions that lie between."""

    @property
    def key(self) -> str:
        """Name of its entry."""
        return f"{self.kind} at {self.address}"


def state_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for what is remembered, by the XDG base directory specification."""
    given = environment.get("XDG_STATE_HOME", "")
    base = Path(given) if os.path.isabs(given) else Path.home() / ".local" / "state"
    return base / "pretouch"


class ConfirmedRobots:
    """The file of confirmed robots in a folder."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / _FILE

    def is_confirmed(self, robot: Identity) -> bool:
        """Whether this robot has been confirmed; a file that cannot be read is a RobotError."""
        return self._read().get(robot.key) == robot.connection

    def keep(self, robot: Identity) -> None:
        """Note that a robot is confirmed; RobotError where that cannot be written."""
        entries = self._read() | {robot.key: robot.connection}
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            atomic_write(self.path, json.dumps(entries, indent=1))
        except OSError as error:
            raise RobotError(
                f"The confirmation cannot be saved in {self.path} ({error.strerror}): make that folder writable, or"
                " set XDG_STATE_HOME to another one."
            ) from error

    def _read(self) -> dict[str, str]:
        try:
            found: Any = json.loads(self.path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise RobotError(f"The file {self.path} cannot be read: {error.strerror}.") from error
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
            raise RobotError(f"The file {self.path} is damaged: delete it, and repeat the guided pushes.")
        return found
