"""Description of a recorded run: arm, skin, surroundings, path, parameters and versions, to bytes and back."""

import json
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path as FilePath
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any, TypeVar
from weakref import finalize

import numpy as np

from pretouch import __version__
from pretouch.composition import as_table, from_table
from pretouch.control.path import Circle, Path, WayPoints
from pretouch.controller import Controller
from pretouch.errors import PretouchError, RecordingError
from pretouch.perception.scene_filter import Fixtures
from pretouch.profiles import Profile
from pretouch.recording.packing import packed, unpacked
from pretouch.robot.body import Capsules
from pretouch.robot.description import FILE, RobotDescription, description_text, fr3, load_description, panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import Sensor
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit, TouchPatch
from pretouch.source_digest import source_digest
from pretouch.types import FloatArray

_MJCF = "arm.xml"
_LIBRARIES = ("numpy", "numba", "mujoco-core", "scipy")
"""Those whose numbers a result rests on."""
_SAMPLES = 400
"""Points kept of a path whose class is not ours, to draw it by."""
_APART_M = 1e-5
"""Points nearer to each other are one [m]: way-points must not coincide."""
Result = TypeVar("Result")


@dataclass(frozen=True)
class _KeptUnit:
    """A sensor unit as it is packed."""

    id: str
    link: str
    T_link_sensor: FloatArray
    position_sigma: float
    orientation_sigma: float
    touch: TouchPatch | None
    sensor: dict[str, Any]


@dataclass(frozen=True)
class _KeptPath:
    """A path as it is packed."""

    kind: str
    """Name of its class."""
    numbers: FloatArray
    """Circle: centre [m], radius [m], start angle [rad]; otherwise points (W, 3) [m]."""
    closed: bool


@dataclass(frozen=True)
class _KeptRun:
    """A run as it is packed."""

    started: float
    versions: dict[str, str]
    about: dict[str, Any]
    profile: dict[str, Any]
    robot: str
    """robot.toml."""
    arm: str
    """The MJCF file that it names."""
    units: tuple[_KeptUnit, ...]
    planes: FloatArray
    capsules: Capsules
    path: _KeptPath


@cache
def versions() -> dict[str, str]:
    """Return what a recomputation to the bit rests on: program, its source, libraries, machine."""
    program = {"pretouch": __version__, "source": source_digest(Controller)[:12]}
    libraries = {name: version(name) for name in _LIBRARIES}
    machine = f"{platform.machine()} {processor()}".strip()  # the kind of processor decides how a sum is rounded
    return program | libraries | {"python": platform.python_version(), "system": platform.system(), "machine": machine}


