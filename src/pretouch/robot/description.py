"""Description of an arm beside its MJCF, in robot.toml: limits, names, a posture and the sources of the figures."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from pretouch.errors import RobotModelError
from pretouch.toml_files import shown, table_of
from pretouch.types import FloatArray

FILE = "robot.toml"

_TEXTS = ("name", "mjcf", "ee_body", "source")
_LISTS = {"qd_max": "rad/s", "qdd_max": "rad/s^2", "tau_max": "Nm", "q_ready": "rad"}
_MOUNTING = {"gravity": "1"}
_ENVELOPE = {"offset": "rad/s", "slope": "rad/s^2", "q_upper": "rad", "q_lower": "rad"}
_LARGEST = 1e6
"""Largest number in a file: a larger one is a mistake."""
_SHIPPED = Path(str(files("pretouch.robot") / "data"))


@dataclass(frozen=True)
class SpeedEnvelope:
    """Speed limits of n joints that fall towards the ends of their ranges, as a robot's interface enforces them.

    Towards its upper end a joint at q may move at max(0, -offset + sqrt(slope (q_upper - q))), towards its lower end at
    max(0, -offset + sqrt(slope (q - q_lower))), even if its constant limit is larger. Each reaches zero
    offset^2 / slope before its reference. Away from an end there is no limit.
    """

    offset: FloatArray
    """(n,) [rad/s]."""
    slope: FloatArray
    """(n,) [rad/s^2]: along the envelope a joint slows by at most half of it."""
    q_upper: FloatArray
    """(n,) reference of the upper side [rad]; it may lie beyond the joint's position limit."""
    q_lower: FloatArray
    """(n,) reference of the lower side [rad]."""
    source: str
    """Source of the figures."""

    def __post_init__(self) -> None:
        shape = self.offset.shape
        for name in ("offset", "slope", "q_upper", "q_lower"):
            value = getattr(self, name)
            if value.shape != shape or len(shape) != 1 or not np.all(np.isfinite(value)):
                raise RobotModelError(f"Speed envelope: {name} is {value}: give one finite number a joint.")
        if np.any(self.offset < 0):
            raise RobotModelError(f"Speed envelope: offset is {self.offset}: none may be negative.")
        if np.any(self.slope <= 0):
            raise RobotModelError(f"Speed envelope: slope is {self.slope}: all must be positive.")
        if np.any(self.q_upper - self.q_lower <= 2 * self.offset**2 / self.slope):
            raise RobotModelError(
                f"Speed envelope: between q_lower {self.q_lower} and q_upper {self.q_upper} a joint cannot move in both"
                " directions: give each q_upper above its q_lower."
            )

    def moved_in(self, margin: float) -> "SpeedEnvelope":
        """Return the envelope with both sides moved inwards by a margin [rad]."""
        return replace(self, q_upper=self.q_upper - margin, q_lower=self.q_lower + margin)


STANDING = np.array([0.0, 0.0, -1.0])
"""Direction of gravity in the base frame of an arm that stands."""


@dataclass(frozen=True)
class RobotDescription:
    """An arm of n hinge joints in one chain, described by an MJCF file and its limits.

    The base frame O is the frame of the MJCF's world. Joint position limits are the MJCF's own.
    """

    name: str
    mjcf: Path
    """MJCF file; its capsule geoms are taken as the arm's body."""
    ee_body: str
    """Body whose origin is the end-effector (TCP)."""
    qd_max: FloatArray
    """(n,) joint velocity limits [rad/s]."""
    qdd_max: FloatArray
    """(n,) joint acceleration limits [rad/s^2]."""
    tau_max: FloatArray
    """(n,) joint torque limits [Nm]."""
    q_ready: FloatArray
    """(n,) ready posture, the usual start [rad]."""
    source: str
    """Source of the limits."""
    envelope: SpeedEnvelope | None = None
    """Speed limits that depend on the position, beside `qd_max`; None if there are none."""
    gravity: FloatArray = field(default_factory=STANDING.copy)
    """(3,) direction of gravity in the base frame, of any length: how the arm is mounted."""

    def __post_init__(self) -> None:
        n, g = len(self.q_ready), np.asarray(self.gravity, np.float64)
        if g.shape != (3,) or not np.all(np.isfinite(g)) or not g.any():
            raise RobotModelError(
                f"{self.name}: gravity is {g}: give its direction in the base frame, such as 0,0,-1 for an arm that"
                " stands and 0,0,1 for one that hangs."
            )
        for name in ("qd_max", "qdd_max", "tau_max"):
            value = getattr(self, name)
            if value.shape != (n,) or not np.all(np.isfinite(value)) or np.any(value <= 0):
                raise RobotModelError(f"{self.name}: {name} is {value}: give {n} positive, finite numbers.")
        if self.envelope is not None and self.envelope.offset.shape != (n,):
            raise RobotModelError(
                f"{self.name}: the speed envelope is for {len(self.envelope.offset)} joints: give {n} of each number."
            )
        if not self.mjcf.is_file():
            raise RobotModelError(f"{self.name}: the MJCF file {self.mjcf} does not exist: check its name.")


