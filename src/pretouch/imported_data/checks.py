"""What can be wrong with recorded joint torques: sign and unit, as the arm's model tells them beyond doubt."""

from pathlib import Path

import numpy as np

from pretouch.errors import RecordingError
from pretouch.imported_data.log import Note
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

GRAVITY = np.array([0.0, 0.0, 9.81])
_MOVING_RAD_S = 0.01
"""Speed of a joint, root mean square, from which its velocity tells something [rad/s]."""
_ALIKE, _UNLIKE = 0.9, 0.5
"""Correlation from which on, and below which, two velocities are taken to be the same, or not."""
_FAR_BETTER = 0.25
"""Part of the squared error that another explanation may leave to be believed [1]."""
_SAMPLES = 400
"""How many samples are looked at."""
_THOUSAND = (300.0, 3000.0)


def check_velocities(place: Path, true: FloatArray, qd: FloatArray) -> tuple[Note, ...]:
    """Hold velocities (N, n) [rad/s] against those of the positions; RecordingError for another unit or sign."""
    moving = np.flatnonzero(np.sqrt((true**2).mean(axis=0)) > _MOVING_RAD_S)
    if not len(moving):
        return (Note("no_motion", {}),)
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
        return (Note("velocities", {"ratio": slope, "correlation": float(alike.min())}),)
    return ()


def check_torques(
    place: Path, q: FloatArray, qd: FloatArray, tau: FloatArray, model: RobotModel, measured: bool, payload: float
) -> None:
    """Hold torques (N, n) [Nm] against the model's: those that an arm measured, or else external ones.

    RecordingError for what is of another sign or unit, and for external torques with gravity in them.
    """
    some = np.unique(np.linspace(0, len(q) - 1, _SAMPLES).astype(np.int64))
    q, qd, tau = q[some], qd[some], tau[some]
    expected = np.array([
        model.mass_matrix_and_bias(p, v, np.empty(model.n))[1]
        + payload * model.ee_jacobian(model.kinematics(p))[:3].T @ GRAVITY
        for p, v in zip(q, qd, strict=True)
    ])  # fmt: skip
    times = float(np.median(np.abs(tau).max(axis=1)) / max(np.median(np.abs(expected).max(axis=1)), 1e-9))
    largest = float(np.median((np.abs(tau) / model.description.tau_max).max(axis=1)))
    if largest > 2.0 and _THOUSAND[0] < (times if measured else 1000.0) < _THOUSAND[1]:
        raise RecordingError(
            f"The torques in {place} are {largest:.3g} times the largest that {model.description.name} can give: in"
            " mNm, name the columns tau1_mNm or tau_ext1_mNm and so on."
        )
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
