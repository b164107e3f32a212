"""What `pretouch skin calibrate --recording` does: from what was recorded to a skin file."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.data import CalibrationData, UnitData
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Calibration
from pretouch.calibration.stamps import instants, retimed
from pretouch.cli.calibrate.answer import Answer, give
from pretouch.cli.calibrate.outputs import Outputs
from pretouch.cli.detect_words import sentences
from pretouch.errors import CalibrationError
from pretouch.imported_data.log import TABLES
from pretouch.imported_data.reading import read_joints
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, load_skin
from pretouch.traces import ImuTrace, JointTrace
from pretouch.units.skin_reader import SkinTrace, UnitTrace, read_skin

_NO_IMU = ImuTrace(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


@dataclass(frozen=True)
class Sources:
    """What a calibration is made from."""

    recording: Path
    """Of the units."""
    joints: Path | None = None
    """Of the joint states, if another one has them, on a clock of its own."""
    topic: str = ""
    """Topic of the joint states there."""
    skin: Path | None = None
    """The skin file as it is believed to be."""


def calibrate_recording(model: RobotModel, sources: Sources, outputs: Outputs) -> int:
    """Calibrate from recordings, show and write the answer; return 1 if a unit was refused, or else 0."""
    if sources.recording.suffix.lower() in TABLES:
        raise CalibrationError(
            f"{sources.recording} is a table, not a recording of units: give the recording with --recording, and joint"
            " states with --joints."
        )
    believed = load_skin(sources.skin, model) if sources.skin else None
    whole = read_skin(sources.recording)
    measured = replace(whole, units={name: unit for name, unit in whole.units.items() if len(unit.imu.stamp)})
    joints, notes = _joints(model, measured, sources)
    if not measured.complete:
        notes = [f"{sources.recording} is incomplete or damaged: the readable part is used.", *notes]
    data = CalibrationData(joints, _units(measured, believed))
    if not data.units:
        raise CalibrationError(
            f"{sources.recording} holds no IMU data: record units that have an IMU by `pretouch skin monitor --record`."
        )
    if believed:
        notes += _differences(measured, believed, sources.skin)
    found, ahead, told_by = aligned(model, data) if sources.joints else (calibrate(model, data), 0.0, ())
    if sources.joints and np.isfinite(ahead):
        way = "ahead of" if ahead > 0 else "behind"
        notes.append(f"The clock of {sources.recording} is {abs(ahead):.3f} s {way} that of {sources.joints}.")
        if len(told_by) == 1:
            notes.append(f"Only {told_by[0]} shows this: no other unit agrees with it, and all poses depend on it.")
    return give(Answer(model, found, believed, ahead, tuple(notes)), outputs)


def _joints(model: RobotModel, measured: SkinTrace, sources: Sources) -> tuple[JointTrace, list[str]]:
    """Return the joint positions in the order of the model, and what is to be said of them."""
    if sources.joints:
        trace, log = read_joints(sources.joints, model, sources.topic)
        return trace, [f"Joint states are {log.sources['q']} of {sources.joints}.", *sentences(log.notes)]
    if sources.topic:
        raise CalibrationError("--topic needs --joints: it names a topic of that file.")
    if measured.joints is None:
        raise CalibrationError(
            f"{sources.recording} has no joint states: give the file that has them with --joints, or let"
            " `pretouch skin calibrate NAME` move the arm."
        )
    missing = [name for name in model.joints if name not in measured.joint_names]
    if missing:
        raise CalibrationError(
            f"{sources.recording} has no states of {', '.join(missing)} (it has {', '.join(measured.joint_names)}):"
            " give the arm they are of with --arm."
        )
    order = [measured.joint_names.index(name) for name in model.joints]
    return JointTrace(measured.joints.stamp, measured.joints.q[:, order]), []


def _units(measured: SkinTrace, believed: Skin | None) -> tuple[UnitData, ...]:
    """Return the units of the skin in its order, then others that were heard; a link that nobody names is None."""
    links = {unit.id: unit.link for unit in believed.units} if believed else {}
    names = dict.fromkeys((*links, *measured.units))
    return tuple(_unit(name, measured.units.get(name), links.get(name)) for name in names)


def _unit(name: str, measured: UnitTrace | None, link: str | None) -> UnitData:
    if measured is None:
        return UnitData(name, _NO_IMU, link)
    c = measured.counters
    imu = retimed(measured.imu, instants(c.index, c.count, c.time_us, c.imu_age_us, c.offset, c.bound))
    return UnitData(name, imu, link, measured.acceleration_max, measured.angular_velocity_max)


def _differences(measured: SkinTrace, believed: Skin, place: Path | None) -> list[str]:
    """Say which units were heard that the skin does not name."""
    others = [name for name in measured.units if name not in believed.ids]
    return [f"{place} does not name {', '.join(others)}: their links are found."] if others else []


def aligned(model: RobotModel, data: CalibrationData) -> tuple[Calibration, float, tuple[str, ...]]:
    """Calibrate where joints and units have different clocks.

    All units were recorded by one clock: the offset on which two of them agree is taken for all, or else that of the
    first which tells one. Returned too are by how much the units' clock is ahead [s], NaN where no unit tells it, and
    the names of the units that told it.
    """
    ahead, told_by = _ahead(model, data)
    late = ahead if np.isfinite(ahead) else 0.0
    units = tuple(replace(unit, imu=replace(unit.imu, stamp=unit.imu.stamp - late)) for unit in data.units)
    return calibrate(model, replace(data, units=units)), ahead, told_by


def _ahead(model: RobotModel, data: CalibrationData) -> tuple[float, tuple[str, ...]]:
    offsets: dict[str, float] = {}
    for unit in data.units:
        found = calibrate(model, replace(data, units=(unit,))).units[0]
        # one whose clock is far off is refused for that, but by how much is found
        if found.place is None or any(finding.refused and finding.kind != "clock" for finding in found.findings):
            continue
        offset = found.place.clock_offset
        for name, other in offsets.items():
            if abs(offset - other) < CalibrationParams().clock_error_s:
                return offset, (name, unit.id)
        offsets[unit.id] = offset
    return next(((offset, (name,)) for name, offset in offsets.items()), (np.nan, ()))
