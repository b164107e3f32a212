"""What made the steps of a recording: arm, skin, surroundings, path and parameters, to a message and back."""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path as FilePath
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any
from weakref import finalize

import numpy as np

from pretouch.composition import as_table, from_table
from pretouch.control.path import Circle, Path, WayPoints
from pretouch.controller import Controller
from pretouch.errors import PretouchError, RecordingError
from pretouch.perception.scene_filter import Fixtures
from pretouch.profiles import Profile
from pretouch.recording.messages import FORMAT, PACKAGE, decoded, encoded, make
from pretouch.recording.plain import JSON, as_json, from_json, sound
from pretouch.recording.versions import versions
from pretouch.robot.body import Capsules
from pretouch.robot.description import RobotDescription, SpeedEnvelope, fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit, TouchPatch
from pretouch.types import FloatArray

Tangents = dict[float, tuple[FloatArray, FloatArray]]
"""Point (3,) [m] and unit tangent (3,) of a path, by the arc length [m] of each step that followed it."""


class RecordedPath:
    """A path that is exact at each arc length that was followed, and elsewhere drawn through samples."""

    def __init__(self, samples: FloatArray, length: float, closed: bool, followed: Callable[[], Tangents]) -> None:
        """Take samples (S, 3) [m] at equal arc lengths, and where to find what was followed, once it is needed."""
        self.length, self.closed = length, closed
        self._samples, self._find = samples, followed

    @cached_property
    def _followed(self) -> Tangents:
        return self._find()

    def point(self, phase: float) -> FloatArray:
        """Return the position (3,) [m] at an arc length [m]."""
        found = self._followed.get(phase)
        return self._interpolated(phase) if found is None else found[0]

    def tangent(self, phase: float) -> FloatArray:
        """Return the unit tangent (3,) at an arc length [m]; zero where samples on either side coincide."""
        found = self._followed.get(phase)
        if found is not None:
            return found[1]
        step = self.length / (len(self._samples) - 1)
        along = self._interpolated(phase + step / 2) - self._interpolated(phase - step / 2)
        size = float(np.linalg.norm(along))
        return along / size if size else along

    def _interpolated(self, phase: float) -> FloatArray:
        s = phase % self.length if self.closed else min(max(phase, 0.0), self.length)
        places = np.linspace(0.0, self.length, len(self._samples))
        return np.array([np.interp(s, places, self._samples[:, i]) for i in range(3)])


RUN = f"{PACKAGE}/msg/Run"

_SAMPLES = 400
"""Points kept of a path whose class is not ours, to draw it by."""


@dataclass(frozen=True, eq=False)
class Run:
    """One controller that made steps of a recording."""

    sequence: int
    """Number of the first step it made."""
    versions: dict[str, str]
    """Program, libraries and machine it ran on."""
    started: float
    """When its first step was recorded [s since 1970, UTC]."""
    about: dict[str, JSON]
    """Whatever the caller said of the run."""
    profile: Profile
    _message: Any
    _tangents: Callable[[], Tangents]

    @cached_property
    def sizes(self) -> tuple[int, int]:
        """How many joints the arm has, and how many units the skin."""
        return sound(lambda: (len(from_json(self._message.robot)["q_ready"]), len(self._message.unit_id)))

    @cached_property
    def model(self) -> RobotModel:
        """The arm."""
        return sound(lambda: _model(self._message))

    @cached_property
    def skin(self) -> Skin:
        """The sensor units on it."""
        return sound(lambda: _skin(self._message, self.model))

    @cached_property
    def fixtures(self) -> Fixtures:
        """What stood around it."""
        return sound(lambda: _fixtures(self._message))

    @cached_property
    def path(self) -> Path:
        """The path it followed."""
        return sound(lambda: _path(self._message, self._tangents))

    def controller(self) -> Controller:
        """Make the controller again, on the model, skin, fixtures and path of this run."""
        return sound(lambda: Controller(self.model, self.skin, self.fixtures, self.path, self.profile))


def encode_run(sequence: int, controller: Controller, about: Mapping[str, JSON]) -> bytes:
    """Return what describes a controller as CDR. Facts that JSON cannot hold are a RecordingError."""
    model, skin, capsules = controller.model, controller.skin, controller.fixtures.capsules
    kind, numbers = _path_numbers(controller.path)
    return encoded(RUN, make(
        RUN, sequence, FORMAT, time.time(), as_json(versions()), as_json(dict(about)),
        as_json(as_table(controller.profile)), as_json(_description(model.description) | _units(skin)),
        _mjcf(model.description),
        list(skin.ids),
        [unit.link for unit in skin.units], skin.T_link_sensor.reshape(-1).copy(),
        controller.fixtures.planes.reshape(-1).copy(), _flat(capsules.a), _flat(capsules.b), _flat(capsules.radius),
        kind, numbers, float(controller.path.length), bool(controller.path.closed),
    ))  # fmt: skip


def decode_run(data: bytes, tangents: Callable[[int], Tangents]) -> Run:
    """Return what a Run message describes; `tangents` finds those kept with the steps from a number on."""
    m = decoded(RUN, data)
    if m.format > FORMAT:
        raise RecordingError(
            f"The recording has format {m.format}, but this version of pretouch reads up to {FORMAT}: open it with a"
            " later version."
        )
    profile = sound(lambda: from_table(Profile, from_json(m.profile)))
    return Run(
        m.sequence, from_json(m.versions), m.started, from_json(m.about), profile, m,
        lambda: tangents(m.sequence),
    )  # fmt: skip


