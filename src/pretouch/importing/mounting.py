"""How an arm is mounted: the direction of gravity in its base frame, by the torques that hold it."""

import numpy as np
import scipy  # its parts load when they are first used: a quarter of a second that a help does not wait

from pretouch.robot.kinematics import G_M_S2
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

LEAN_DEG = 7.0
"""Smallest angle between two directions of gravity that are told apart [degrees]: a tool of 3 kg that a model lacks
tilts an estimate by 6."""
_REVERSING_RAD_S = 0.1
"""Speed over which friction changes its sign [rad/s]."""


def weights_of(model: RobotModel, q: FloatArray) -> FloatArray:
    """Compute the torques (n, 3) that hold an arm at q (n,) [rad], by gravity along each base axis [kg m]."""
    kin, links = model.kinematics(q), model.mechanism.links
    center = kin.position + np.einsum("kij,kj->ki", kin.rotation, links.com)
    mass = links.mass[:, None] * model.moved_by
    # sum of m_k (c_k - p_j) over the links that joint j moves
    lever = mass.T @ center - mass.sum(axis=0)[:, None] * kin.anchor
    return np.cross(lever, kin.axis)


def lean_of(model: RobotModel, gravity: FloatArray) -> float:
    """Return the angle between an arm's gravity and another one (3,) [degrees]."""
    along = gravity @ model.gravity / (np.linalg.norm(gravity) * G_M_S2)
    return float(np.rad2deg(np.arccos(np.clip(along, -1.0, 1.0))))


def direction_text(gravity: FloatArray) -> str:
    """Return a direction (3,) as --gravity takes it; near an axis that axis, for walls and ceilings are square."""
    down = gravity / np.linalg.norm(gravity)
    axis = np.round(down)
    if np.abs(axis).sum() == 1.0 and down @ axis > np.cos(np.deg2rad(LEAN_DEG)):
        down = axis
    return ",".join(f"{x:.3g}" for x in down.round(3) + 0.0)


def squares_left(rest: FloatArray, qd: FloatArray) -> FloatArray:
    """Squares of torques (S, n) [Nm] less the friction that explains them best, summed by joint (n,).

    Friction never drives: its coefficients are at least 0, so that it tells the sign of a joint without gravity too.
    The worst tenth of the samples does not count: there somebody may touch the arm.
    """
    turning, rest = np.stack([np.tanh(qd / _REVERSING_RAD_S), qd], axis=2), rest.copy()
    for j in range(rest.shape[1]):
        rest[:, j] -= turning[:, j] @ scipy.optimize.nnls(turning[:, j], rest[:, j])[0]
    best = np.argsort((rest**2).sum(axis=1))[: int(0.9 * len(rest))]
    return np.asarray((rest[best] ** 2).sum(axis=0))


def fitted_gravity(hold: FloatArray, weights: FloatArray, qd: FloatArray) -> tuple[FloatArray, float, float]:
    """Fit gravity to torques (S, n) [Nm] that hold an arm of weights (S, n, 3) [kg m].

    Returns its acceleration (3,) [m/s^2], how many times the true one that is, and the squares that it leaves.
    """
    gravity = np.asarray(np.linalg.lstsq(weights.reshape(-1, 3), hold.ravel())[0], np.float64)
    return gravity, float(np.linalg.norm(gravity)) / G_M_S2, float(squares_left(hold - weights @ gravity, qd).sum())


def fitted_load(rest: FloatArray, of_1_kg: FloatArray, qd: FloatArray) -> tuple[float, float]:
    """Fit a load, whose torques for 1 kg are (S, n) [Nm], to torques (S, n) that a model leaves.

    Returns the load [kg] and the squares that it leaves.
    """
    kg = max(0.0, float((of_1_kg * rest).sum() / max((of_1_kg**2).sum(), 1e-12)))
    return kg, float(squares_left(rest - kg * of_1_kg, qd).sum())
