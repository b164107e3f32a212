"""What can be wrong with a recording of joint torques: sign, unit and order of joints, noticed and named.

What the arm's model tells beyond doubt is a RecordingError; what friction and loads let guess is a note.
"""

from itertools import permutations
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from pretouch.errors import RecordingError
from pretouch.imported_data.observed import GRAVITY
from pretouch.imported_data.velocities import velocities
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, IntArray

_OUT_RAD = 0.5
"""How far positions may lie beyond the arm's range [rad]; `source.check_reach` takes the same."""
_TURN_RAD = 7.0
"""More than a whole turn [rad]: beyond it positions may be in degrees."""
_MOVING_RAD_S = 0.01
"""Speed of a joint, root mean square, from which its velocity tells something [rad/s]."""
_ALIKE, _UNLIKE = 0.9, 0.5
"""Correlation from which on, and below which, two velocities are taken to be of one joint, or not."""
_FAR_BETTER = 0.25
"""Part of the squared error that another explanation may leave to be believed [1]."""
_BETTER = 0.6
"""The same, to be mentioned."""
_POOR = 0.02
"""Part of the squared torques left unexplained by the model from which on other orders of the joints are tried [1]."""
_SAMPLES, _FEW = 400, 30
"""How many samples are looked at, and with each order of the joints."""
_MOST_JOINTS = 7
"""Up to how many joints all orders are tried."""
_THOUSAND = (300.0, 3000.0)
_LOAD_KG = 0.3
"""Load from which on it is mentioned [kg]."""


def check_positions(place: Path, q: FloatArray, model: RobotModel) -> None:
    """Refuse positions (N, n) [rad] out of the arm's range that are within it as degrees or in another order."""
    low, high = model.q_min - _OUT_RAD, model.q_max + _OUT_RAD
    if ((q >= low) & (q <= high)).all():
        return
    beyond = np.array([[max(low[j] - c.min(), c.max() - high[j], 0.0) for j in range(model.n)] for c in q.T])
    moved = np.abs(np.subtract.outer(np.arange(model.n), np.arange(model.n)))
    columns, joints = linear_sum_assignment(beyond + 1e-6 * moved)
    if not beyond[columns, joints].any():
        raise RecordingError(
            f"The positions in {place} are out of the range of {model.description.name}, and would be in it in another"
            f" order, as joints {_listed(joints)}: give the columns in the arm's order, or another --arm."
        )
    turned = np.deg2rad(q)
    if np.abs(q).max() > _TURN_RAD and ((turned >= low) & (turned <= high)).all():
        raise RecordingError(
            f"The positions in {place} reach {np.abs(q).max():.4g} rad and would be in the range of"
            f" {model.description.name} as degrees: name the columns q1_deg and so on."
        )


def check_velocities(place: Path, time: FloatArray, q: FloatArray, qd: FloatArray) -> tuple[str, ...]:
    """Hold velocities (N, n) [rad/s] against the derivatives of positions; RecordingError for another unit or order."""
    true = velocities(time, q)
    moving = np.flatnonzero(np.sqrt((true**2).mean(axis=0)) > _MOVING_RAD_S)
    if not len(moving):
        return ("No joint moves: sign, unit and order of the velocities cannot be checked.",)
    size = np.sqrt((true**2).sum(axis=0))
    alike = (qd.T @ true) / np.maximum(np.sqrt((qd**2).sum(axis=0))[:, None] * size[None, :], 1e-12)
    own = alike[moving, moving]
    if (own < -_ALIKE).all():
        raise RecordingError(f"The velocities in {place} are those of its positions with the other sign: reverse them.")
    for j in moving:
        other = int(np.argmax(alike[:, j]))
        if alike[j, j] < _UNLIKE and other != j and alike[other, j] > _ALIKE:
            raise RecordingError(
                f"The velocity of joint {other + 1} in {place} is that of the position of joint {j + 1}: give positions"
                " and velocities in one order, that of the arm."
            )
    slope = float(np.median((qd * true).sum(axis=0)[moving] / size[moving] ** 2))
    if (own > _UNLIKE).all() and 40.0 < slope < 80.0:
        raise RecordingError(
            f"The velocities in {place} are {slope:.3g} times those of its positions, so they are in degrees: name the"
            " columns dq1_deg_s and so on."
        )
    if not (own > _UNLIKE).all() or not 0.5 < slope < 2.0:
        return (
            f"The velocities are {slope:.2g} times those of the positions, with a correlation of {own.min():.2f} at"
            " the worst joint: check them.",
        )
    return ()


