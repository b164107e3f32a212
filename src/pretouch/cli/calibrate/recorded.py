"""Calibration from a recording of a moving arm: table, sentences, skin file, numbers."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from pretouch.calibration.calibrate import calibrate, skin_of
from pretouch.calibration.stamps import by_time
from pretouch.calibration.values import CLOCK_ERROR_S, Calibration, CalibrationData, UnitCalibration, UnitData
from pretouch.cli.detect_words import sentences
from pretouch.cli.options import JsonFile, OptionalFile
from pretouch.cli.tables import PlainTable
from pretouch.cli.writing import check_outputs, plain, same_file
from pretouch.errors import CalibrationError
from pretouch.imported_data.log import TABLES, Choice
from pretouch.imported_data.reading import open_log, read_joints
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, load_skin, save_skin
from pretouch.traces import ImuTrace, JointTrace
from pretouch.units.skin_recording import SkinTrace, read_skin

_NO_IMU = ImuTrace(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
_COLUMNS = (
    "unit",
    "link",
    "position\n[mm]",
    "sigma\n[mm]",
    "sigma\n[deg]",
    "clock\n[ms]",
    "residual\n[m/s^2]",
    "verdict",
)
_TEXT = (0, 1, 7)
"""Columns that hold no numbers."""


@dataclass(frozen=True)
class CalibrateRecording:
    """Calibrate from a recording of a calibration motion."""

    recording: OptionalFile = None
    """Recording of the units, by `pretouch skin monitor --record` or by `pretouch skin calibrate NAME`."""
    joints: OptionalFile = None
    """Joint states, if they are not in the recording: a CSV file (time_s,q1_rad,...), an MCAP file or a bag, with any
    clock."""
    topic: str = ""
    """Topic of the joint states in that file, if there are several."""


@dataclass(frozen=True)
class CalibrationFiles:
    """Files that a calibration reads and writes beside the recording."""

    skin: OptionalFile = None
    """Skin file with the units and their assumed links, which are checked; without it, links are identified. Of an arm
    that moves, the seven units that come with the package are heard then."""
    out: OptionalFile = None
    """Skin file to write, with places and their uncertainty. Refused units are as in --skin, or left out."""
    json: JsonFile = None
    replace: bool = False
    """Overwrite existing files."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""

    def check(self, inputs: Iterable[Path | None], record: Path | None = None) -> None:
        """Refuse a file that could not be written, or is another input or output too; --out may be --skin."""
        if record and record.exists():  # whatever --replace says: a recording is never written over
            raise CalibrationError(f"The recording {record} exists already: give another file to --record.")
        read = [*inputs, *([] if self.skin and self.out and same_file(self.skin, self.out) else [self.skin])]
        check_outputs([("skin file", self.out), ("file", self.json), ("recording", record)], read, self.replace)


def calibrate_recorded(
    model: RobotModel, recorded: CalibrateRecording, files: CalibrationFiles, write: Callable[[Any], None]
) -> int:
    """Calibrate from recordings, show the answer and `write` it; return 1 if a unit was refused, or else 0."""
    recording = recorded.recording or Path()
    if recording.suffix.lower() in TABLES:
        raise CalibrationError(
            f"{recording} is a table, not a recording of units: give the recording with --recording, and joint states"
            " with --joints."
        )
    believed = load_skin(files.skin, model) if files.skin else None
    measured = read_skin(recording)
    joints, notes = _joints(model, recorded)
    if not measured.complete:
        notes = [f"{recording} is incomplete or damaged: the readable part is used.", *notes]
    undated = {name: int(np.isnan(unit.imu.stamp).sum()) for name, unit in measured.units.items()}
    if texts := ", ".join(f"{name} {count}" for name, count in undated.items() if count):
        notes.append(f"IMU samples whose time is not known, as before a unit's clock is, are left out: {texts}.")
    data = CalibrationData(joints, _units(measured, believed))
    if not data.units:
        raise CalibrationError(
            f"{recording} holds no IMU data: record units that have an IMU by `pretouch skin monitor --record`."
        )
    others = [unit.id for unit in data.units if believed and unit.id not in believed.ids]
    if others:
        notes.append(f"{files.skin} does not name {', '.join(others)}: their links are found.")
    answer, ahead, witnesses = aligned(model, data) if recorded.joints else (calibrate(model, data), 0.0, ())
    if recorded.joints and np.isfinite(ahead):
        way = "ahead of" if ahead > 0 else "behind"
        notes.append(f"The clock of {recording} is {abs(ahead):.3f} s {way} that of {recorded.joints}.")
        if len(witnesses) == 1:
            notes.append(f"Only {witnesses[0]} shows this: no other unit agrees with it, and all poses depend on it.")
    notes += [finding.sentence for finding in answer.findings]
    console = Console(highlight=False)
    _show(console, answer, notes)
    write({"arm": model.description.name, "clock_ahead_s": ahead, "notes": notes} | plain(answer))
    if files.out:
        console.print(_written(answer, model, believed, files.out), soft_wrap=True, markup=False)
    return int(not all(unit.accepted for unit in answer.units))


