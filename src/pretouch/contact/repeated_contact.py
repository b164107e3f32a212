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


def repeated_contact_init() -> RepeatedContactState:
    """Return the state of an arm that has met nothing."""
    return RepeatedContactState(0.0, np.zeros(3), 0, False, 0.0, 0.0, False, 0.0)


def given_up(state: RepeatedContactState, params: GiveUpParams | None) -> bool:
    """Whether the contacts at one location are too many."""
    return params is not None and state.contacts >= params.contacts


def count_contact(
    state: RepeatedContactState, phase: float, point: FloatArray, near: bool, kinetic: float, params: GiveUpParams
) -> RepeatedContactState:
    """Count a contact made on the path at an arc length [m] with the end-effector at a point (3,) [m].

    `near` says whether something is seen near the body. `kinetic` is the energy with which the arm met it [J]: an
    object at rest gives back no more, and as much again allows for the drives, which go on until it is detected.
    """
    bound = params.push_j + 2.0 * kinetic
    if state.contacts and abs(phase - state.phase) <= _LOCATION_M:
        # the location stays that of the first contact: one that crept along would never be passed
        return RepeatedContactState(
            state.phase, state.point, state.contacts + 1, state.seen or near, 0.0, 0.0, True, bound
        )  # fmt: skip
    return RepeatedContactState(phase, point, 1, near, 0.0, 0.0, True, bound)


def discount_push(state: RepeatedContactState, energy: float) -> RepeatedContactState:
    """Count the contact under way no longer if it has given more energy [J] than an object at rest gives."""
    if not state.counted or energy <= state.bound:
        return state
    # somebody pushes: that says nothing of the location
    if state.contacts > 1:
        return replace(state, contacts=state.contacts - 1, counted=False)
    return repeated_contact_init()


def forget_passed(state: RepeatedContactState, phase: float) -> RepeatedContactState:
    """Forget the location once the arm is past it on its path."""
    return repeated_contact_init() if state.contacts and phase > state.phase + _LOCATION_M else state


def wait_to_retry(state: RepeatedContactState, near: bool, dt: float, params: GiveUpParams) -> RepeatedContactState:
    """Wait one period at a location given up; after long enough it may be tried once more.

    That is when nothing is seen near any more, or, if nothing ever was, after `retry_s`.
    """
    # one sighting is enough: what was once seen there has gone when it is no longer seen
    p, seen, nothing_seen = params, state.seen or near, 0.0 if near else state.nothing_seen + dt
    time = state.waited + dt
    if nothing_seen >= _CLEAR_S if seen else time >= p.retry_s:
        # one contact less than it takes to give up: the next one ends it again
        return RepeatedContactState(state.phase, state.point, p.contacts - 1, False, 0.0, 0.0, False, 0.0)
    return RepeatedContactState(state.phase, state.point, state.contacts, seen, nothing_seen, time, False, 0.0)


_LOCATION_M = 0.1
"""Contacts less than this apart along the path are at one location [m]."""
_CLEAR_S = 1.0
"""Time for which nothing is seen near before the arm that gave up tries again [s]: several readings of each unit."""
