"""Giving up at a location of the path, and trying again."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.contact.repeated_contact import (
    PathContact,
    add_contact,
    discount_push,
    forget_passed,
    is_given_up,
    repeated_contact_init,
    wait_to_retry,
)
from pretouch.params import GiveUpParams

P = GiveUpParams(contacts=3, retry_s=30.0)
X = np.array([0.5, 0.1, 0.3])
ENERGY = P.push_j + 0.01
Q = np.zeros(3)
AGAINST = np.array([-10.0, 0.0, 2.0])
"""Torques of 20 N against the motion [Nm]."""
ON = np.array([0.4, 0.0, 0.0])
"""Joint velocities with which the touched point goes at 0.2 m/s [rad/s]."""


def met(phase: float = 1.0, q=Q, torque=AGAINST, command=ON, kinetic: float = 0.0) -> PathContact:
    return PathContact(phase, X, np.asarray(q, float), torque / 20.0, command, kinetic)


def count(state, one: PathContact | None = None, near: bool = False):
    """Meet something, wherever the last contact of all was."""
    return add_contact(replace(state, touched=-np.inf), one or met(), near, P)


def after(*phases: float, near: bool = False):
    state = repeated_contact_init()
    for phase in phases:
        state = count(forget_passed(state, phase, Q), met(phase), near)
    return state


def cycles(state, near: bool, params: GiveUpParams = P) -> int:
    waited = 0
    while is_given_up(state, params):
        state, waited = wait_to_retry(state, near, 0.01, params), waited + 1
        if waited > 10_000:
            raise AssertionError("never tried again")
    return waited


@pytest.mark.parametrize(
    ("phases", "expected"),
    [((1.0, 1.05), False), ((1.0, 1.05, 1.09), True), ((1.0, 1.2, 1.4), False), ((1.0, 1.0, 1.15, 1.15, 1.15), True)],
)
def test_it_gives_up_after_three_contacts_at_one_location(phases, expected):
    assert is_given_up(after(*phases), P) is expected


def test_it_never_gives_up_when_that_is_off():
    assert not is_given_up(after(*[1.0] * 50), None)


def test_a_location_that_was_passed_is_forgotten():
    assert forget_passed(after(1.0, 1.0), 1.09, Q).contacts == 2
    assert forget_passed(after(1.0, 1.0), 1.11, Q).contacts == 0


def test_it_tries_again_once_what_was_seen_is_gone_and_gives_up_sooner():
    state = after(1.0, 1.0, 1.0, near=True)
    for _ in range(5000):
        state = wait_to_retry(state, True, 0.01, P)
    assert is_given_up(state, P)
    assert cycles(state, near=False) in (100, 101)
    for _ in range(101):
        state = wait_to_retry(state, False, 0.01, P)
    assert is_given_up(count(state), P)


def test_what_no_unit_ever_saw_is_tried_again_after_a_long_time():
    assert cycles(after(1.0, 1.0, 1.0), near=False) in (3000, 3001)


def test_a_person_s_push_counts_for_no_location():
    state = discount_push(discount_push(after(1.0, 1.0, 1.0), ENERGY), ENERGY)
    assert state.contacts == 2, "only the contact under way"
    assert discount_push(after(1.0), ENERGY).contacts == 0
    assert not is_given_up(discount_push(count(state), ENERGY), P)


def test_a_thing_met_fast_may_give_back_what_the_arm_brought():
    fast = count(repeated_contact_init(), met(kinetic=0.2))
    assert discount_push(fast, P.push_j + 0.39).contacts == 1
    assert discount_push(fast, P.push_j + 0.41).contacts == 0


@pytest.mark.parametrize(
    ("command", "contacts"), [((0.4, 0.0, 0.0), 1), ((-0.4, 0.0, 0.0), 0), ((0.0, 0.4, 0.0), 0), ((0.03, 0.0, 0.0), 0)]
)
def test_what_the_arm_moves_against_counts_and_not_what_touches_it_while_it_settles(command, contacts: int):
    # 0.5 m of lever: 0.4 rad/s are 0.2 m/s against the force, 0.03 rad/s are 0.015 m/s
    found = add_contact(repeated_contact_init(), met(command=np.array(command)), False, P)
    assert (found.contacts, found.counted) == (contacts, contacts > 0)


def test_an_arm_that_goes_back_to_where_it_stood_runs_into_nothing_that_was_there():
    state = add_contact(repeated_contact_init(), met(command=np.zeros(3)), False, P)
    for _ in range(5):
        state = add_contact(state, met(), False, P)
    assert state.contacts == 0
    assert add_contact(state, met(1.001), False, P).contacts == 1, "it came on along its path"


def test_a_push_that_counts_for_no_location_is_remembered_as_the_last_contact():
    state = discount_push(add_contact(repeated_contact_init(), met(), False, P), ENERGY)
    assert add_contact(state, met(), False, P).contacts == 0


@pytest.mark.parametrize(("farther", "contacts"), [(-0.015, 1), (-0.005, 2), (0.0, 2), (0.015, 2), (0.025, 1)])
def test_an_object_at_rest_is_met_where_it_was_met_before(farther: float, contacts: int):
    there = np.array([farther / 0.5, 0.3, 0.0])
    assert count(after(1.0), met(1.05, there)).contacts == contacts, "the second joint slides along it"


@pytest.mark.parametrize(("torque", "contacts"), [((-3.0, 0.0, 0.0), 2), ((-8.0, 8.0, 0.0), 2), ((2.0, 0.0, 8.0), 1)])
def test_and_from_the_same_side(torque, contacts: int):
    assert count(after(1.0), met(torque=np.array(torque))).contacts == contacts


def test_where_the_arm_comes_farther_than_an_object_would_let_it_the_location_is_forgotten():
    state = after(1.0, 1.0)
    assert forget_passed(state, 1.02, np.array([0.03, 0.0, 0.0])).contacts == 2
    assert forget_passed(state, 1.02, np.array([0.05, 0.0, 0.0])).contacts == 0
