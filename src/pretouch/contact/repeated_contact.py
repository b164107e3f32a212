"""Contacts again and again at one location of the path: when the arm gives up, and when it tries again."""

from dataclasses import replace

import numpy as np

from pretouch.params import GiveUpParams
from pretouch.types import FloatArray
from pretouch.values import value


@value
class Met:
    """A contact in the arm's task."""

    phase: float
    """Arc length along the path [m]."""
    point: FloatArray
    """(3,) where the end-effector is [m]."""
    q: FloatArray
    """(n,) joint positions [rad]."""
    lever: FloatArray
    """(n,) external torques for each newton of force [m]: times joint velocities, a speed along the force [m/s]."""
    command: FloatArray
    """(n,) joint velocities commanded last [rad/s]."""
    kinetic: float
    """Energy with which the arm met it [J]."""


@value
class RepeatedContactState:
    """The last location on the path where the arm met something. Recordings keep these names."""

    met: Met | None
    """The last contact there, with phase and point of the first; None for no such location."""
    contacts: int
    """How many contacts, 0 for no such location."""
    seen: bool
    """Whether a unit has seen something near there."""
    nothing_seen: float
    """Time for which none has seen anything [s]."""
    waited: float
    """Time since the arm gave up [s]."""
    counted: bool
    """Whether the contact of the reaction under way is among them."""
    bound: float
    """Energy that contact may give the arm and still be one of an object at rest [J]."""
    touched: float = -np.inf
    """Arc length of the last contact of all, counted or not [m]."""


def repeated_contact_init(touched: float = -np.inf) -> RepeatedContactState:
    """Return the state of an arm that has met nothing at a location; the last contact of all was `touched` [m]."""
    return RepeatedContactState(None, 0, False, 0.0, 0.0, False, 0.0, touched)


def meet(state: RepeatedContactState, met: Met, near: bool, params: GiveUpParams) -> RepeatedContactState:
    """Take in a contact that begins, and count it if the arm ran into something.

    It did if it moved against the force, fast enough to be what brought that about, and had come on along its path
    since the contact before. What touches an arm that stands, or settles again after such a touch, has come by itself;
    what pushes it on has too.

    An object at rest is met where it was met before, and from the same side. A hand that touches the arm lightly, now
    here and now there, is met at another location each time. An object at rest gives back no more energy than the arm
    brought, and as much again allows for the drives, which go on until it is detected.

    `near` says whether something is seen near the body.
    """
    if float(met.lever @ met.command) >= -_CLOSING_M_S or met.phase <= state.touched + _ADVANCED_M:
        return replace(state, counted=False, touched=met.phase)
    contacts, before = 1, state.met
    if before is not None and abs(met.phase - before.phase) <= _LOCATION_M and _same_object(before, met):
        # the location stays that of the first contact: one that crept along would never be passed
        there = replace(met, phase=before.phase, point=before.point)
        contacts, near = state.contacts + 1, state.seen or near
    else:
        there = met
    bound = params.push_j + 2.0 * met.kinetic
    return RepeatedContactState(there, contacts, near, 0.0, 0.0, True, bound, met.phase)


def given_up(state: RepeatedContactState, params: GiveUpParams | None) -> bool:
    """Whether the contacts at one location are too many."""
    return params is not None and state.contacts >= params.contacts


def _same_object(before: Met, met: Met) -> bool:
    """Whether a contact can be with the object at rest that the arm met before at a location."""
    sizes = float(np.linalg.norm(before.lever) * np.linalg.norm(met.lever))
    alike = float(before.lever @ met.lever) >= _ALIKE * sizes
    return alike and -_SHORT_M <= _farther(before, met.q) <= _FARTHER_M


def _farther(met: Met, q: FloatArray) -> float:
    """How much farther against the force of a contact the arm has come than there, at joint positions (n,) [m].

    That is the work against the force, for each newton: to first order the way of the touched point, wherever it is.
    """
    return -float(met.lever @ (q - met.q))


def discount_push(state: RepeatedContactState, energy: float) -> RepeatedContactState:
    """Count the contact under way no longer if it has given more energy [J] than an object at rest gives."""
    if not state.counted or energy <= state.bound:
        return state
    # somebody pushes: that says nothing of the location
    if state.contacts > 1:
        return replace(state, contacts=state.contacts - 1, counted=False)
    return repeated_contact_init(state.touched)


def forget_passed(state: RepeatedContactState, phase: float, q: FloatArray) -> RepeatedContactState:
    """Forget the location once the arm is past it: on its path, or where an object at rest would be in its way."""
    met = state.met
    passed = met is not None and (_farther(met, q) > _FARTHER_M or phase > met.phase + _LOCATION_M)
    return repeated_contact_init(state.touched) if passed else state


def wait_to_retry(state: RepeatedContactState, near: bool, dt: float, params: GiveUpParams) -> RepeatedContactState:
    """Wait one period at a location given up; after long enough it may be tried once more.

    That is when nothing is seen near any more, or, if nothing ever was, after `retry_s`.
    """
    # one sighting is enough: what was once seen there has gone when it is no longer seen
    p, seen, nothing_seen = params, state.seen or near, 0.0 if near else state.nothing_seen + dt
    time = state.waited + dt
    if nothing_seen >= _CLEAR_S if seen else time >= p.retry_s:
        # one contact less than it takes to give up: the next one ends it again
        return replace(
            state, contacts=p.contacts - 1, seen=False, nothing_seen=0.0, waited=0.0, counted=False, bound=0.0
        )
    return replace(state, seen=seen, nothing_seen=nothing_seen, waited=time, counted=False, bound=0.0)


_LOCATION_M = 0.1
"""Contacts less than this apart along the path are at one location [m]."""
_CLEAR_S = 1.0
"""Time for which nothing is seen near before the arm that gave up tries again [s]: several readings of each unit."""
_CLOSING_M_S = 0.02
"""Least speed against the force with which the arm runs into something [m/s]: boards were met at 0.04 m/s and more. An
arm that stands, and is touched lightly again and again, settles at up to 0.018 m/s."""
_ADVANCED_M = 1e-4
"""How far along its path the arm has come from one contact with an object at rest to the next [m]: at boards 0.5 mm and
more; at the end of its path nothing."""
_SHORT_M = 0.01
"""How much short of its last location an object at rest may be met [m]: boards were met 3 mm short of it at most."""
_FARTHER_M = 0.02
"""How much farther, against the force, it may be met, or the arm may come without meeting it [m]: along a board of 2
N/mm beside the circle the arm slides on by 0.014 m from one contact to the next."""
_ALIKE = 0.5
"""Least cosine between the torques of two contacts with an object at rest: with boards at least 0.77."""
