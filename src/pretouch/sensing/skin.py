"""A set of sensor units on one arm, and the TOML file that describes it."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import tomli_w
from msgspec import Struct, ValidationError, convert

from pretouch.atomic_write import atomic_write
from pretouch.errors import SkinError
from pretouch.robot.description import RobotDescription
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import (
    PAPER_SENSOR,
    Cones,
    Sensor,
    changed_by,
    cones_of,
    own_type,
    sensor_called,
    tables_of,
)
from pretouch.sensing.unit import NetworkUnits, SensorUnit, TouchPatch, seat, zones_of
from pretouch.toml_files import shown, table_of
from pretouch.types import FloatArray, IntArray

_FAR = 0.5
"""Largest distance of a unit from its link [m]: beyond it, millimetres in place of metres are likely."""

_MOST_UNITS = 2048
"""Units and zones on one arm, at most, as 32 units of 8 x 8: the time of a step and of the checks grows with them."""

PAPER_SKIN = Path(str(files("pretouch.sensing") / "data" / "panda_seven_units.toml"))
"""The file of `paper_skin` for the Panda."""


class SkinArrays(NamedTuple):
    """The K units of a `Skin`."""

    link: Annotated[IntArray, "K"]
    """(K,) link of each."""
    T_link_sensor: Annotated[FloatArray, "K", 4, 4]
    """(K, 4, 4)."""
    position_sigma: Annotated[FloatArray, "K"]
    """(K,) standard deviation of its position [m]."""
    orientation_sigma: Annotated[FloatArray, "K"]
    """(K,) standard deviation of its orientation [rad]."""
    cones: Cones
    """Field of view of each."""
    first: Annotated[IntArray, "B + 1"]
    """(B + 1,) first zone of each of the B mounted units, then K."""


class Skin:
    """K sensor units on an arm, checked against its model. The order of the units is the order of all readings.

    Each of several zones of a sensor counts as a unit of its own, along the zone's beam.

    Raises SkinError for too many units, duplicate ids, a link the arm does not have, and a unit inside its own link or
    far off it.
    """

    def __init__(self, units: Sequence[SensorUnit], model: RobotModel) -> None:
        self.units = tuple(zone for unit in units for zone in zones_of(unit))
        if len(self.units) > _MOST_UNITS:
            raise SkinError(f"The skin has {len(self.units)} units, each zone counted: give at most {_MOST_UNITS}.")
        ids = [unit.id for unit in self.units]
        twice = sorted({i for i in ids if ids.count(i) > 1})
        if twice:
            raise SkinError(f"The unit id {', '.join(twice)} is used more than once: give each unit its own id.")
        for unit in units:
            _check_place(unit, model)
        self.ids: tuple[str, ...] = tuple(ids)
        self.boards: tuple[str, ...] = tuple(unit.board for unit in self.units)
        """(K,) id of the mounted unit of each: its own, except for zones."""
        self.mounted = tuple(units)
        """The B mounted units; zones are not separate."""
        self.first: IntArray = np.array([k for k, unit in enumerate(self.units) if not unit.zone], dtype=np.int64)
        """(B,) index of each one's first zone, or its own."""
        self.board: IntArray = np.cumsum([not unit.zone for unit in self.units], dtype=np.int64) - 1
        """(K,) index of the mounted unit of each."""
        self.network = NetworkUnits(tuple(u.id for u in self.mounted), tuple(u.sensor.zones for u in self.mounted))
        """The same units on the network."""
        self.arrays = SkinArrays(
            np.array([model.link_index(u.link) for u in self.units], dtype=np.int64),
            np.array([u.T_link_sensor for u in self.units]).reshape(-1, 4, 4),
            np.array([u.position_sigma for u in self.units], dtype=np.float64),
            np.array([u.orientation_sigma for u in self.units], dtype=np.float64),
            cones_of([u.sensor for u in self.units]),
            np.append(self.first, len(self.units)),
        )
        """The same for compiled code."""
        self.link, self.T_link_sensor, position_sigma, orientation_sigma, self.cones, _ = self.arrays
        self.exact = not (position_sigma.any() or orientation_sigma.any() or self.cones.spread.any())
        """True if the poses of all units are exact, and the directions of their targets."""
        self.late: FloatArray = np.array([max(0.0, _age_s(u.sensor) - _age_s(PAPER_SENSOR)) for u in self.units])
        """(K,) time by which readings of each may be older than those of the paper's sensor [s]."""
        self.T_link_board: FloatArray = np.array([u.T_link_sensor for u in self.mounted]).reshape(-1, 4, 4)[self.board]
        """(K, 4, 4) pose of the mounted unit of each: the IMU's."""
        self.touching: IntArray = np.array([k for k, u in enumerate(self.units) if u.touch is not None], dtype=np.int64)
        """(M,) indices of the units with a touch sensor."""

    def __len__(self) -> int:
        return len(self.units)


