"""Caught between two of the arm's own links, or between one and what stands beside the arm.

Two forces that cancel turn only the joints between the two links. A contact from outside turns the joints before its
link too, unless its line of action passes through their axes. Between a link and a fixture is what pushes the link away
from it, a gap's width before it, while the arm comes. See docs/explanation/reaction.md.
"""

import numpy as np

from pretouch.params.reaction import PinchParams
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.self_distance import nearest_points
from pretouch.types import FloatArray, IntArray, Touched
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
    model: RobotModel, kin: Kinematics, torque: FloatArray, covariance: FloatArray, qd: FloatArray, p: PinchParams
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
    for k in np.flatnonzero((gap > 0.0) & (gap < p.gap_m)):
        one, other, u = body.link[first[k]], body.link[second[k]], way[k] / length[k]
        at = np.array([p1[k] + body.radius[first[k]] * u, p2[k] - body.radius[second[k]] * u])
        J = model.jacobian(kin, other, at[1])[:3] - model.jacobian(kin, one, at[0])[:3]
        if -float(u @ J @ qd) < _CLOSING_M_S:
            continue
        A = white @ J.T
        force = np.linalg.lstsq(A, z, rcond=1e-3)[0]
        along, rest = float(force @ u), float(((z - A @ force) ** 2).sum())
        if along < max(p.force_n, _ALONG * float(np.linalg.norm(force))):
            continue
        if rest > _REST or size - rest < _EXPLAINED:
            continue
        odds = -rest - 2.0 * float(gap[k]) / _THICKNESS_M
        if found is None or odds > found.odds:
            found = Pinch(np.array([one, other]), at, along, rest, odds)
    return found


def pressed(
    model: RobotModel, kin: Kinematics, touched: Touched, planes: FloatArray, standing: Capsules, qd: FloatArray,
    p: PinchParams,
) -> bool:  # fmt: skip
    """Whether a link presses something against a fixture: where the surest contact is, and where its force points.

    Args:
        model: the arm.
        kin: its posture.
        touched: where it is touched.
        planes: (P, 4) rows (normal, offset) of fixtures, normals into free space, base frame.
        standing: capsules of fixtures, base frame.
        qd: (n,) joint velocities with which the arm came [rad/s].
        p: parameters.
    """
    if not len(touched.link):
        return False
    point, force = touched.point[0], touched.force[0]
    size = float(np.sqrt(force @ force))
    coming = -float(force @ model.jacobian(kin, int(touched.link[0]), point)[:3] @ qd)
    if size < p.force_n or coming < _CLOSING_M_S * size:
        return False
    gap, away = planes[:, :3] @ point - planes[:, 3], planes[:, :3]
    if len(standing):
        # a segment that is a point: how far it is from each axis
        there = np.broadcast_to(point, standing.a.shape)
        foot, _ = nearest_points(standing.a, standing.b, there, there)
        far = np.linalg.norm(point - foot, axis=1)
        gap = np.concatenate([gap, far - standing.radius])
        away = np.concatenate([away, (point - foot) / np.maximum(far, _ON_AXIS_M)[:, None]])
    return bool(np.any((gap > _LEAST_GAP_M) & (gap < p.gap_m) & (away @ force > _ALONG * size)))


_LEAST_GAP_M = 0.02
"""Gap to a fixture below which the link touches the fixture itself [m]: as well as the place of a contact is known."""
_CLOSING_M_S = 0.02
"""Speed from which a gap counts as closing [m/s]: two links with a single link between them come nearer to each other
by less, whatever the arm does."""
_THICKNESS_M = 0.06
"""Mean thickness of what may be caught, between finger and forearm [m]: of two gaps that explain the torques as well,
the narrower one is taken."""
_ALONG = 0.85
"""Cosine of the largest angle between the force and the shortest way across the gap: friction."""
_REST = 9.0
"""Square of the torques that a caught thing may leave unexplained, in deviations of free motion [1]: 94 % of the
chi-square distribution of the four that a force does not explain."""
_EXPLAINED = 27.0
"""Least square of the torques that it has to explain [1]. Of 297 contacts from outside one met both bounds."""
_ON_AXIS_M = 1e-9
"""Distance from a capsule's axis below which no direction leads away from it [m]."""
