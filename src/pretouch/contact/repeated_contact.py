"""Repeated contacts at one location of the path: when the arm gives up, and when it tries again."""

from dataclasses import replace

import numpy as np

from pretouch.params import GiveUpParams
from pretouch.types import FloatArray
from pretouch.values import value


@value
class PathContact:
    """A contact of the arm with an object during its task."""

    phase: float
    """Arc length along the path [m]."""
    point: FloatArray
    """(3,) end-effector origin [m]."""
    q: FloatArray
    """(n,) joint positions [rad]."""
    lever: FloatArray
    """(n,) external torques for each newton of force [m]: times joint velocities, a speed along the force [m/s]."""
    command: FloatArray
    """(n,) last joint velocity command [rad/s]."""
    kinetic: float
    """Kinetic energy of the arm at the contact [J]."""


@value
class RepeatedContactState:
    """The last location of contacts on the path. Recordings store these names."""

    met: PathContact | None
    """The last contact there, with phase and point of the first; None without a location."""
    contacts: int
    """Number of contacts, 0 without a location."""
    seen: bool
    """True if a unit has seen an obstacle near there."""
    nothing_seen: float
    """Time for which no unit has seen one [s]."""
    waited: float
    """Time since the arm gave up [s]."""
    counted: bool
    """True if the contact of the present reaction is counted."""
    bound: float
    """Energy that an object at rest gives the arm at that contact, at most [J]."""
    touched: float = -np.inf
    """Arc length of the last contact, counted or not [m]."""


def repeated_contact_init(touched: float = -np.inf) -> RepeatedContactState:
    """Return the state without a location; the arc length of the last contact is `touched` [m]."""
    return RepeatedContactState(None, 0, False, 0.0, 0.0, False, 0.0, touched)


def add_contact(
    state: RepeatedContactState, collision: PathContact, near: bool, params: GiveUpParams
) -> RepeatedContactState:
    """Add a contact that begins, and count it if the arm ran into something.

    It did if it moved against the force, fast enough to cause the contact, and had advanced along its path since the
    contact before. An object that touches an arm at rest, or one that settles again after such a touch, has moved by
    itself, and so has one that pushes the arm on.

    A contact with an object at rest repeats at its location and from the same side. A hand that touches the arm lightly
    here and there has another location each time. An object at rest returns no more energy than the arm brought; as
    much again allows for the drives, which push on until the detection.

    `near` says whether an obstacle is near the body.
    """
    if float(collision.lever @ collision.command) >= -_CLOSING_M_S or collision.phase <= state.touched + _ADVANCED_M:
        return replace(state, counted=False, touched=collision.phase)
    contacts, before = 1, state.met
    if before is not None and abs(collision.phase - before.phase) <= _LOCATION_M and _same_object(before, collision):
        # the location stays that of the first contact: the arm would never pass a creeping one
        there = replace(collision, phase=before.phase, point=before.point)
        contacts, near = state.contacts + 1, state.seen or near
    else:
        there = collision
    bound = params.push_j + 2.0 * collision.kinetic
    return RepeatedContactState(there, contacts, near, 0.0, 0.0, True, bound, collision.phase)


def is_given_up(state: RepeatedContactState, params: GiveUpParams | None) -> bool:
    """Return whether the contacts at one location are too many."""
    return params is not None and state.contacts >= params.contacts


def _same_object(before: PathContact, collision: PathContact) -> bool:
    """Return whether a contact can be with the same object at rest as the one before."""
    sizes = float(np.linalg.norm(before.lever) * np.linalg.norm(collision.lever))
    alike = float(before.lever @ collision.lever) >= _ALIKE * sizes
    return alike and -_SHORT_M <= _farther(before, collision.q) <= _FARTHER_M


def _farther(contact: PathContact, q: FloatArray) -> float:
    """Return how far the arm at joint positions (n,) is beyond a contact, against its force [m].

    That is the work against the force, for each newton: to first order the displacement of the touched point.
    """
    return -float(contact.lever @ (q - contact.q))


def discount_push(state: RepeatedContactState, energy: float) -> RepeatedContactState:
    """Discount the present contact if it has given more energy [J] than an object at rest gives."""
    if not state.counted or energy <= state.bound:
        return state
    # a push by somebody says nothing about the location
    if state.contacts > 1:
        return replace(state, contacts=state.contacts - 1, counted=False)
    return repeated_contact_init(state.touched)


def forget_passed(state: RepeatedContactState, phase: float, q: FloatArray) -> RepeatedContactState:
    """Forget the location once the arm is past it: along its path, or where an object at rest would block it."""
    last = state.met
    passed = last is not None and (_farther(last, q) > _FARTHER_M or phase > last.phase + _LOCATION_M)
    return repeated_contact_init(state.touched) if passed else state


def wait_to_retry(state: RepeatedContactState, near: bool, dt: float, params: GiveUpParams) -> RepeatedContactState:
    """Wait one period at a location given up; after a time the arm may try it once more.

    That is when no obstacle is near any more, or, if none ever was, after `retry_s`.
    """
    # one sighting is enough: an object that was seen there has gone when it is out of view
    p, visible, nothing_seen = params, state.seen or near, 0.0 if near else state.nothing_seen + dt
    time = state.waited + dt
    if nothing_seen >= _CLEAR_S if visible else time >= p.retry_s:
        # one contact less than for giving up: the next contact ends the attempt
        return replace(
            state, contacts=p.contacts - 1, seen=False, nothing_seen=0.0, waited=0.0, counted=False, bound=0.0
        )
    return replace(state, seen=visible, nothing_seen=nothing_seen, waited=time, counted=False, bound=0.0)


_LOCATION_M = 0.1
"""Contacts within this distance along the path are at one location [m]."""
_CLEAR_S = 1.0
"""Time without an obstacle near before the arm tries again [s]: several readings of each unit."""
_CLOSING_M_S = 0.02
"""Least speed against the force with which the arm runs into something [m/s]: at boards it was 0.04 m/s and more. An
arm at rest that is touched lightly again and again settles at up to 0.018 m/s."""
_ADVANCED_M = 1e-4
"""Least advance along the path from one contact with an object at rest to the next [m]: at boards 0.5 mm and more; at
the end of the path 0."""
_SHORT_M = 0.01
"""Largest distance of a contact before the last one with an object at rest [m]: at boards 3 mm at most."""
_FARTHER_M = 0.02
"""Largest distance beyond it, against the force, of a contact, or of the arm without one [m]: along a board of 2 N/mm
beside the circle the arm slides on by 0.014 m from one contact to the next."""
_ALIKE = 0.5
"""Least cosine between the torques of two contacts with an object at rest: with boards at least 0.77."""