def _age_s(sensor: Sensor) -> float:
    """Return the largest usual age of a sensor's newest reading [s]: its delay, and two missed readings."""
    _, delay_s, period_s = sensor.timing
    return delay_s + 3.0 * period_s


def _check_place(unit: SensorUnit, model: RobotModel) -> None:
    links = model.links[1:]
    if unit.link == model.links[0]:
        raise SkinError(f"Unit {unit.id} is mounted on {unit.link!r}: choose a link of the arm, {', '.join(links)}.")
    if unit.link not in links:
        raise SkinError(
            f"Unit {unit.id} is mounted on {unit.link!r}, which {model.description.name} does not have:"
            f" choose from {', '.join(links)}."
        )
    p = unit.T_link_sensor[:3, 3]
    below = seat(model, model.link_index(unit.link), p)
    height = float(np.linalg.norm(p)) if below is None else below.height
    if height < 0:
        raise SkinError(f"Unit {unit.id} lies {-1000 * height:.1f} mm inside {unit.link}: move it out to the surface.")
    if height > _FAR:
        raise SkinError(
            f"Unit {unit.id} lies {height:.4g} m off {unit.link}: give its position in metres, from the link's origin."
        )


def load_skin(path: Path | str, model: RobotModel) -> Skin:
    """Read a skin file. A mistake in it is a SkinError that names the file and the unit, and the way out."""
    path, place = Path(path), ""
    data = table_of(path, "skin file", SkinError)
    entries, tables = data.get("unit"), data.get("sensor", {})
    if not isinstance(entries, list) or not entries:
        raise SkinError(f"The skin file {path} has no unit: give at least one [[unit]] with id, link and pose.")
    try:
        if not isinstance(tables, dict):
            raise SkinError(f"sensor is {tables!r}: write a table [sensor.NAME] for each type of your own.")
        types = {name: own_type(name, table) for name, table in tables.items()}
        units = list[SensorUnit]()
        for number, entry in enumerate(entries, 1):
            place = f", unit {number} of {len(entries)}"
            units.append(_unit_from(entry, types))
            _check_place(units[-1], model)
        place = ""
        return Skin(units, model)
    except SkinError as error:
        raise SkinError(f"{error} (in {path}{place})") from error


def save_skin(skin: Skin, path: Path) -> None:
    """Write a skin file from which `load_skin` reads the same poses and uncertainties.

    An existing file is replaced as a whole or, with a SkinError, not at all. For a symbolic link, the file behind it is
    replaced.
    """
    try:
        units = {"unit": [_entry(unit) for unit in skin.mounted]}
        atomic_write(path, tomli_w.dumps(tables_of(unit.sensor for unit in skin.units) | units))
    except OSError as error:
        raise SkinError(f"The skin cannot be written to {path}: {error.strerror}.") from error


def paper_skin(model: RobotModel) -> Skin:
    """Seven units for the paper's experiment: four round the hand, one at the wrist, two on the forearm.

    The paper does not publish its layout; this one is ours, for Panda and FR3. Raises SkinError for another arm.
    """
    return load_skin(_shipped(model.description, "seven"), model)


def _shipped(arm: RobotDescription, count: str) -> Path:
    path = PAPER_SKIN.with_name(f"{arm.name}_{count}_units.toml")
    if not path.is_file():
        raise SkinError(
            f"The arm {arm.name} comes without a skin: write {OWN_SKIN} beside its model, like {PAPER_SKIN.name}, or by"
            f" `pretouch skin coverage --arm {arm.mjcf.parent} --workspace joints --suggest 8 --out"
            f" {arm.mjcf.with_name(OWN_SKIN)}`."
        )
    return path


OWN_SKIN = "skin.toml"
"""A skin beside the model of an imported arm."""


