"""Sensor units of other programs: links that a URDF fixes to an arm, or a CSV or YAML file of poses."""

import csv
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from pretouch.errors import SkinError
from pretouch.importing.tree import RobotTree, pose
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import Sensor, sensor_called
from pretouch.sensing.unit import SensorUnit, seat
from pretouch.types import FloatArray

_RAISED_M = 0.03
"""Largest depth in a capsule from which a unit is raised [m]: capsules stand over surfaces by as much."""
_TURN = 6.3
"""Angle beyond which degrees are likely [rad]."""
_SCALES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "rad": 1.0, "deg": np.pi / 180}
_TEXTS = {
    "id": ("id", "name", "unit", "sensor_id", "sensor_name", "frame"),
    "link": ("link", "link_name", "parent", "parent_link", "parent_frame", "frame_id", "body"),
    "sensor": ("sensor", "sensor_type", "type", "model"),
}
"""Keys of texts, those of other programs too."""
_KINDS = {
    "position": ("", "p", "t", "pos", "pose", "position", "translation", "location", "origin", "xyz"),
    "quaternion": ("q", "quat", "quaternion", "orientation", "rotation", "wxyz", "xyzw"),
    "beam": ("n", "normal", "direction", "beam"),
}
"""Words before x, y, z and w in keys, as in pos_x_mm, px or orientation_w."""
_PARTS = {"position": "xyz", "quaternion": "wxyz", "angles": ("roll", "pitch", "yaw"), "beam": "xyz"}
_LISTS = {"wxyz": "wxyz", "xyzw": "xyzw", "rpy": ("roll", "pitch", "yaw")}
"""Words at the ends of the keys of lists, and the parts of these; other lists are x, y and z."""
Beam = Literal["z", "x", "y", "-x", "-y", "-z"]
"""Axis of a unit's frame along which it looks."""


@dataclass(frozen=True, eq=False)
class ImportedUnit:
    """A unit on the arm."""

    unit: SensorUnit
    raised: float
    """Height by which it was raised out of its link's capsules, along their normal [m]."""
    outward: float
    """Cosine of the angle between its beam and that normal; NaN where the link has no capsule."""


def fixed_links(robot: RobotTree) -> dict[str, str]:
    """Return the links that a file fixes to another, each with the link which it is fixed to."""
    links = robot.links
    return {link.name: links[link.parent].name for link in links[1:] if link.parent > 0 and not link.joints}


def chosen(names: dict[str, str], patterns: str, ask: Callable[[str], str] | None) -> list[str]:
    """Return the names that match patterns or numbers with commas between; without any, those of the answer."""
    if not patterns and ask:
        listed = "\n".join(f"{i:4} {name}, on {parent}" for i, (name, parent) in enumerate(names.items(), 1))
        patterns = ask(f"{listed}\nUnits, by numbers as 1,3-5 or by a pattern as *_sensor: ")
    words = [word.strip() for word in patterns.split(",") if word.strip()]
    ranges = [match for word in words if (match := re.fullmatch(r"(\d+)(?:-(\d+))?", word))]
    numbers = {i for r in ranges for i in range(int(r[1]), int(r[2] or r[1]) + 1)}
    matching = [n for i, n in enumerate(names, 1) if i in numbers or any(fnmatchcase(n, word) for word in words)]
    if not matching:
        raise SkinError(
            f"No link that the file fixes to another is {patterns or 'named'}: give --links a pattern of these:"
            f" {', '.join(names) or 'none'}."
        )
    return matching


