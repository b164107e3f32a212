"""Giving up at a location of the path, and trying again."""

import numpy as np
import pytest

from pretouch.contact.repeated_contact import (
    count_contact,
    discount_push,
    forget_passed,
    given_up,
    repeated_contact_init,
    wait_to_retry,
)
from pretouch.params import GiveUpParams

P = GiveUpParams(contacts=3, retry_s=30.0)
X = np.array([0.5, 0.1, 0.3])
ENERGY = P.push_j + 0.01


def after(*phases: float, near: bool = False):
    state = repeated_contact_init()
    for phase in phases:
        state = count_contact(forget_passed(state, phase), phase, X, near, 0.0, P)
    return state


def cycles(state, near: bool, params: GiveUpParams = P) -> int:
    count = 0
    while given_up(state, params):
        state, count = wait_to_retry(state, near, 0.01, params), count + 1
        if count > 10_000:
            raise AssertionError("never tried again")
    return count


@pytest.mark.parametrize(
    ("phases", "expected"),
    [((1.0, 1.05), False), ((1.0, 1.05, 1.09), True), ((1.0, 1.2, 1.4), False), ((1.0, 1.0, 1.15, 1.15, 1.15), True)],
)
def test_it_gives_up_after_three_contacts_at_one_location(phases, expected):
    assert given_up(after(*phases), P) is expected


def test_it_never_gives_up_when_that_is_off():
    assert not given_up(after(*[1.0] * 50), None)


def test_a_location_that_was_passed_is_forgotten():
    assert forget_passed(after(1.0, 1.0), 1.09).contacts == 2
    assert forget_passed(after(1.0, 1.0), 1.11).contacts == 0


def test_it_tries_again_once_what_was_seen_is_gone_and_gives_up_sooner():
    state = after(1.0, 1.0, 1.0, near=True)
    for _ in range(5000):
        state = wait_to_retry(state, True, 0.01, P)
    assert given_up(state, P)
    assert cycles(state, near=False) in (100, 101)
    for _ in range(101):
        state = wait_to_retry(state, False, 0.01, P)
    assert given_up(count_contact(state, 1.0, X, False, 0.0, P), P)


def test_what_no_unit_ever_saw_is_tried_again_after_a_long_time():
    assert cycles(after(1.0, 1.0, 1.0), near=False) in (3000, 3001)


def test_a_person_s_push_counts_for_no_location():
    state = discount_push(discount_push(after(1.0, 1.0, 1.0), ENERGY), ENERGY)
    assert state.contacts == 2, "only the contact under way"
    assert discount_push(after(1.0), ENERGY).contacts == 0
    assert not given_up(discount_push(count_contact(state, 1.0, X, False, 0.0, P), ENERGY), P)


def test_a_thing_met_fast_may_give_back_what_the_arm_brought():
    fast = count_contact(repeated_contact_init(), 1.0, X, False, 0.2, P)
    assert discount_push(fast, P.push_j + 0.39).contacts == 1
    assert discount_push(fast, P.push_j + 0.41).contacts == 0
