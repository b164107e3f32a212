"""Calibration in one line: joint positions and IMU data to the pose of each unit, and to a skin."""

from dataclasses import replace

import numpy as np

from pretouch.calibration.checks import checked_joints, checked_unit
from pretouch.calibration.findings import (
    likely_member,
    mounting_findings,
    moved_out,
    scale_findings,
    seen_from,
    share_findings,
    unknown_finding,
)
from pretouch.calibration.fit import ACC_BIAS, ACC_SCALE, GYRO_BIAS, GYRO_SCALE
from pretouch.calibration.identify import Identified, Identifier
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import JointNoise, Located
from pretouch.calibration.values import Calibration, CalibrationData, Place, Remark, UnitCalibration, UnitData
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import LARGEST_ORIENTATION_SIGMA, LARGEST_POSITION_SIGMA, SensorUnit
from pretouch.types import FloatArray

BOARD_MISALIGNMENT_DEG = 0.29
"""Standard deviation of the angle between the IMU's axes and the range finder's [degrees], which no IMU can tell;
added to what a skin file says of an orientation. Up to half a degree either way: how well a board is glued on."""


def calibrate(model: RobotModel, data: CalibrationData) -> Calibration:
    """Find where each unit sits, and say what is wrong with its data.

    Raises:
        CalibrationError: nothing can be made from the joints' data, or two units have the same id.
        RobotModelError: the arm has no link that a unit is said to sit on.
    """
    ids = [unit.id for unit in data.units]
    if twice := sorted({i for i in ids if ids.count(i) > 1}):
        raise CalibrationError(f"The unit id {', '.join(twice)} is used more than once: give each unit its own id.")
    joints, notes = checked_joints(model, data.joints)
    arm = ArmMotion(model, joints)
    identifier, noise = Identifier(arm), JointNoise(arm, joints)
    units = tuple(_calibrated(identifier, noise, unit) for unit in data.units)
    return Calibration(units, notes)


def _calibrated(identifier: Identifier, noise: JointNoise, unit: UnitData) -> UnitCalibration:
    """Find where one unit sits, if its data pass all checks of their own."""
    arm, model = identifier.arm, identifier.arm.model
    clean, findings = checked_unit(unit)
    if any(finding.refused for finding in findings):
        return UnitCalibration(unit.id, None, tuple(findings))
    identified = identifier.identify(clean)
    wrong = _wrong_link(model, unit, identified)
    findings = [*wrong, *findings, *identified.findings]
    located = identified.located
    if located is None:
        return UnitCalibration(unit.id, None, tuple(findings))
    link = located.link
    if unit.link is None or wrong:
        link = likely_member(model, identified.body, link, located.pose)
    T, covariance = seen_from(model, link, located.link, located.pose, noise.covariance(located))
    doubts = [*share_findings(arm, located), *scale_findings(located)]
    if not any(doubt.refused for doubt in doubts):
        doubts += unknown_finding(arm, link, T, covariance) or mounting_findings(model, link, T)
    return UnitCalibration(unit.id, _place(model, located, link, T, covariance), (*findings, *doubts))


def _wrong_link(model: RobotModel, unit: UnitData, identified: Identified) -> list[Remark]:
    """Say which link the data of a unit fit that is said to sit on another one."""
    if unit.link is None or not identified.body or model.link_index(unit.link) in identified.body:
        return []
    covered = [link for link in identified.body if link in model.capsules.link]
    fitting = " or ".join(model.links[link] for link in covered or identified.body)
    sentence = f"It is said to sit on {unit.link}, but its data fit {fitting}: correct its link, or move it."
    return [Remark("wrong_link", sentence, True)]


def _place(model: RobotModel, located: Located, link: int, T: FloatArray, covariance: FloatArray) -> Place:
    errors = located.estimate.errors
    return Place(
        link=model.links[link],
        T_link_sensor=T,
        covariance=covariance,
        acceleration_bias=errors[ACC_BIAS],
        angular_velocity_bias=errors[GYRO_BIAS],
        acceleration_scale=errors[ACC_SCALE],
        angular_velocity_scale=errors[GYRO_SCALE],
        clock_offset=located.late,
        acceleration_residual=float(located.noise[3]),
        angular_velocity_residual=float(located.noise[0]),
        used=float(located.used.mean()),
    )


def skin_of(calibration: Calibration, model: RobotModel, keep: Skin | None = None) -> Skin:
    """Make a skin of all accepted units; the others stay as in the skin before, where it has them.

    Where a unit is says nothing of its sensors: they stay too. Raises CalibrationError if no unit was accepted.
    """
    units = {unit.id: unit for unit in keep.mounted} if keep else {}
    if not any(unit.accepted for unit in calibration.units):
        raise CalibrationError("No unit was located reliably, so no skin can be made: see the findings of each unit.")
    for unit in calibration.units:
        if unit.place and unit.accepted:
            new, old = _sensor_unit(unit.id, unit.place, model), units.get(unit.id)
            units[unit.id] = replace(new, touch=old.touch, sensor=old.sensor) if old else new
    return Skin(tuple(units.values()), model)


def _sensor_unit(name: str, place: Place, model: RobotModel) -> SensorUnit:
    """Return a unit of a skin; one that lies inside its link's capsules is moved out, as its findings say.

    Its orientation's standard deviation is about each axis: of the fit's worst one, and how well the board is glued on.
    """
    T, sigma = place.T_link_sensor.copy(), place.position_sigma
    outside = moved_out(model, model.link_index(place.link), T[:3, 3])
    if outside is not None:
        sigma = float(np.hypot(sigma, np.linalg.norm(outside - T[:3, 3])))
        T[:3, 3] = outside
    turned = float(np.hypot(place.orientation_sigma, np.deg2rad(BOARD_MISALIGNMENT_DEG)))
    return SensorUnit(name, place.link, T, min(sigma, LARGEST_POSITION_SIGMA), min(turned, LARGEST_ORIENTATION_SIGMA))