def panda() -> RobotDescription:
    """Franka Emika Panda with hand. Limits as published by the vendor (libfranka, `rate_limiting.h`)."""
    return load_description(_SHIPPED / "panda.toml")


def fr3() -> RobotDescription:
    """Franka Research 3 with hand. Limits as published by the vendor (libfranka, `rate_limiting.h`).

    The speed envelope of joints 2, 3 and 7 ends 0.1 to 0.4 mrad beyond their position limits: both apply.
    """
    return load_description(_SHIPPED / "fr3.toml")


ROBOTS = {"panda": panda, "fr3": fr3}
"""Arms of the package."""


def is_shipped(arm: RobotDescription) -> bool:
    """Return whether an arm's model is one of the package: a Panda or an FR3."""
    return arm.mjcf.parent == _SHIPPED


def robot_named(name: str, gravity: Sequence[float] = ()) -> RobotDescription:
    """Return the description of an arm, by its name or by the folder or robot.toml that it was imported to.

    `gravity` is another direction of gravity than its own. Raises RobotModelError if there is neither, or if the file
    or the direction is wrong.
    """
    if gravity:
        return replace(robot_named(name), gravity=np.array(gravity))
    if name in ROBOTS:
        return ROBOTS[name]()
    if not Path(name).exists():
        raise RobotModelError(
            f"There is no arm {name!r}: take one of {', '.join(ROBOTS)}, or a folder that"
            " `pretouch robot import FILE --out FOLDER` wrote."
        )
    return load_description(name)


def load_description(path: Path | str) -> RobotDescription:
    """Read the description of an arm from robot.toml, or from the folder that holds it.

    A mistake in it is a RobotModelError that names the file, the key, the value and the way out.
    """
    path = Path(path)
    if path.is_dir():
        path = path / FILE
    way_out = f"give {FILE} or its folder, as `pretouch robot import` writes it"
    data = table_of(path, "robot file", RobotModelError, way_out)
    table = data.pop("envelope", None)
    lists = _LISTS | (_MOUNTING if "gravity" in data else {})
    fields = _fields(path, data, _TEXTS, lists, "gravity", "envelope")
    envelope = {} if table is None else _fields(path, table, ("source",), _ENVELOPE)
    try:
        if envelope:
            fields["envelope"] = SpeedEnvelope(**envelope)
        return RobotDescription(**fields | {"mjcf": path.parent / fields["mjcf"]})
    except (RobotModelError, OSError) as error:  # a file's name may be too long to look for
        raise RobotModelError(f"{error} (in {path})") from error


def description_text(arm: RobotDescription, mjcf: str = "") -> str:
    """Return a text of robot.toml from which `load_description` reads the same arm, with an MJCF file of this name."""
    texts = {"name": arm.name, "mjcf": mjcf or arm.mjcf.name, "ee_body": arm.ee_body, "source": arm.source}
    e = arm.envelope
    envelope = {} if e is None else {"envelope": _lists(e, _ENVELOPE) | {"source": e.source}}
    mounting = {} if np.array_equal(arm.gravity, STANDING) else _lists(arm, _MOUNTING)
    return tomli_w.dumps(texts | _lists(arm, _LISTS) | mounting | envelope)


def _lists(described: RobotDescription | SpeedEnvelope, names: dict[str, str]) -> dict[str, Any]:
    return {name: getattr(described, name).tolist() for name in names}


def files_digest(arm: RobotDescription) -> str:
    """Return the SHA-256 of an arm's description and MJCF file."""
    return sha256(description_text(arm).encode() + arm.mjcf.read_bytes()).hexdigest()


def _fields(path: Path, table: Any, texts: tuple[str, ...], lists: dict[str, str], *others: str) -> dict[str, Any]:
    """Return the texts and the lists of numbers of a table, which has no other keys than these and `others`."""
    if not isinstance(table, dict):
        raise RobotModelError(f"{path}: envelope is {shown(table)}: give a table [envelope].")
    unknown = sorted(set(table) - {*texts, *lists})
    if unknown:
        raise RobotModelError(f"{path}: the key {unknown[0]!r} is unknown: use {', '.join((*texts, *lists, *others))}.")
    for key in texts:
        text = table.get(key)
        if not isinstance(text, str) or (key != "source" and not (text.isprintable() and text)):
            raise RobotModelError(f"{path}: {key} is {shown(text)}: give printable text in quotes.")
    for key, unit in lists.items():
        row = table.get(key)
        if not isinstance(row, list) or not all(type(v) in (int, float) and abs(v) <= _LARGEST for v in row):
            way_out = f"give a list of finite numbers, one a joint [{unit}]"
            raise RobotModelError(f"{path}: {key} is {shown(row)}: {way_out}.")
    return {key: table[key] for key in texts} | {key: np.array(table[key], np.float64) for key in lists}
