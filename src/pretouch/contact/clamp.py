"""Clamps between the arm and objects, pinches between two links or a link and a fixture; and how the arm opens them.

Two opposite forces f on links a and b make the torques (J_b - J_a)^T f, which turn only the joints between the two
links. A contact from outside turns the joints before its link too, unless its line of action passes through their axes.
An object between a link and a fixture pushes the link away, a gap's width before the fixture, while the arm closes the
gap. See docs/explanation/reaction.md.
"""

from dataclasses import replace

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.detector import Body
from pretouch.contact.virtual_mass import MARKS
from pretouch.params import ClampParams, PinchParams
from pretouch.robot.body import placed
from pretouch.robot.kinematics import Kinematics, below
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import nearest_points
from pretouch.types import FloatArray, Touched
from pretouch.values import value

_APART_S = 0.05
"""Time between two marks of the arm's path [s]."""


@value
class ClampState:
    """Memory of one reaction for the detection of a clamp."""

    course: FloatArray
    """(n,) unit vector of the joint velocities with which the arm last followed a push, zero before."""
    pushed: float
    """Time since it last followed a push [s]."""
    opposed: float
    """Time for which the torque has opposed the course [s]."""
    turns: int
    """Reversals of the course."""
    turned: float
    """Time since the last reversal [s]."""
    trail: FloatArray
    """(M, n) joint positions commanded since the contact, or before it for a pinch, newest first [rad]."""
    marked: float
    """Time since the newest mark [s]."""
    torque: float
    """Torque of the clamp against the course [Nm], 0 without a clamp."""
    opening: float
    """Time for which the arm has been opening [s]."""
    open: bool
    """True once the arm has opened."""
    came: FloatArray
    """(n,) joint velocities of the arm at the contact [rad/s]."""
    between: str
    """Both parts of a pinch, in words; '' for a clamp."""
    force: float
    """Force with which these parts are pushed apart [N]."""


def clamp_init(q: FloatArray) -> ClampState:
    """Return the state of an arm without a contact, at joint positions (n,) [rad]."""
    there, none = np.tile(q, (MARKS, 1)), np.zeros(len(q))
    return ClampState(none, np.inf, 0.0, 0, np.inf, there, 0.0, 0.0, 0.0, False, none, "", 0.0)


@compiled
def note_place(path: FloatArray, marked: FloatArray, q: FloatArray, dt: float) -> None:
    """Add a mark to the path (M, n) of an arm that follows its task, at commanded joint positions q (n,) [rad].

    After another motion, by a reaction or by hand, the path starts anew. `marked` (1,) is the time since the newest
    mark [s].
    """
    marked[0] += dt
    # farther from a mark than the task moves until the next: something else has moved the arm
    if not below(q - path[0], _MOVED_RAD):
        marked[0], path[:] = 0.0, q
    elif marked[0] >= _APART_S:
        marked[0], path[1:] = 0.0, path[:-1].copy()
        path[0] = q


def begin_pinch(state: ClampState, path: FloatArray, between: str, force: float, torque: FloatArray) -> ClampState:
    """Return the state of a pinch with a torque (n,) [Nm].

    The arm opens it along its path (M, n) [rad] before the contact.
    """
    size = float(np.abs(torque).max())
    return replace(state, torque=size, trail=path.copy(), between=between, force=force, opposed=0.0)


