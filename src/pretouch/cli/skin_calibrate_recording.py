"""What `pretouch skin calibrate --recording` does: from what was recorded to a skin file."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.data import CalibrationData, UnitData
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Calibration
from pretouch.calibration.stamps import instants, retimed
from pretouch.cli.skin_calibrate_files import Outputs
from pretouch.cli.skin_calibrate_result import Answer, give
from pretouch.errors import CalibrationError
from pretouch.foreign.joints import read_joints
from pretouch.recording.calibration_data import Measured, MeasuredUnit, read_measured
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, load_skin
from pretouch.traces import ImuTrace, JointTrace

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
    believed = load_skin(sources.skin, model) if sources.skin else None
    measured = read_measured(sources.recording)
    joints, notes = _joints(model, measured, sources)
    if not measured.complete:
        notes = [f"{sources.recording} was not ended in order: what it holds is used.", *notes]
    data = CalibrationData(joints, _units(measured, believed))
    if not data.units:
        raise CalibrationError(
            f"{sources.recording} holds no IMU data: record units that have an IMU, or see `pretouch skin monitor`."
        )
    if believed:
        notes += _differences(measured, believed, sources.skin)
    found, ahead = aligned(model, data) if sources.joints else (calibrate(model, data), 0.0)
    if sources.joints and np.isfinite(ahead):
        way = "ahead of" if ahead > 0 else "behind"
        notes.append(f"The clock of {sources.recording} is {abs(ahead):.3f} s {way} that of {sources.joints}.")
    return give(Answer(model, found, believed, ahead, tuple(notes)), outputs)


def _joints(model: RobotModel, measured: Measured, sources: Sources) -> tuple[JointTrace, list[str]]:
    """Return the joint positions in the order of the model, and what is to be said of them."""
    if sources.joints:
        read = read_joints(sources.joints, model, sources.topic)
        return read.trace, [f"Joint states are {read.said} of {sources.joints}.", *read.notes]
    if sources.topic:
        raise CalibrationError("A --topic needs --joints: it is one of that file.")
    if measured.joints is None:
        raise CalibrationError(
            f"{sources.recording} has no joint states: give the file that has them with --joints, or let the arm"
            " make the motion by --robot."
        )
    missing = [name for name in model.joints if name not in measured.joint_names]
    if missing:
        raise CalibrationError(
            f"{sources.recording} has no states of {', '.join(missing)} (it has {', '.join(measured.joint_names)}):"
            " give the arm they are of with --arm."
        )
    order = [measured.joint_names.index(name) for name in model.joints]
    return JointTrace(measured.joints.stamp, measured.joints.q[:, order]), []


def _units(measured: Measured, believed: Skin | None) -> tuple[UnitData, ...]:
    """Return the units of the skin in its order, then others that were heard; a link that nobody names is None."""
    links = {unit.id: unit.link for unit in believed.units} if believed else {}
    names = dict.fromkeys((*links, *measured.units))
    return tuple(_unit(name, measured.units.get(name), links.get(name)) for name in names)


def _unit(name: str, measured: MeasuredUnit | None, link: str | None) -> UnitData:
    if measured is None:
        return UnitData(name, _NO_IMU, link)
    imu, c = measured.imu, measured.counters
    if c is not None:
        found = instants(c.index, c.count, c.time_us, c.imu_age_us, c.offset, c.bound)
        imu = retimed(imu, found.instant)
    return UnitData(name, imu, link, measured.acceleration_max, measured.angular_velocity_max)


def _differences(measured: Measured, believed: Skin, place: Path | None) -> list[str]:
    """Say which units were heard that the skin does not name."""
    others = [name for name in measured.units if name not in believed.ids]
    return [f"{place} does not name {', '.join(others)}: their links are found."] if others else []


def aligned(model: RobotModel, data: CalibrationData) -> tuple[Calibration, float]:
    """Calibrate where joints and units have different clocks; return too by how much the units' is ahead [s].

    All units were recorded by one clock: the offset on which two of them agree is taken for all. Where no unit tells
    it, it is NaN.
    """
    ahead = _ahead(model, data)
    late = ahead if np.isfinite(ahead) else 0.0
    units = tuple(replace(unit, imu=replace(unit.imu, stamp=unit.imu.stamp - late)) for unit in data.units)
    return calibrate(model, replace(data, units=units)), ahead


def _ahead(model: RobotModel, data: CalibrationData) -> float:
    offsets: list[float] = []
    for unit in data.units:
        found = calibrate(model, replace(data, units=(unit,))).units[0]
        # one whose clock is far off is refused for that, but by how much is found
        if found.place is None or any(finding.refused and finding.kind != "clock" for finding in found.findings):
            continue
        offset = found.place.clock_offset
        if any(abs(offset - other) < CalibrationParams().clock_error_s for other in offsets):
            return offset
        offsets.append(offset)
    return offsets[0] if offsets else np.nan
