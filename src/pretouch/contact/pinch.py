"""Caught between two of the arm's own links: what pushes them apart, and nothing else (docs/reaction.md).

Two forces that cancel turn only the joints between the two links. A contact from outside turns the joints before its
link too, unless its line of action passes through their axes.
"""

import numpy as np

from pretouch.params import ReactionParams
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.self_distance import nearest_points
from pretouch.types import FloatArray, IntArray
from pretouch.values import value


@value
class Pinch:
    """What is caught between two links."""

    link: IntArray
    """(2,) index of each."""
    point: FloatArray
    """(2, 3) where each touches, base frame [m]."""
    force: float
    """Force with which it pushes them apart [N]."""
    rest: float
    """Square of the torques that this leaves, in standard deviations of free motion [1]."""
    odds: float
    """Twice the logarithm of how likely this gap is, among others: by what is left of the torques, and by its size."""


def pinched(
    model: RobotModel, kin: Kinematics, torque: FloatArray, covariance: FloatArray, qd: FloatArray, p: ReactionParams
) -> Pinch | None:
    """Return what is caught between two links that come nearer to each other, or None.

    Args:
        model: the arm.
        kin: its posture.
        torque: (n,) external torques less those of free motion [Nm].
        covariance: (n, n) of what free motion leaves of them [Nm^2].
        qd: (n,) joint velocities with which the arm came [rad/s].
        p: parameters.
    """
    body, (first, second) = model.capsules, model.apart.T
    a = kin.position[body.link] + np.einsum("cij,cj->ci", kin.rotation[body.link], body.a)
    b = kin.position[body.link] + np.einsum("cij,cj->ci", kin.rotation[body.link], body.b)
    p1, p2 = nearest_points(a[first], b[first], a[second], b[second])
    way = p2 - p1
    length = np.sqrt((way**2).sum(axis=1))
    gap = length - body.radius[first] - body.radius[second]
    found, white = None, np.linalg.inv(np.linalg.cholesky(covariance))
    z = white @ torque
    size = float(z @ z)
    for k in np.flatnonzero((gap > 0.0) & (gap < p.pinch_gap_m)):
        one, other, u = body.link[first[k]], body.link[second[k]], way[k] / length[k]
        at = np.array([p1[k] + body.radius[first[k]] * u, p2[k] - body.radius[second[k]] * u])
        J = model.jacobian(kin, other, at[1])[:3] - model.jacobian(kin, one, at[0])[:3]
        if -float(u @ J @ qd) < p.pinch_closing_m_s:
            continue
        A = white @ J.T
        force = np.linalg.lstsq(A, z, rcond=1e-3)[0]
        along, rest = float(force @ u), float(((z - A @ force) ** 2).sum())
        if along < max(p.pinch_n, p.pinch_along * float(np.linalg.norm(force))):
            continue
        if rest > p.pinch_rest or size - rest < p.pinch_explained:
            continue
        odds = -rest - 2.0 * float(gap[k]) / p.pinch_thickness_m
        if found is None or odds > found.odds:
            found = Pinch(np.array([one, other]), at, along, rest, odds)
    return found