_ARRAYS = ("qd_max", "qdd_max", "tau_max", "q_ready")
_ENVELOPE = ("offset", "slope", "q_upper", "q_lower")


def _description(arm: RobotDescription) -> dict[str, JSON]:
    described: dict[str, JSON] = {"name": arm.name, "ee_body": arm.ee_body, "source": arm.source, "envelope": None}
    described |= {name: getattr(arm, name) for name in _ARRAYS}
    if arm.envelope:
        described["envelope"] = {name: getattr(arm.envelope, name) for name in (*_ENVELOPE, "source")}
    return described


def _mjcf(arm: RobotDescription) -> str:
    try:
        return arm.mjcf.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"The MJCF file {arm.mjcf} cannot be copied into the recording: {error}") from error


def _model(m: Any) -> RobotModel:
    """Make the arm: from the file of this installation if that says the same, otherwise from the recorded one."""
    given = from_json(m.robot)
    arrays = {name: np.array(given[name], dtype=np.float64) for name in _ARRAYS}
    envelope = given["envelope"] and SpeedEnvelope(
        **{name: np.array(given["envelope"][name], dtype=np.float64) for name in _ENVELOPE},
        source=given["envelope"]["source"],
    )
    described = {"name": given["name"], "ee_body": given["ee_body"], "source": given["source"], **arrays}
    for installed in (panda().mjcf, fr3().mjcf):
        if installed.read_text(encoding="utf-8") == m.mjcf:
            return RobotModel(RobotDescription(mjcf=installed, envelope=envelope, **described))
    folder = FilePath(mkdtemp(prefix="pretouch-"))
    kept = folder / "arm.xml"
    kept.write_text(m.mjcf, encoding="utf-8")
    try:
        model = RobotModel(RobotDescription(mjcf=kept, envelope=envelope, **described))
    except PretouchError:
        rmtree(folder)
        raise
    finalize(model, rmtree, folder, ignore_errors=True)  # whoever has the model may read its file
    return model


_SIGMAS = "unit_sigma"


def _sigmas(skin: Skin) -> dict[str, JSON]:
    return {} if skin.exact else {_SIGMAS: [[unit.position_sigma, unit.orientation_sigma] for unit in skin.units]}


_TOUCH = "unit_touch"


def _touch(skin: Skin) -> dict[str, JSON]:
    """Describe the touch sensors of a skin, None for each unit without one; nothing where no unit has one."""
    return {_TOUCH: [None if u.touch is None else asdict(u.touch) for u in skin.units]} if len(skin.touching) else {}


_SENSOR, _ZONE = "unit_sensor", "unit_zone"


def _units(skin: Skin) -> dict[str, JSON]:
    """Describe what is not as usual of the units of a skin: uncertain places, touch sensors, types of sensor."""
    sensors = [unit.sensor for unit in skin.units]
    own = {_SENSOR: [as_table(sensor) for sensor in sensors]} if any(s != PAPER_SENSOR for s in sensors) else {}
    zones = [unit.zone for unit in skin.units]
    return _sigmas(skin) | _touch(skin) | own | ({} if all(z is None for z in zones) else {_ZONE: zones})


def _skin(m: Any, model: RobotModel) -> Skin:
    poses = m.unit_pose.reshape(-1, 4, 4)
    sigmas = from_json(m.robot).get(_SIGMAS, [[0.0, 0.0]] * len(poses))
    patches = from_json(m.robot).get(_TOUCH, [None] * len(poses))
    tables = from_json(m.robot).get(_SENSOR)
    sensors = [from_table(Sensor, table, "unit_sensor") for table in tables or []] or [PAPER_SENSOR] * len(poses)
    zones = from_json(m.robot).get(_ZONE, [None] * len(poses))
    units = zip(m.unit_id, m.unit_link, poses, sigmas, patches, sensors, zones, strict=True)
    return Skin(
        [
            SensorUnit(name, link, pose, at, turn, None if patch is None else TouchPatch(**patch), sensor, zone)
            for name, link, pose, (at, turn), patch, sensor, zone in units
        ],
        model,
    )


def _fixtures(m: Any) -> Fixtures:
    radius = m.capsule_radius.copy()
    a, b = m.capsule_a.reshape(-1, 3).copy(), m.capsule_b.reshape(-1, 3).copy()
    return Fixtures(m.planes.reshape(-1, 4), Capsules(np.zeros(len(radius), np.int64), a, b, radius))


def is_described(path: Path) -> bool:
    """Whether a Run message holds all of a path; of any other the steps keep where it led."""
    return type(path) in (Circle, WayPoints)


def _path_numbers(path: Path) -> tuple[str, FloatArray]:
    if type(path) is Circle:
        return "circle", np.array([*path.center, path.radius, path.start_angle], dtype=np.float64)
    if type(path) is WayPoints:
        return "way-points", path.points.reshape(-1)
    phases = np.linspace(0.0, path.length, _SAMPLES)
    return "recorded", np.array([path.point(phase) for phase in phases.tolist()], dtype=np.float64).reshape(-1)


def _path(m: Any, tangents: Callable[[], Tangents]) -> Path:
    numbers = m.path_numbers.tolist()
    if m.path == "circle":
        x, y, z, radius, start_angle = numbers
        return Circle((x, y, z), radius, start_angle)
    points = m.path_numbers.reshape(-1, 3)
    if m.path == "way-points":
        return WayPoints(points, m.path_closed)
    return RecordedPath(points.copy(), m.path_length, m.path_closed, tangents)


def _flat(array: FloatArray) -> FloatArray:
    return np.array(array, dtype=np.float64).reshape(-1)
