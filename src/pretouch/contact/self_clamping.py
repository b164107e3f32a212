"""Self-clamping: something caught between two links of the arm, or between a link and a fixture.

Two opposite forces f on links a and b make the torques (J_b - J_a)^T f, which turn only the joints between the two
links. A contact from outside turns the joints before its link too, unless its line of action passes through their axes.
What is between a link and a fixture pushes the link away from it, a gap's width before it, while the arm closes the
gap. See docs/explanation/reaction.md.
"""

import numpy as np

from pretouch.groups import Kinematics
from pretouch.params.paper import PinchParams
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.robot.self_distance import nearest_points
from pretouch.types import FloatArray, IntArray, Touched
from pretouch.values import value


@value
class SelfClamp:
    """Something caught between two links."""

    link: IntArray
    """(2,) index of each."""
    force: float
    """Force with which it pushes them apart [N]."""


def find_self_clamp(
    model: RobotModel, kin: Kinematics, torque: FloatArray, covariance: FloatArray, qd: FloatArray, p: PinchParams
) -> SelfClamp | None:
    """Return what is caught between two links that approach each other, or None.

    Args:
        model: the arm.
        kin: its posture.
        torque: (n,) external torques less those of free motion [Nm].
        covariance: (n, n) of what free motion leaves of them [Nm^2].
        qd: (n,) joint velocities with which the arm came to the contact [rad/s].
        p: parameters.
    """
    body, (first, second) = model.capsules, model.apart.T
    a = kin.position[body.link] + np.einsum("cij,cj->ci", kin.rotation[body.link], body.a)
    b = kin.position[body.link] + np.einsum("cij,cj->ci", kin.rotation[body.link], body.b)
    p1, p2 = nearest_points(a[first], b[first], a[second], b[second])
    between = p2 - p1
    length = np.sqrt((between**2).sum(axis=1))
    gap = length - body.radius[first] - body.radius[second]
    # torques in units of their standard deviations: z = L^-1 tau
    found, best, white = None, -np.inf, np.linalg.inv(np.linalg.cholesky(covariance))
    z = white @ torque
    size = float(z @ z)
    for k in np.flatnonzero((gap > 0.0) & (gap < p.gap_m)):
        one, other, u = body.link[first[k]], body.link[second[k]], between[k] / length[k]
        # base and second link: what is between them turns the first joints, as a push from the side does
        if model.moved_by[one].sum() + model.moved_by[other].sum() <= _FIRST_JOINTS:
            continue
        # it touches both links on their surfaces, where they are nearest to each other
        at_one, at_other = p1[k] + body.radius[first[k]] * u, p2[k] - body.radius[second[k]] * u
        J = model.jacobian(kin, other, at_other)[:3] - model.jacobian(kin, one, at_one)[:3]
        # the gap closes at -u^T (J_b - J_a) qd
        if -float(u @ J @ qd) < _CLOSING_M_S:
            continue
        # J has the rank of the joints between the two links, often less than 3
        A = white @ J.T
        force = np.linalg.lstsq(A, z, rcond=1e-3)[0]
        along, rest = float(force @ u), float(((z - A @ force) ** 2).sum())
        # it pushes the links apart, within a cone about the line between them
        if along < max(p.force_n, _ALONG * float(np.linalg.norm(force))):
            continue
        # what is left is noise, and what is explained is not
        if rest > _REST or size - rest < _EXPLAINED:
            continue
        # twice a log-posterior: a Gaussian of what is left, an exponential prior of the thickness of what is caught
        odds = -rest - 2.0 * float(gap[k]) / _THICKNESS_M
        if odds > best:
            found, best = SelfClamp(np.array([one, other]), along), odds
    return found


def presses_on_fixture(
    model: RobotModel, kin: Kinematics, touched: Touched, planes: FloatArray, standing: Capsules, qd: FloatArray,
    p: PinchParams,
) -> bool:  # fmt: skip
    """Whether a link presses something against a fixture, by the most certain contact's point and force.

    Args:
        model: the arm.
        kin: its posture.
        touched: the contacts.
        planes: (P, 4) rows (normal, offset) of fixtures, normals into free space, base frame.
        standing: capsules of fixtures, base frame.
        qd: (n,) joint velocities with which the arm came to the contact [rad/s].
        p: parameters.
    """
    if not len(touched.link):
        return False
    point, force = touched.point[0], touched.force[0]
    size = float(np.sqrt(force @ force))
    # speed at which the contact point moves against the force
    closing = -float(force @ model.jacobian(kin, int(touched.link[0]), point)[:3] @ qd)
    if size < p.force_n or closing < _CLOSING_M_S * size:
        return False
    gap, away = planes[:, :3] @ point - planes[:, 3], planes[:, :3]
    if len(standing):
        # distance of the point from each axis: a segment of no length
        there = np.broadcast_to(point, standing.a.shape)
        foot, _ = nearest_points(standing.a, standing.b, there, there)
        far = np.linalg.norm(point - foot, axis=1)
        gap = np.concatenate([gap, far - standing.radius])
        away = np.concatenate([away, (point - foot) / np.maximum(far, _ON_AXIS_M)[:, None]])
    # nearer than `_LEAST_GAP_M` it is the fixture itself that the arm touches
    return bool(np.any((gap > _LEAST_GAP_M) & (gap < p.gap_m) & (away @ force > _ALONG * size)))


_LEAST_GAP_M = 0.02
"""Gap to a fixture below which the link touches the fixture itself [m]: as well as the place of a contact is known."""
_FIRST_JOINTS = 2
"""Joints of which the torques alone do not tell what is caught from a push: one from the side at the hand of an arm of
six joints turns the first only."""
_CLOSING_M_S = 0.02
"""Speed from which a gap counts as closing [m/s]: two links with a single link between them come nearer to each other
by less, whatever the arm does."""
_THICKNESS_M = 0.06
"""Mean thickness of what may be caught, between finger and forearm [m]: of two gaps that explain the torques as well,
the narrower one is taken."""
_ALONG = 0.85
"""Cosine of the largest angle between the force and the shortest line across the gap: friction."""
_REST = 9.0
"""Square of the torques that a caught object may leave unexplained, in deviations of free motion [1]: 94 % of the
chi-square distribution of the four that a force does not explain."""
_EXPLAINED = 27.0
"""Least square of the torques that it has to explain [1]. Of 297 contacts from outside one met both bounds."""
_ON_AXIS_M = 1e-9
"""Distance from a capsule's axis below which no direction leads away from it [m]."""