def check_torques(
    place: Path, q: FloatArray, qd: FloatArray, tau: FloatArray, model: RobotModel, measured: bool, payload: float
) -> tuple[str, ...]:
    """Hold torques (N, n) [Nm] against the model's: those that an arm measured, or else external ones.

    RecordingError for what is clearly of another sign, unit or order; notes of what may be.
    """
    some = np.unique(np.linspace(0, len(q) - 1, _SAMPLES).astype(np.int64))
    q, qd, tau = q[some], qd[some], tau[some]
    carried = _carried(model, q)
    expected = _model_torques(model, q, qd) + payload * carried
    _check_unit(place, tau, expected, model, measured)
    if measured:
        _check_sign(place, tau, expected)
        _check_order(place, q, qd, tau, model, payload)
        _check_signs(place, tau, expected)
        return _load(tau - expected, carried, "measured torques" if not payload else "")
    left = float((tau**2).sum())
    for sign in (1.0, -1.0):
        if float(((tau - sign * expected) ** 2).sum()) < _FAR_BETTER * left:
            raise RecordingError(
                f"The external torques in {place} are {'' if sign > 0 else 'minus '}those that hold the arm: gravity is"
                " still in them, so name the columns tau1_Nm and so on for our own observer."
            )
    return (*_friction_sign(qd, tau, carried), *_external_order(qd, tau, carried))


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
    if measured and 1.0 / _THOUSAND[1] < times < 1.0 / _THOUSAND[0]:
        raise RecordingError(
            f"The torques in {place} are {times:.2g} of those that hold {model.description.name}: in kNm, name the"
            " columns tau1_kNm and so on."
        )


def _check_sign(place: Path, tau: FloatArray, expected: FloatArray) -> None:
    if ((tau + expected) ** 2).sum() < _FAR_BETTER * ((tau - expected) ** 2).sum():
        raise RecordingError(
            f"The torques in {place} are minus those that hold the arm: they have the other sign, so give --sign"
            " by-robot (or on-robot, if you gave that)."
        )


def _check_signs(place: Path, tau: FloatArray, expected: FloatArray) -> None:
    same, other = ((tau - expected) ** 2).sum(axis=0), ((tau + expected) ** 2).sum(axis=0)
    tells = (expected**2).mean(axis=0) > 1.0
    wrong = np.flatnonzero(tells & (other < _FAR_BETTER * same))
    if len(wrong):
        raise RecordingError(
            f"The torques of joints {_listed(wrong)} in {place} are minus those that hold the arm: reverse these."
        )