def _joints(model: RobotModel, recorded: CalibrateRecording) -> tuple[JointTrace, list[str]]:
    """Return the joint positions in the order of the model, and what is to be said of them."""
    place = recorded.joints or recorded.recording or Path()
    if recorded.joints is None and recorded.topic:
        raise CalibrationError("--topic needs --joints: it names a topic of that file.")
    if recorded.joints is None and "q" not in open_log(place, Choice(arm=model)).kinds:
        raise CalibrationError(
            f"{place} has no joint states: give the file that has them with --joints, or let `pretouch skin calibrate"
            " NAME` move the arm."
        )
    trace, log = read_joints(place, model, recorded.topic)
    return trace, [f"Joint states are {log.sources['q']} of {place}.", *sentences(log.notes)]


def _units(measured: SkinTrace, believed: Skin | None) -> tuple[UnitData, ...]:
    """Return the units of the skin in its order, then others that have an IMU; a link that nobody names is None."""
    links = {unit.id: unit.link for unit in believed.units} if believed else {}
    traces = {name: unit for name, unit in measured.units.items() if len(unit.imu.stamp)}
    units = []
    for name in dict.fromkeys((*links, *traces)):
        if name not in traces:
            units.append(UnitData(name, _NO_IMU, links.get(name)))
            continue
        unit = traces[name]
        imu = by_time(unit.imu)
        units.append(UnitData(name, imu, links.get(name), unit.acceleration_max, unit.angular_velocity_max))
    return tuple(units)


def aligned(model: RobotModel, data: CalibrationData) -> tuple[Calibration, float, tuple[str, ...]]:
    """Calibrate where joints and units have different clocks.

    All units were recorded by one clock: the offset on which two of them agree is taken for all, or else that of the
    first which tells one. Returned too are by how much the units' clock is ahead [s], NaN where no unit tells it, and
    the names of the units that tell it.
    """
    ahead, witnesses = _ahead(model, data)
    late = ahead if np.isfinite(ahead) else 0.0
    units = tuple(replace(unit, imu=replace(unit.imu, stamp=unit.imu.stamp - late)) for unit in data.units)
    return calibrate(model, replace(data, units=units)), ahead, witnesses


def _ahead(model: RobotModel, data: CalibrationData) -> tuple[float, tuple[str, ...]]:
    offsets: dict[str, float] = {}
    for unit in data.units:
        answer = calibrate(model, replace(data, units=(unit,))).units[0]
        # one whose clock is far off is refused for that, but by how much is found
        if answer.place is None or any(finding.refused and finding.kind != "clock" for finding in answer.findings):
            continue
        offset = answer.place.clock_offset
        for name, other in offsets.items():
            if abs(offset - other) < CLOCK_ERROR_S:
                return offset, (name, unit.id)
        offsets[unit.id] = offset
    return next(((offset, (name,)) for name, offset in offsets.items()), (np.nan, ()))


def _show(console: Console, answer: Calibration, notes: list[str]) -> None:
    """Print a table of the units, and the findings on the data and each unit, refused ones first."""
    styles = ["bold red" if not unit.accepted else "yellow" if unit.findings else "" for unit in answer.units]
    console.print(PlainTable(_COLUMNS, [_cells(unit) for unit in answer.units], _TEXT, styles), crop=False)
    for unit in sorted(answer.units, key=lambda unit: unit.accepted):
        notes = [*notes, *(f"{unit.id}{' is refused' * one.refused}: {one.sentence}" for one in unit.findings)]
    for sentence in notes:
        console.print(sentence, soft_wrap=True, markup=False)


def _cells(unit: UnitCalibration) -> tuple[str, ...]:
    place, verdict = unit.place, "good" if unit.accepted else "refused"
    if place is None:
        return unit.id, *("-" for _ in _COLUMNS[2:]), verdict
    return (
        unit.id,
        place.link,
        " ".join(f"{1000 * value:.1f}" for value in place.T_link_sensor[:3, 3]),
        f"{1000 * place.position_sigma:.2f}",
        f"{np.rad2deg(place.orientation_sigma):.3f}",
        f"{1000 * place.clock_offset:.2f}",
        f"{place.acceleration_residual:.3f}",
        verdict,
    )


def _written(answer: Calibration, model: RobotModel, believed: Skin | None, out: Path) -> str:
    """Write the skin file, and return a sentence on it."""
    try:
        skin = skin_of(answer, model, believed)
    except CalibrationError as error:
        return f"{error} {out} is not written."
    save_skin(skin, out)
    ids, located = [unit.id for unit in skin.mounted], [unit.id for unit in answer.units if unit.accepted]
    parts = [f"Skin file: {out} has {len(located)} units where they were found."]
    if unlocated := [name for name in ids if name not in located]:
        parts.append(f"Kept as before, without calibration: {', '.join(unlocated)}.")
    if left_out := [unit.id for unit in answer.units if unit.id not in ids]:
        parts.append(f"Left out: {', '.join(left_out)}.")
    return " ".join(parts)