def units_of_links(robot: RobotTree, model: RobotModel, names: list[str], sensor: Sensor) -> list[SensorUnit]:
    """Return the units that stand as links in a file, each on itself or the nearest link that has a capsule."""
    units = []
    for name in names:
        at, T, mounts = robot.index(name), np.eye(4), list[tuple[str, FloatArray]]()
        while True:
            if (link := robot.links[at].name) in model.links[1:]:
                mounts.append((link, T))
            if at == 0 or robot.links[at].joints:
                break
            T = pose(robot.model.body_pos[at], robot.model.body_quat[at]) @ T
            at = robot.links[at].parent
        if not mounts:
            raise SkinError(
                f"{name} is fixed to {robot.links[at].name}, which {model.description.name} does not have: import this"
                f" file by `pretouch robot import` for --arm, or rename its links to {', '.join(model.links[1:])}."
            )
        solid = [one for one in mounts if seat(model, model.link_index(one[0]), one[1][:3, 3])]
        link, T = (solid or mounts[::-1])[0]
        units.append(SensorUnit(name, link, T, sensor=sensor))
    return units


def units_of_table(file: Path, model: RobotModel, sensor: Sensor) -> list[SensorUnit]:
    """Return the units of a CSV or YAML file of poses; a fault is a SkinError that names the unit."""
    units = []
    try:
        for place, entry in _csv(file) if file.suffix.lower() in (".csv", ".tsv", ".txt") else _yaml(file):
            texts = {ours: next((entry[k] for k in theirs if entry.get(k)), "") for ours, theirs in _TEXTS.items()}
            link = texts["link"] or next((word for word in place.split("/") if word in model.links), "")
            if not link:
                raise SkinError(f"{file}: {place} names no link: add link, one of {', '.join(model.links[1:])}.")
            kind = sensor_called(texts["sensor"], f"{file}: {place}", {}) if texts["sensor"] else sensor
            name = str(texts["id"] or place.rpartition("/")[2].replace(" ", "_"))
            units.append(SensorUnit(name, str(link), _pose(entry, f"{file}: {place}"), sensor=kind))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        reason = " ".join(str(error).split())
        raise SkinError(f"{file} cannot be read: {reason}: give a URDF, or a CSV or YAML file of poses.") from error
    if not units:
        raise SkinError(
            f"{file} holds no poses: give each unit id, link, x, y, z and qw, qx, qy, qz, or roll, pitch, yaw, or the"
            " beam as nx, ny, nz; units that stand as links of a URDF are imported from that, by --links PATTERN."
        )
    return units