def update_clamp(
    state: ClampState, torque: FloatArray, velocity: FloatArray, q: FloatArray, dt: float, p: ClampParams
) -> ClampState:
    """Update the detection of a clamp by one period dt [s] of yielding.

    A clamp is a torque against the course on which the arm follows a push, for longer than noise makes one, and so soon
    after the push that the push may still be there. Later it is a push of its own, to which the arm yields; but that
    too is a clamp when the arm is pushed to and fro. A push from the side, or harder in the same direction, is none.
    `torque` (n,) is external [Nm], `velocity` (n,) that of the virtual mass [rad/s], `q` (n,) commanded [rad].
    """
    speed = float(np.sqrt(velocity @ velocity))
    # the part of the torque along the motion in joint space, negative against it
    along = float(torque @ state.course)
    opposed = state.opposed + dt if along < -p.torque_nm else 0.0
    # `pushed` counts on while a torque opposes, which may begin at the end of the window
    soon = state.pushed < _WINDOW_S + _OPPOSED_S
    course, pushed, turns, turned = state.course, state.pushed + dt, state.turns, state.turned + dt
    # the arm follows a push: it moves, half of a clamp's torque or more drives it, and no torque opposes it
    if speed > _COURSE_RAD_S and torque @ velocity > 0.5 * p.torque_nm * speed and not (soon and opposed > 0):
        reversed_ = bool(velocity @ course < 0)
        turns = (turns if turned < _TURN_S else 0) + 1 if reversed_ else turns
        course, pushed, turned = velocity / speed, 0.0, 0.0 if reversed_ else turned
    # 1e-9, for sums of periods are not exact
    clamped = (soon and opposed >= _OPPOSED_S - 1e-9) or turns >= _TURNS
    trail, marked = state.trail, state.marked + dt
    if marked >= _APART_S:
        trail, marked = np.vstack((q[None], trail[:-1])), 0.0
    # never 0, which stands for no clamp: two reversals may have a small torque
    against = max(abs(along), p.torque_nm) if clamped else 0.0
    state = replace(state, course=course, pushed=pushed, opposed=opposed, turns=turns, turned=turned)
    return replace(state, trail=trail, marked=marked, torque=against)


def open_clamp(
    state: ClampState, torque: FloatArray, q: FloatArray, dt: float, p: ClampParams
) -> tuple[FloatArray, ClampState]:
    """Return the joint velocities (n,) [rad/s] back to the next mark of the arm's path, of any length.

    The motion ends after its time, at the end of the path, and where a torque opposes it as in a clamp: the arm then
    does not push against a force. Marks of the path to a pinch that are already behind the arm are left out.
    `torque` (n,) is external [Nm], `q` (n,) commanded [rad], `dt` the period [s].
    """
    trail = state.trail
    # skip the marks that are reached, and those that lead back into the pinch
    while len(trail) > 1 and (np.abs(trail[0] - q).max() < _NEAR_RAD or _closes(state, trail[0] - q)):
        trail = trail[1:]
    back = trail[0] - q
    back = np.zeros(len(q)) if _closes(state, back) else back
    length = float(np.sqrt(back @ back))
    against = length > 0 and float(torque @ back) < -p.torque_nm * length
    opposed = state.opposed + dt if against else 0.0
    over = state.opening + dt > p.open_s or opposed >= _OPPOSED_S - 1e-9 or float(np.abs(back).max()) < _NEAR_RAD
    # to the mark within one period: the caller slows that down to `open_m_s`
    return back / dt, replace(state, opposed=opposed, trail=trail, opening=state.opening + dt, open=state.open or over)


def _closes(state: ClampState, motion: FloatArray) -> bool:
    """Return whether a motion (n,) [rad] closes a pinch again."""
    return state.between != "" and float(motion @ state.came) > 0.0


_COURSE_RAD_S = 0.05
"""Speed in joint space from which the arm has a course [rad/s]."""
_OPPOSED_S = 0.03
"""Time for which a torque must oppose the yielding to be a clamp [s]: longer than noise of the estimate lasts."""
_WINDOW_S = 0.25
"""Time after a push in which an opposing torque is a clamp and no push of its own [s]."""
_TURNS = 2
"""Reversals of the yielding, less than `_TURN_S` apart, that are a clamp too."""
_TURN_S = 2.0
"""See `_TURNS` [s]."""
_MOVED_RAD = 0.15
"""More than a joint turns from one mark to the next while the arm follows its path [rad]."""
_NEAR_RAD = 0.002
"""Distance at which a mark of the path counts as reached [rad]."""


