"""How far an answer is from where a unit truly sits, and how far it says it may be."""

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.calibration.findings import seen_from
from pretouch.calibration.values import Place
from pretouch.robot.model import RobotModel
from pretouch.sensing.unit import SensorUnit
from pretouch.types import FloatArray
from pretouch_lab.run import Row

_TURN, _SHIFT = slice(0, 3), slice(3, 6)


def pose_error(true: FloatArray, found: FloatArray) -> FloatArray:
    """Error (6,) of a pose (4, 4): rotation vector in the found frame [rad], position in the link frame [m]."""
    turn = Rotation.from_matrix(found[:3, :3].T @ true[:3, :3]).as_rotvec()
    return np.concatenate([turn, true[:3, 3] - found[:3, 3]])


def error_row(error: FloatArray) -> Row:
    """Return the sizes of an error (6,) of `pose_error`."""
    return {
        "position_error_m": float(np.linalg.norm(error[_SHIFT])),
        "orientation_error_deg": float(np.degrees(np.linalg.norm(error[_TURN]))),
    }


NOT_FOUND: Row = dict.fromkeys((
    "position_error_m", "orientation_error_deg", "position_sigma_m", "orientation_sigma_deg", "nees_position",
    "nees_orientation", "nees_pose", "clock_error_s",
)) | {"link_found": False}  # fmt: skip
"""Of a unit without an answer, or with one on another link."""


def place_row(model: RobotModel, unit: SensorUnit, place: Place, late: float) -> Row:
    """Compare a calibration's answer with the truth.

    Args:
        model: the arm.
        unit: as it truly sits.
        place: the answer. A link that is fixed to the true one is as good as that: no motion can tell them apart.
        late: by how much the unit's stamps truly are late [s].

    Returns:
        Errors, standard deviations, and errors squared and divided by the covariance, whose mean is to be the number of
        their dimensions: 3 of the position, 3 of the orientation, 6 of both.
    """
    true, found = (model.link_index(name) for name in (unit.link, place.link))
    same = bool(np.array_equal(model.moved_by[true], model.moved_by[found]))
    if not same:
        return NOT_FOUND
    here, covariance = seen_from(model, true, found, place.T_link_sensor, place.covariance)
    error = pose_error(unit.T_link_sensor, here)
    return error_row(error) | {
        "position_sigma_m": place.position_sigma,
        "orientation_sigma_deg": float(np.degrees(place.orientation_sigma)),
        "nees_position": _normalised(error, covariance, _SHIFT),
        "nees_orientation": _normalised(error, covariance, _TURN),
        "nees_pose": _normalised(error, covariance, slice(0, 6)),
        "clock_error_s": place.clock_offset - late,
        "link_found": True,
    }  # fmt: skip


def _normalised(error: FloatArray, covariance: FloatArray, part: slice) -> float:
    return float(error[part] @ np.linalg.solve(covariance[part, part], error[part]))
