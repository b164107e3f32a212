"""What can be wrong with a recording of joint torques: sign and unit, as the arm's model tells them beyond doubt."""

from pathlib import Path

import numpy as np

from pretouch.errors import RecordingError
from pretouch.imported_data.observed import GRAVITY
from pretouch.imported_data.source import OUT_OF_RANGE_RAD
from pretouch.imported_data.velocities import velocities
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

_TURN_RAD = 7.0
"""More than a whole turn [rad]: beyond it positions may be in degrees."""
_MOVING_RAD_S = 0.01
"""Speed of a joint, root mean square, from which its velocity tells something [rad/s]."""
_ALIKE, _UNLIKE = 0.9, 0.5
"""Correlation from which on, and below which, two velocities are taken to be the same, or not."""
_FAR_BETTER = 0.25
"""Part of the squared error that another explanation may leave to be believed [1]."""
_SAMPLES = 400
"""How many samples are looked at."""
_THOUSAND = (300.0, 3000.0)


def check_positions(place: Path, q: FloatArray, model: RobotModel) -> None:
    """Refuse positions (N, n) [rad] out of the arm's range that are within it as degrees."""
    low, high = model.q_min - OUT_OF_RANGE_RAD, model.q_max + OUT_OF_RANGE_RAD
    turned = np.deg2rad(q)
    if np.abs(q).max() > _TURN_RAD and ((turned >= low) & (turned <= high)).all():
        raise RecordingError(
            f"The positions in {place} reach {np.abs(q).max():.4g} rad and would be in the range of"
            f" {model.description.name} as degrees: name the columns q1_deg and so on."
        )


def check_velocities(place: Path, time: FloatArray, q: FloatArray, qd: FloatArray) -> tuple[str, ...]:
    """Hold velocities (N, n) [rad/s] against the derivatives of positions; RecordingError for another unit or sign."""
    true = velocities(time, q)
    moving = np.flatnonzero(np.sqrt((true**2).mean(axis=0)) > _MOVING_RAD_S)
    if not len(moving):
        return ("No joint moves: sign and unit of the velocities cannot be checked.",)
    true, qd = true[:, moving], qd[:, moving]
    size, product = (true**2).sum(axis=0), (qd * true).sum(axis=0)
    alike = product / np.maximum(np.sqrt((qd**2).sum(axis=0) * size), 1e-12)
    if (alike < -_ALIKE).all():
        raise RecordingError(f"The velocities in {place} are those of its positions with the other sign: reverse them.")
    slope = float(np.median(product / size))
    if (alike > _UNLIKE).all() and 40.0 < slope < 80.0:
        raise RecordingError(
            f"The velocities in {place} are {slope:.3g} times those of its positions, so they are in degrees: name the"
            " columns dq1_deg_s and so on."
        )
    if not (alike > _UNLIKE).all() or not 0.5 < slope < 2.0:
        return (
            f"The velocities are {slope:.2g} times those of the positions, with a correlation of {alike.min():.2f} at"
            " the worst joint: check them.",
        )
    return ()


def check_torques(
    place: Path, q: FloatArray, qd: FloatArray, tau: FloatArray, model: RobotModel, measured: bool, payload: float
) -> None:
    """Hold torques (N, n) [Nm] against the model's: those that an arm measured, or else external ones.

    RecordingError for what is of another sign or unit, and for external torques with gravity in them.
    """
    some = np.unique(np.linspace(0, len(q) - 1, _SAMPLES).astype(np.int64))
    q, qd, tau = q[some], qd[some], tau[some]
    expected = _model_torques(model, q, qd) + payload * _carried(model, q)
    _check_unit(place, tau, expected, model, measured)
    same, other = (float(((tau - sign * expected) ** 2).sum()) for sign in (1.0, -1.0))
    if measured and other < _FAR_BETTER * same:
        raise RecordingError(
            f"The torques in {place} are minus those that hold the arm: they have the other sign, so give --sign"
            " by-robot (or on-robot, if you gave that)."
        )
    if not measured and min(same, other) < _FAR_BETTER * float((tau**2).sum()):
        raise RecordingError(
            f"The external torques in {place} are {'' if same < other else 'minus '}those that hold the arm: gravity is"
            " still in them, so name the columns tau1_Nm and so on for our own observer."
        )


def _carried(model: RobotModel, q: FloatArray) -> FloatArray:
    """Torques (N, n) [Nm] that carry 1 kg at the end-effector."""
    return np.array([model.ee_jacobian(model.kinematics(p))[:3].T @ GRAVITY for p in q])


def _model_torques(model: RobotModel, q: FloatArray, qd: FloatArray) -> FloatArray:
    """Torques (N, n) [Nm] that hold and turn the arm, but for what accelerates it."""
    return np.array([model.mass_matrix_and_bias(p, v, np.empty(model.n))[1] for p, v in zip(q, qd, strict=True)])


def _check_unit(place: Path, tau: FloatArray, expected: FloatArray, model: RobotModel, measured: bool) -> None:
    times = float(np.median(np.abs(tau).max(axis=1)) / max(np.median(np.abs(expected).max(axis=1)), 1e-9))
    largest = float(np.median((np.abs(tau) / model.description.tau_max).max(axis=1)))
    if largest > 2.0 and _THOUSAND[0] < (times if measured else 1000.0) < _THOUSAND[1]:
        raise RecordingError(
            f"The torques in {place} are {largest:.3g} times the largest that {model.description.name} can give: in"
            " mNm, name the columns tau1_mNm or tau_ext1_mNm and so on."
        )
