"""How an arm is mounted: the direction of gravity in its base frame, by the torques that hold it."""

import numpy as np

from pretouch.robot.kinematics import G_M_S2
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


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
