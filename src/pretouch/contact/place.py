"""Contacts again and again at one place of the path: when to give up, and when to try again (design 7.6)."""

from dataclasses import replace

import numpy as np

from pretouch.params.reaction import GiveUpParams
from pretouch.types import FloatArray
from pretouch.values import value


@value
class PlaceState:
    """The last place of the path where the arm met something."""

    phase: float
    """Arc length of the first contact there [m]."""
    point: FloatArray
    """(3,) where the end-effector was [m]."""
    contacts: int
    """How many contacts, 0 for no such place."""
    seen: bool
    """Whether a unit has seen something near there."""
    clear: float
    """Time for which none has seen anything [s]."""
    waited: float
    """Time since the arm gave up [s]."""
    counted: bool
    """Whether the contact of the reaction under way is among them."""
    bound: float
    """Energy that contact may give the arm and still be one of a thing at rest [J]."""


def place_init() -> PlaceState:
    """Return the state of an arm that has met nothing."""
    return PlaceState(0.0, np.zeros(3), 0, False, 0.0, 0.0, False, 0.0)


def given_up(state: PlaceState, params: GiveUpParams | None) -> bool:
    """Whether the contacts at one place are too many."""
    return params is not None and state.contacts >= params.contacts


def met(
    state: PlaceState, phase: float, point: FloatArray, near: bool, kinetic: float, params: GiveUpParams
) -> PlaceState:
    """Count a contact made on the path at an arc length [m] with the end-effector at a point (3,) [m].

    `near` says whether something is seen near the body. `kinetic` is the energy with which the arm met it [J]: a thing
    at rest gives back no more, and as much again allows for the drives, which go on until the contact is felt.
    """
    bound = params.push_j + 2.0 * kinetic
    if state.contacts and abs(phase - state.phase) <= _PLACE_M:
        return PlaceState(state.phase, state.point, state.contacts + 1, state.seen or near, 0.0, 0.0, True, bound)
    return PlaceState(phase, point, 1, near, 0.0, 0.0, True, bound)


def pushed(state: PlaceState, energy: float) -> PlaceState:
    """Count the contact under way no longer if the energy it has given [J] is more than a thing at rest gives."""
    if not state.counted or energy <= state.bound:
        return state
    return replace(state, contacts=state.contacts - 1, counted=False) if state.contacts > 1 else place_init()


def passed(state: PlaceState, phase: float) -> PlaceState:
    """Forget the place once the arm is past it on its path."""
    return place_init() if state.contacts and phase > state.phase + _PLACE_M else state


def waited(state: PlaceState, near: bool, dt: float, params: GiveUpParams) -> PlaceState:
    """Wait one period at a place given up; after long enough it may be tried once more.

    That is when nothing is seen near any more, or, if nothing ever was, after `retry_s`.
    """
    p, seen, clear = params, state.seen or near, 0.0 if near else state.clear + dt
    time = state.waited + dt
    if clear >= _CLEAR_S if seen else time >= p.retry_s:
        return PlaceState(state.phase, state.point, p.contacts - 1, False, 0.0, 0.0, False, 0.0)
    return PlaceState(state.phase, state.point, state.contacts, seen, clear, time, False, 0.0)


_PLACE_M = 0.1
"""Contacts less than this apart along the path are at one place [m]."""
_CLEAR_S = 1.0
"""Time for which nothing is seen near before the arm that gave up tries again [s]: several readings of each unit."""