def _csv(file: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the rows of a table with a header, and the line of each; one of another length is a SkinError."""
    lines = enumerate(file.read_text(encoding="utf-8-sig").splitlines(), 1)
    texts = {number: line for number, line in lines if line.strip() and not line.startswith("#")}
    first = next(iter(texts.values()), "")
    table = csv.reader(texts.values(), delimiter=max(",;\t", key=first.count))
    keys = [re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") for name in next(table, [])]
    for number, row in zip(list(texts)[1:], table, strict=False):
        if len(row) != len(keys):
            raise SkinError(f"{file}: line {number} has {len(row)} values, and the header has {len(keys)}: correct it.")
        yield f"line {number}", dict(zip(keys, map(str.strip, row), strict=True))


def _yaml(file: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the mappings of a file that have a position, and where each is."""

    def walk(node: Any, place: str) -> Iterator[tuple[str, dict[str, Any]]]:
        entry = dict(_flat(node, "")) if isinstance(node, dict) else {}
        if any(_part(key)[0] == "position" for key in entry):
            yield place, entry
        elif isinstance(node, dict | list):
            for key, value in node.items() if isinstance(node, dict) else enumerate(node, 1):
                yield from walk(value, f"{place}/{key}" if isinstance(node, dict) else f"{place} {key}")

    yield from walk(YAML(typ="safe").load(file), file.stem)


def _flat(node: dict[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield keys and values of a mapping; those of its pose, and the numbers of lists, have keys of their own."""
    for key, value in node.items():
        name = f"{prefix}{key}".lower()
        words = name.split("_")
        unit = f"_{words.pop()}" if words[-1] in _SCALES else ""
        if isinstance(value, dict) and any(words[-1] in names for names in _KINDS.values()):
            yield from _flat(value, f"{name}_")
        elif isinstance(value, list):
            parts = _LISTS.get(words[-1], "xyz")
            if any(words[-1] in kinds for kinds in (*_KINDS.values(), _LISTS)):
                if len(value) != len(parts):
                    way_out = "name a quaternion quaternion_wxyz or quaternion_xyzw"
                    raise SkinError(f"{name} has {len(value)} numbers, not {len(parts)}: {way_out}.")
                yield from ((f"{'_'.join(words)}_{part}{unit}", v) for part, v in zip(parts, value, strict=True))
        elif not isinstance(value, dict):
            yield name, value


def _part(key: str) -> tuple[str, str, str]:
    """Return the kind of number that a key has, of `_PARTS`, which part of it, and its unit; '' for what it has not."""
    words = key.split("_")
    unit = words.pop() if len(words) > 1 and words[-1] in _SCALES else ""
    *others, part = words
    if part in _PARTS["angles"]:
        return "angles", part, unit
    before, axis = (others[-1], part) if others and len(part) == 1 else (part[:-1], part[-1:])
    kinds = (kind for kind, names in _KINDS.items() if before in names and axis in [*_PARTS[kind]])
    return next(kinds, ""), axis, unit


def _pose(entry: dict[str, Any], where: str) -> FloatArray:
    """Return the pose (4, 4) of an entry, whose keys may end in units; z looks along a beam that is given alone."""
    values: dict[tuple[str, str], float] = {}
    for key, value in entry.items():
        kind, part, unit = _part(key)
        if not kind or value in ("", None):
            continue
        try:
            values[kind, part] = float(value) * _SCALES[unit or "m"]
        except (TypeError, ValueError):
            raise SkinError(f"{where}: {key} is {value!r}: give a number, with a decimal point.") from None
        if kind == "angles" and not unit and abs(values[kind, part]) > _TURN:
            raise SkinError(f"{where}: {key} is {value!r}: give radians, or name it {key}_deg.")
    parts = {kind: [values.get((kind, part), np.nan) for part in names] for kind, names in _PARTS.items()}
    full = [kind for kind, numbers in parts.items() if np.isfinite(numbers).all()]
    turn = next((kind for kind in full if kind == "angles" or (kind != "position" and any(parts[kind]))), "")
    if "position" not in full or not turn:
        raise SkinError(
            f"{where} has no complete pose: give x, y, z and qw, qx, qy, qz, or roll, pitch, yaw, or the beam as nx,"
            f" ny, nz, not all zero; it has {', '.join(entry)}."
        )
    from scipy.spatial.transform import Rotation  # takes a fifth of a second to load

    T, numbers = np.eye(4), np.array(parts[turn])
    if turn == "beam":
        rotation = Rotation.align_vectors(numbers[None], [[0.0, 0.0, 1.0]])[0]
    elif turn == "quaternion":
        rotation = Rotation.from_quat(numbers, scalar_first=True)
    else:
        rotation = Rotation.from_euler("xyz", numbers)
    T[:3, :3], T[:3, 3] = rotation.as_matrix(), parts["position"]
    return T


def mounted(unit: SensorUnit, model: RobotModel, beam: Beam) -> ImportedUnit:
    """Return a unit whose frame has the beam along an axis with the pose of ours, raised out of its link's capsules.

    To the side, the y axis of our frame points down, as in the optical frames of ROS. A unit deeper than `_RAISED_M`
    is left where it is, which a `Skin` refuses.
    """
    T, z = unit.T_link_sensor.copy(), np.eye(3)["xyz".index(beam[-1])] * (-1.0 if beam[0] == "-" else 1.0)
    y = np.array([0.0, 0.0, -1.0]) if z[2] == 0 else np.array([0.0, z[2], 0.0])
    T[:3, :3] = T[:3, :3] @ np.column_stack([np.cross(y, z), y, z])
    below, raised, outward = seat(model, model.link_index(unit.link), T[:3, 3]), 0.0, np.nan
    if below:
        normal = below.normal if below.normal.any() else T[:3, 2]
        raised, outward = -below.height if -_RAISED_M < below.height < 0 else 0.0, float(T[:3, 2] @ normal)
        T[:3, 3] += (1 + 1e-6) * raised * normal
    return ImportedUnit(replace(unit, T_link_sensor=T), raised, outward)
