"""Contacts again and again at one location of the path: when the arm gives up, and when it tries again."""

from dataclasses import replace

import numpy as np

from pretouch.params import GiveUpParams
from pretouch.types import FloatArray
from pretouch.values import value


@value
class RepeatedContactState:
    """The last location on the path where the arm met something. Recordings keep these names."""

    phase: float
    """Arc length of the first contact there [m]."""
    point: FloatArray
    """(3,) where the end-effector was [m]."""
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
    q: FloatArray
    """(n,) joint positions at the last contact there [rad]; (0,) for no such location."""
    lever: FloatArray
    """(n,) external torques of that contact for each newton of its force [m]; (0,) for no such location."""
    touched: float = -np.inf
    """Arc length of the last contact of all, counted or not [m]."""


@value
class Met:
    """A contact in the arm's task."""

    phase: float
    """Arc length along the path [m]."""
    point: FloatArray
    """(3,) where the end-effector is [m]."""
    q: FloatArray
    """(n,) joint positions [rad]."""
    torque: FloatArray
    """(n,) external torques [Nm]."""
    force: float
    """Size of its force [N]."""
    command: FloatArray
    """(n,) joint velocities commanded last [rad/s]."""
    kinetic: float
    """Energy with which the arm met it [J]."""

    @property
    def lever(self) -> FloatArray:
        """(n,) torques for each newton [m]: their product with joint velocities is a speed along the force [m/s]."""
        return self.torque / max(self.force, _LEAST_N)


def meet(state: RepeatedContactState, met: Met, near: bool, params: GiveUpParams) -> RepeatedContactState:
    """Take in a contact that begins, and count it if the arm ran into something.

    It did if it moved against the force, fast enough to be what brought that about, and had come on along its path
    since the contact before. What touches an arm that stands, or settles again after such a touch, has come by itself;
    what pushes it on has too.
    """
    against = float(met.lever @ met.command) < -_CLOSING_M_S
    if against and met.phase > state.touched + _ADVANCED_M:
        state = count_contact(state, met, near, params)
    else:
        state = replace(state, counted=False)
    return replace(state, touched=met.phase)


def repeated_contact_init() -> RepeatedContactState:
    """Return the state of an arm that has met nothing."""
    return RepeatedContactState(0.0, np.zeros(3), 0, False, 0.0, 0.0, False, 0.0, np.zeros(0), np.zeros(0))


def given_up(state: RepeatedContactState, params: GiveUpParams | None) -> bool:
    """Whether the contacts at one location are too many."""
    return params is not None and state.contacts >= params.contacts


def count_contact(state: RepeatedContactState, met: Met, near: bool, params: GiveUpParams) -> RepeatedContactState:
    """Count a contact that the arm ran into on its path.

    An object at rest is met where it was met before, and from the same side. A hand that touches the arm lightly, now
    here and now there, is met at another location each time.

    `near` says whether something is seen near the body. An object at rest gives back no more energy than the arm
    brought, and as much again allows for the drives, which go on until it is detected.
    """
    bound = params.push_j + 2.0 * met.kinetic
    if state.contacts and abs(met.phase - state.phase) <= _LOCATION_M and _same_object(state, met):
        # the location stays that of the first contact: one that crept along would never be passed
        return RepeatedContactState(
            state.phase, state.point, state.contacts + 1, state.seen or near, 0.0, 0.0, True, bound, met.q, met.lever
        )  # fmt: skip
    return RepeatedContactState(met.phase, met.point, 1, near, 0.0, 0.0, True, bound, met.q, met.lever)


def _same_object(state: RepeatedContactState, met: Met) -> bool:
    """Whether a contact can be with the object at rest that the arm met last at a location."""
    sizes = float(np.linalg.norm(state.lever) * np.linalg.norm(met.lever))
    alike = float(state.lever @ met.lever) >= _ALIKE * sizes
    return alike and -_SHORT_M <= _farther(state.q, state.lever, met.q) <= _FARTHER_M


def _farther(q: FloatArray, lever: FloatArray, now: FloatArray) -> float:
    """How much farther against a force the arm has come from joint positions q (n,) [rad] to those of `now` [m].

    That is the work against the force, for each newton: to first order the way of the touched point, wherever it is.
    """
    return -float(lever @ (now - q))


def discount_push(state: RepeatedContactState, energy: float) -> RepeatedContactState:
    """Count the contact under way no longer if it has given more energy [J] than an object at rest gives."""
    if not state.counted or energy <= state.bound:
        return state
    # somebody pushes: that says nothing of the location
    if state.contacts > 1:
        return replace(state, contacts=state.contacts - 1, counted=False)
    return _nowhere(state)


def _nowhere(state: RepeatedContactState) -> RepeatedContactState:
    """Forget the location, and keep where the last contact was."""
    return replace(repeated_contact_init(), touched=state.touched)


def forget_passed(state: RepeatedContactState, phase: float, q: FloatArray) -> RepeatedContactState:
    """Forget the location once the arm is past it: on its path, or where an object at rest would be in its way."""
    if not state.contacts:
        return state
    there = _farther(state.q, state.lever, q) > _FARTHER_M
    return _nowhere(state) if there or phase > state.phase + _LOCATION_M else state


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
_LEAST_N = 5.0
"""Least force by which torques are divided [N]: the estimate of a smaller one is mostly noise."""