def processor() -> str:
    """Return the name of this machine's processor."""
    try:
        lines = FilePath("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


class Run:
    """One controller that made steps of a recording."""

    def __init__(self, sequence: int, data: bytes) -> None:
        """Take the number of the first step it made, and what `packed_run` returned."""
        run = unpacked(_KeptRun, data)
        self._run, self.sequence = run, sequence
        self.versions = run.versions
        """Program, libraries and machine it ran on."""
        self.started = run.started
        """Start of the run [s since 1970, UTC]."""
        self.about: dict[str, Any] = run.about
        """Facts that the caller gave."""
        self.profile: Profile = _sound(lambda: from_table(Profile, run.profile))

    @cached_property
    def model(self) -> RobotModel:
        """The arm."""
        return _sound(lambda: _model(self._run))

    @cached_property
    def skin(self) -> Skin:
        """The sensor units on it."""
        return _sound(lambda: Skin([_unit(unit) for unit in self._run.units], self.model))

    @cached_property
    def fixtures(self) -> Fixtures:
        """Fixtures around the arm."""
        return _sound(lambda: Fixtures(self._run.planes, self._run.capsules))

    @cached_property
    def path(self) -> Path:
        """The path it followed; of another class than ours, points of it, for drawings: of one that stands, 1 mm."""
        return _sound(lambda: _path(self._run.path))

    def controller(self, path: Path | None = None) -> Controller:
        """Make the controller again, on the model, skin and fixtures of this run.

        A path of another class than ours is not in the recording: give it, or it is a RecordingError.
        """
        if path is None and self._run.path.kind not in (Circle.__name__, WayPoints.__name__):
            raise RecordingError(
                f"The path of the run is of the class {self._run.path.kind}, which a recording cannot hold: give it,"
                " as run.controller(path=...) or verify(recorded, path=...)."
            )
        return _sound(lambda: Controller(self.model, self.skin, self.fixtures, path or self.path, self.profile))


def packed_run(controller: Controller, about: Mapping[str, Any]) -> bytes:
    """Return what describes a controller. Facts that JSON cannot hold are a RecordingError."""
    model, fixtures = controller.model, controller.fixtures
    units = [
        _KeptUnit(u.id, u.link, u.T_link_sensor, u.position_sigma, u.orientation_sigma, u.touch, as_table(u.sensor))
        for u in controller.skin.mounted
    ]
    facts, profile, path = _as_json(about), _as_json(as_table(controller.profile)), _kept_path(controller.path)
    arm = description_text(model.description, _MJCF), _mjcf(model.description)
    around = fixtures.planes, fixtures.capsules
    return packed(_KeptRun(time.time(), versions(), facts, profile, *arm, tuple(units), *around, path))


def _as_json(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return facts as JSON has them; others are a RecordingError."""
    try:
        return json.loads(json.dumps(dict(table), default=_plain))
    except (TypeError, ValueError, RecursionError) as error:
        raise RecordingError(
            f"The description of the run cannot be written as JSON ({error}): give plain values."
        ) from error


def _plain(value: Any) -> Any:
    """Return a number or array of NumPy, or a path, as JSON has it."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, FilePath):
        return str(value)
    raise TypeError(f"{value!r} is no plain value")


def _sound(make: Callable[[], Result]) -> Result:
    """Return what is made; what cannot be made from a recording is a RecordingError."""
    try:
        return make()
    except RecordingError:
        raise
    except (PretouchError, ValueError, TypeError, LookupError, AttributeError, OverflowError, OSError) as error:
        why = " ".join(str(error).split())
        raise RecordingError(f"The recording does not describe a controller that can be made again: {why}") from error


def _mjcf(arm: RobotDescription) -> str:
    try:
        return arm.mjcf.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"The MJCF file {arm.mjcf} cannot be copied into the recording: {error}") from error


def _model(record: _KeptRun) -> RobotModel:
    """Make the arm: on the MJCF file of this installation if that says the same, otherwise on the recorded one."""
    folder = FilePath(mkdtemp(prefix="pretouch-"))
    try:
        (folder / FILE).write_text(record.robot, encoding="utf-8")
        (folder / _MJCF).write_text(record.arm, encoding="utf-8")
        arm = load_description(folder)
        for installed in (panda().mjcf, fr3().mjcf):
            if installed.read_text(encoding="utf-8") == record.arm:
                arm = replace(arm, mjcf=installed)
        model = RobotModel(arm)
    except BaseException:
        rmtree(folder)
        raise
    finalize(model, rmtree, folder, ignore_errors=True)  # whoever has the model may read its file
    return model


def _unit(record: _KeptUnit) -> SensorUnit:
    return SensorUnit(**vars(record) | {"sensor": from_table(Sensor, record.sensor, "sensor")})


def _kept_path(path: Path) -> _KeptPath:
    if type(path) is Circle:
        numbers = np.array([*path.center, path.radius, path.start_angle], dtype=np.float64)
    elif type(path) is WayPoints:
        numbers = path.points
    else:
        phases = np.linspace(0.0, path.length, _SAMPLES, endpoint=not path.closed)
        points = np.array([path.point(phase) for phase in phases.tolist()], dtype=np.float64)
        numbers = points[np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=1) > _APART_M)]
        if len(numbers) == 1:  # it stands: a millimetre is drawn
            numbers = numbers + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-3]])
    return _KeptPath(type(path).__name__, numbers, bool(path.closed))


def _path(record: _KeptPath) -> Path:
    if record.kind == "Circle":
        x, y, z, radius, start_angle = record.numbers.tolist()
        return Circle((x, y, z), radius, start_angle)
    return WayPoints(record.numbers, record.closed)
