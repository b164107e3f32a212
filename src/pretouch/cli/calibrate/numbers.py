"""A calibration as JSON has it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.calibration.observability import Observability
from pretouch.calibration.result import Calibration, Finding, Place, UnitCalibration
from pretouch.robot.model import RobotModel


def numbers(model: RobotModel, calibration: Calibration, clock_ahead: float, notes: Sequence[str]) -> dict[str, Any]:
    """Return all numbers of a calibration; what is not finite is None."""
    told = {
        "arm": model.description.name,
        "clock_ahead_s": clock_ahead,
        "board_misalignment_sigma_rad": calibration.orientation_floor,
        "notes": list(notes),
        "units": [_unit(unit) for unit in calibration.units],
        "findings": [_finding(finding) for finding in calibration.findings],
    }
    plain: dict[str, Any] = _plain(told)
    return plain


def _unit(unit: UnitCalibration) -> dict[str, Any]:
    return {
        "unit": unit.id,
        "accepted": unit.accepted,
        "place": None if unit.place is None else _place(unit.place),
        "observability": None if unit.observability is None else _observability(unit.observability),
        "findings": [_finding(finding) for finding in unit.findings],
    }


def _place(place: Place) -> dict[str, Any]:
    return {
        "link": place.link,
        "position_m": place.T_link_sensor[:3, 3],
        "quaternion_wxyz": Rotation.from_matrix(place.T_link_sensor[:3, :3]).as_quat(canonical=True, scalar_first=True),
        "covariance": place.covariance,
        "position_sigma_m": place.position_sigma,
        "orientation_sigma_rad": place.orientation_sigma,
        "acceleration_bias_m_s2": place.acceleration_bias,
        "angular_velocity_bias_rad_s": place.angular_velocity_bias,
        "acceleration_scale_error": place.acceleration_scale,
        "angular_velocity_scale_error": place.angular_velocity_scale,
        "clock_offset_s": place.clock_offset,
        "acceleration_residual_m_s2": place.acceleration_residual,
        "angular_velocity_residual_rad_s": place.angular_velocity_residual,
        "used": place.used,
    }


def _observability(seen: Observability) -> dict[str, Any]:
    return {
        "position_directions": seen.position_directions,
        "position_sigma_m": seen.position_sigma,
        "orientation_axes": seen.orientation_axes,
        "orientation_sigma_rad": seen.orientation_sigma,
        "unknown": seen.unknown,
        "known": seen.known,
    }


def _finding(finding: Finding) -> dict[str, Any]:
    return {"kind": finding.kind, "sentence": finding.sentence, "refused": finding.refused}


def _plain(value: Any) -> Any:
    """Return arrays as lists, and numbers that are not finite as None."""
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
