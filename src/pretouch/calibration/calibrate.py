"""From measured joint positions and IMU data to where each unit sits: one straight line."""

import numpy as np

from pretouch.calibration.arm_findings import clocks_apart, little_used
from pretouch.calibration.data import CalibrationData, UnitData
from pretouch.calibration.findings import end_finding, error_findings, share_findings, unknown_finding
from pretouch.calibration.identify import Identified, Identifier
from pretouch.calibration.joint_checks import check_known, checked_joints, held, moved_joints, standing_joints
from pretouch.calibration.joint_noise import JointNoise
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import Located
from pretouch.calibration.misplaced import misplaced
from pretouch.calibration.mounting import likely_member, mounting_findings, seen_from
from pretouch.calibration.observability import Axis, Observability, observability
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Calibration, Finding, Place, UnitCalibration
from pretouch.calibration.unit_checks import checked_unit
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


def calibrate(model: RobotModel, data: CalibrationData, params: CalibrationParams | None = None) -> Calibration:
    """Find where each unit sits, and say what is wrong with its data.

    Raises:
        CalibrationError: nothing can be made from the joints' data, or two units have the same id.
        RobotModelError: the arm has no link that a unit is said to sit on.
    """
    params = params or CalibrationParams()
    _check_ids(data.units)
    joints, notes = checked_joints(model, data.joints, params)
    moved = moved_joints(joints, params)
    joints = held(joints, moved)
    arm = ArmMotion(model, joints, params)
    check_known(arm, params)
    notes += (*standing_joints(model, moved), *little_used(arm))
    identifier = Identifier(arm, params)
    found = {unit.id: _identified(identifier, unit, params) for unit in data.units}
    wrong = misplaced(model, {unit.id: unit.link for unit in data.units}, found)
    noise = JointNoise(arm, joints, params)
    units = tuple(_settled(arm, noise, unit, found[unit.id], wrong.get(unit.id), params) for unit in data.units)
    return Calibration(units, (*notes, *clocks_apart(units, params)), float(np.deg2rad(params.board_misalignment_deg)))


def _check_ids(units: tuple[UnitData, ...]) -> None:
    ids = [unit.id for unit in units]
    twice = sorted({i for i in ids if ids.count(i) > 1})
    if twice:
        raise CalibrationError(f"The unit id {', '.join(twice)} is used more than once: give each unit its own id.")


def _identified(identifier: Identifier, unit: UnitData, params: CalibrationParams) -> Identified:
    clean, findings = checked_unit(unit, params)
    if any(finding.refused for finding in findings):
        return Identified(findings=findings)
    found = identifier.identify(clean)
    found.findings[:0] = findings
    return found


def _settled(
    arm: ArmMotion,
    noise: JointNoise,
    unit: UnitData,
    found: Identified,
    wrong: Finding | None,
    params: CalibrationParams,
) -> UnitCalibration:
    findings = [*([wrong] if wrong else []), *found.findings]
    if found.located is None:
        return UnitCalibration(unit.id, None, tuple(findings))
    located, model = found.located, arm.model
    doubts = _doubts(arm, located, params)
    link = located.link
    if unit.link is None or wrong:
        link = likely_member(model, found.body, link, located.pose)
    T, covariance = seen_from(model, link, located.link, located.pose, noise.covariance(located))
    known = _observability(arm, link, T, covariance, params)
    if not any(doubt.refused for doubt in doubts):
        bare = _observability(arm, link, T, seen_from(model, link, located.link, T, located.covariance)[1], params)
        hiding = None if bare.unknown else noise.acceleration
        doubts += unknown_finding(arm, link, known, hiding, params) or mounting_findings(model, link, T)
    return UnitCalibration(unit.id, _place(arm, located, link, T, covariance), (*findings, *doubts), known)


def _doubts(arm: ArmMotion, located: Located, params: CalibrationParams) -> list[Finding]:
    """Say why a place may not be trusted, other than where it is."""
    findings = share_findings(arm, located, params)
    if (at_end := end_finding(arm, located)) is not None:
        findings = [at_end, *(finding for finding in findings if finding.kind != "outliers")]
    return [*findings, *error_findings(located, params)]


def _observability(
    arm: ArmMotion, link: int, T: FloatArray, covariance: FloatArray, params: CalibrationParams
) -> Observability:
    model = arm.model
    kin = model.kinematics(model.q_mid)
    joint = int(np.flatnonzero(model.moved_by[link])[-1])
    R = kin.rotation[link]
    axis = Axis(model.joints[joint], R.T @ (kin.anchor[joint] - kin.position[link]), R.T @ kin.axis[joint])
    return observability(covariance, T, axis, params)


def _place(arm: ArmMotion, located: Located, link: int, T: FloatArray, covariance: FloatArray) -> Place:
    e = located.estimate
    return Place(
        link=arm.model.links[link],
        T_link_sensor=T,
        covariance=covariance,
        acceleration_bias=e.acceleration_bias,
        angular_velocity_bias=e.angular_velocity_bias,
        acceleration_scale=e.acceleration_scale,
        angular_velocity_scale=e.angular_velocity_scale,
        clock_offset=located.late,
        acceleration_residual=float(located.noise[3]),
        angular_velocity_residual=float(located.noise[0]),
        used=float(located.used.mean()),
    )