def _check_order(
    place: Path, q: FloatArray, qd: FloatArray, tau: FloatArray, model: RobotModel, payload: float
) -> None:
    """Refuse torques, or all columns, that another order of the joints explains far better."""
    expected = _model_torques(model, q, qd) + payload * _carried(model, q)
    errors = ((tau[:, :, None] - expected[:, None, :]) ** 2).sum(axis=0)
    stay = 0.01 * float((tau**2).sum()) * (1.0 - np.eye(model.n))  # what little tells of a joint leaves it in place
    columns, joints = linear_sum_assignment(errors + stay)
    given = float(np.trace(errors))
    if float(errors[columns, joints].sum()) < _FAR_BETTER * given:
        raise RecordingError(
            f"The torques in {place} fit {model.description.name} far better as those of joints {_listed(joints)}: give"
            " them in the order of the positions."
        )
    if given < _POOR * float((tau**2).sum()) or model.n > _MOST_JOINTS:
        return
    some = np.unique(np.linspace(0, len(q) - 1, _FEW).astype(np.int64))
    q, qd, tau = q[some], qd[some], tau[some]
    given, best, order, what = float(((tau - expected[some]) ** 2).sum()), np.inf, tuple(range(model.n)), ""
    for tried in permutations(range(model.n)):
        turned = q[:, tried]
        if ((turned >= model.q_min) & (turned <= model.q_max)).all():
            expected = _model_torques(model, turned, qd[:, tried]) + payload * _carried(model, turned)
            for columns_of, torques in (("all columns", tau[:, tried]), ("positions and velocities", tau)):
                error = float(((torques - expected) ** 2).sum())
                if error < best:
                    best, order, what = error, tried, columns_of
    if best < _FAR_BETTER * given:
        raise RecordingError(
            f"The recording {place} fits {model.description.name} far better with {what} in the order of joints"
            f" {_listed(np.array(order))}: give them in the arm's order."
        )


def _load(left: FloatArray, carried: FloatArray, whose: str) -> tuple[str, ...]:
    """Mention a load at the end-effector that explains what the model does not."""
    mass = float((left * carried).sum() / max((carried**2).sum(), 1e-9))
    better = float(((left - mass * carried) ** 2).sum()) < _BETTER * float((left**2).sum())
    if not (whose and better and mass > _LOAD_KG):
        return ()
    return (
        f"A load of {mass:.2g} kg at the end-effector explains most of what the model of the arm does not explain of"
        f" the {whose}: if it carries one, add --payload {mass:.2g}.",
    )


def _friction_sign(qd: FloatArray, tau: FloatArray, carried: FloatArray) -> tuple[str, ...]:
    """Mention external torques whose friction drives the joints, or whose load pulls upwards."""
    drives = brakes = 0.0
    for j in range(tau.shape[1]):
        x = np.column_stack([np.ones(len(qd)), np.tanh(qd[:, j] / 0.1), carried[:, j]])
        if np.sqrt((qd[:, j] ** 2).mean()) < _MOVING_RAD_S:
            continue
        found = np.linalg.lstsq(x, tau[:, j], rcond=None)[0]
        explained = float((found[1] * (x[:, 1] - x[:, 1].mean())).var() / max(tau[:, j].var(), 1e-12))
        if explained > 0.1:
            drives, brakes = (drives + explained, brakes) if found[1] > 0 else (drives, brakes + explained)
    if drives < 3.0 * brakes or drives < 0.3:
        return ()
    return (
        "The external torques push each joint along with its motion, as no friction does: they seem to have the other"
        " sign, try the other --sign.",
    )


def _external_order(qd: FloatArray, tau: FloatArray, carried: FloatArray) -> tuple[str, ...]:
    """Mention external torques whose friction and loads are those of other joints."""
    n = tau.shape[1]
    left = np.ones((n, n))
    for j in range(n):
        x = np.column_stack([np.ones(len(qd)), np.tanh(qd[:, j] / 0.1), qd[:, j], carried[:, j]])
        error = tau - x @ np.linalg.lstsq(x, tau, rcond=None)[0]
        left[:, j] = error.var(axis=0) / np.maximum(tau.var(axis=0), 1e-12)
    columns, joints = linear_sum_assignment(left)
    if float(left[columns, joints].sum()) > _BETTER * float(np.trace(left)):
        return ()
    return (
        f"The external torques follow the motion far better as those of joints {_listed(joints)}: check the order of"
        " their columns.",
    )


def _listed(joints: IntArray) -> str:
    return ", ".join(str(int(j) + 1) for j in joints)