def skin_file(arm: RobotDescription, *, paper: bool = False) -> Path:
    """Return the file of an arm's own skin; SkinError if there is none.

    That is skin.toml beside its model, or, for Panda and FR3, sixteen units with zones, or the paper's seven.
    """
    own = arm.mjcf.with_name(OWN_SKIN)
    return own if own.is_file() else _shipped(arm, "seven" if paper else "sixteen")


def skin_for(model: RobotModel, file: Path | str | None = None, *, paper: bool = False) -> Skin:
    """Return the skin of a file, or without one the arm's own: of `paper`, for profiles that remember no places."""
    return load_skin(file or skin_file(model.description, paper=paper), model)


class _UnitTable(Struct, forbid_unknown_fields=True):
    """A [[unit]] of a skin file."""

    id: str
    link: str
    position_m: tuple[float, float, float]
    """Position from the link's origin [m]."""
    quaternion_wxyz: tuple[float, float, float, float]
    """Orientation of the sensor's axes in the link's."""
    position_sigma_m: float = 0.0
    orientation_sigma_rad: float = 0.0
    touch: bool | dict[str, Any] = False
    """True for the usual touch sensor, or the differences from it."""
    sensor: Any = PAPER_SENSOR.label
    """Name of its type."""


def _entry(unit: SensorUnit) -> dict[str, Any]:
    """Return the table of a unit in a skin file."""
    from scipy.spatial.transform import Rotation  # see `_rotation`

    wxyz = Rotation.from_matrix(unit.T_link_sensor[:3, :3]).as_quat(canonical=True, scalar_first=True).tolist()
    T, touch = unit.T_link_sensor, unit.touch is not None and (unit.touch == TouchPatch() or asdict(unit.touch))
    pose, sigmas = (T[:3, 3].tolist(), wxyz), (unit.position_sigma, unit.orientation_sigma)
    entry = (unit.id, unit.link, *pose, *sigmas, touch, unit.sensor.label)
    names, usual = _UnitTable.__struct_fields__, _UnitTable.__struct_defaults__
    defaults = dict(zip(names[-len(usual) :], usual, strict=True))
    return {name: value for name, value in zip(names, entry, strict=True) if value != defaults.get(name)}


def sensor_unit(**entry: Any) -> SensorUnit:
    """Return a unit from its values in a skin file; wrong or unknown values are a SkinError.

    Args:
        entry: `id`, `link`, `position_m` (3,) [m] from the link's origin, `quaternion_wxyz` (4,) of the sensor's axes
            in the link's, and, if known, `position_sigma_m` [m], `orientation_sigma_rad` [rad], `touch`
            (true, or its values) and `sensor` (the name of a type).
    """
    arrays = ("position_m", "quaternion_wxyz")
    return _unit_from({key: np.asarray(v).tolist() if key in arrays else v for key, v in entry.items()}, {})


def _unit_from(entry: Any, types: dict[str, Sensor]) -> SensorUnit:
    if not isinstance(entry, dict):
        raise SkinError(f"A unit is {shown(entry)}: write it as a [[unit]] table.")
    id = entry.get("id")
    name = f"Unit {id}" if isinstance(id, str) and id.isprintable() else "A unit"
    try:
        table = convert(entry, _UnitTable)
    except ValidationError as error:
        what = str(error) if str(error).isprintable() else ascii(str(error))
        raise SkinError(f"{name}: {what}: a [[unit]] has {', '.join(_UnitTable.__struct_fields__)}.") from error
    length = math.hypot(*table.quaternion_wxyz)
    if not abs(length - 1.0) <= 1e-3:
        raise SkinError(f"{name}: quaternion_wxyz has length {length:.4g}: it must be 1 to be a rotation.")
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = _rotation(*table.quaternion_wxyz), table.position_m
    touch = changed_by(TouchPatch(), table.touch, f"{name}: touch") if isinstance(table.touch, dict) else None
    sensor = sensor_called(table.sensor, name, types)
    sigmas = table.position_sigma_m, table.orientation_sigma_rad
    return SensorUnit(table.id, table.link, T, *sigmas, TouchPatch() if table.touch is True else touch, sensor)


def _rotation(w: float, x: float, y: float, z: float) -> FloatArray:
    """Return the matrix (3, 3) of a quaternion, to the bit that of SciPy, which takes a fifth of a second to load."""
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    return np.array([
        [xx - yy - zz + ww, 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), -xx + yy - zz + ww, 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), -xx - yy + zz + ww],
    ])  # fmt: skip