def find_pinch(
    model: RobotModel, kin: Kinematics, torque: FloatArray, covariance: FloatArray, qd: FloatArray, p: PinchParams
) -> tuple[int, int, float] | None:
    """Return the two approaching links of a pinch, and the force that pushes them apart [N], or None.

    `torque` (n,) [Nm] is external, less that of free motion with its covariance (n, n) [Nm^2]; `qd` (n,) [rad/s] are
    the joint velocities at the contact.
    """
    body, (first, second) = model.capsules, model.apart.T
    _, a, b, _ = placed(body, kin)
    p1, p2 = nearest_points(a[first], b[first], a[second], b[second])
    between = p2 - p1
    length = np.sqrt((between**2).sum(axis=1))
    gap = length - body.radius[first] - body.radius[second]
    # torques in units of their standard deviations: z = L^-1 tau
    pinch, best, white = None, -np.inf, np.linalg.inv(np.linalg.cholesky(covariance))
    z = white @ torque
    size = float(z @ z)
    for k in np.flatnonzero((gap > 0.0) & (gap < p.gap_m)):
        one, other, u = body.link[first[k]], body.link[second[k]], between[k] / length[k]
        # base and second link: an object between them turns the first joints, as a push from the side does
        if model.moved_by[one].sum() + model.moved_by[other].sum() <= _FIRST_JOINTS:
            continue
        # the object touches both links at their nearest points
        at_one, at_other = p1[k] + body.radius[first[k]] * u, p2[k] - body.radius[second[k]] * u
        J = model.jacobian(kin, other, at_other)[:3] - model.jacobian(kin, one, at_one)[:3]
        # the gap closes at -u^T (J_b - J_a) qd
        if -float(u @ J @ qd) < _CLOSING_M_S:
            continue
        # J has the rank of the joints between the two links, often less than 3
        A = white @ J.T
        force = np.linalg.lstsq(A, z, rcond=1e-3)[0]
        along, rest = float(force @ u), float(((z - A @ force) ** 2).sum())
        # the force pushes the links apart, within a cone about the line between them
        if along < max(p.force_n, _ALONG * float(np.linalg.norm(force))):
            continue
        # the rest is noise, and the explained part is not
        if rest > _REST or size - rest < _EXPLAINED:
            continue
        # twice a log-posterior: a Gaussian of the rest, an exponential prior of the object's thickness
        odds = -rest - 2.0 * float(gap[k]) / _THICKNESS_M
        if odds > best:
            pinch, best = (int(one), int(other), along), odds
    return pinch


def presses_on_fixture(body: Body, kin: Kinematics, touched: Touched, qd: FloatArray, p: PinchParams) -> bool:
    """Return whether a link presses an object against a fixture, by the most certain contact's point and force.

    The fixtures' normals point into free space; `qd` (n,) [rad/s] are the joint velocities at the contact.
    """
    if not len(touched.link):
        return False
    point, force, planes, standing = touched.point[0], touched.force[0], body.planes, body.standing
    size = float(np.sqrt(force @ force))
    # speed at which the contact point moves against the force
    closing = -float(force @ body.model.jacobian(kin, int(touched.link[0]), point)[:3] @ qd)
    if size < p.force_n or closing < _CLOSING_M_S * size:
        return False
    gap, away = planes[:, :3] @ point - planes[:, 3], planes[:, :3]
    if len(standing.radius):
        # distance of the point from each axis: a segment of no length
        there = np.broadcast_to(point, standing.a.shape)
        foot, _ = nearest_points(standing.a, standing.b, there, there)
        far = np.linalg.norm(point - foot, axis=1)
        gap = np.concatenate([gap, far - standing.radius])
        away = np.concatenate([away, (point - foot) / np.maximum(far, _ON_AXIS_M)[:, None]])
    # nearer than `_LEAST_GAP_M`, the arm touches the fixture itself
    return bool(np.any((gap > _LEAST_GAP_M) & (gap < p.gap_m) & (away @ force > _ALONG * size)))


_LEAST_GAP_M = 0.02
"""Gap to a fixture below which the link touches the fixture itself [m]: the error of a contact's place."""
_FIRST_JOINTS = 2
"""Number of first joints whose torques alone do not distinguish a pinch from a push: a push from the side at the hand
of an arm with six joints turns the first one only."""
_CLOSING_M_S = 0.02
"""Speed from which a gap counts as closing [m/s]: two links with a single link between them approach each other more
slowly in any motion."""
_THICKNESS_M = 0.06
"""Mean thickness of an object in a pinch, between finger and forearm [m]: of two gaps that explain the torques equally
well, the narrower one is chosen."""
_ALONG = 0.85
"""Cosine of the largest angle between the force and the shortest line across the gap: friction."""
_REST = 9.0
"""Square of the torques that a pinch may leave unexplained, in deviations of free motion [1]: 94 % of the chi-square
distribution of the four degrees of freedom that a force does not explain."""
_EXPLAINED = 27.0
"""Least square of the torques that it has to explain [1]. One of 297 contacts from outside satisfied both bounds."""
_ON_AXIS_M = 1e-9
"""Distance from a capsule's axis below which no direction leads away from it [m]."""
