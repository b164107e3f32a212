"""The time that the path is blocked grows while the hand is kept from it, and ends when the way is clear."""

import numpy as np
import pytest

from pretouch.control.blocked import time_blocked

AHEAD = np.array([0.0, 0.3, 0.0])
DT = 0.01


def after(cycles: int, part: float, before: float = 0.0, limit: float = 0.03, hand: bool = True) -> float:
    """Time blocked after so many cycles at a part of the speed asked for, with something straight ahead."""
    ahead, limits = np.array([[0.0, 1.0, 0.0]]), np.array([limit])
    for _ in range(cycles):
        before = time_blocked(before, AHEAD, part * AHEAD, ahead, limits, np.array([hand]), DT)
    return before


def test_it_grows_while_something_near_the_hand_takes_most_of_the_speed():
    assert after(50, 0.1) == pytest.approx(0.5)


def test_a_link_before_the_hand_and_a_row_that_does_not_bind_block_nothing():
    assert after(50, 0.1, hand=False) == 0.0
    assert after(50, 0.1, limit=0.5) == 0.0


def test_it_stays_while_the_arm_is_slow_and_ends_when_the_way_is_clear():
    assert after(1, 0.7, before=0.5) == 0.5
    assert after(1, 0.1, before=0.5, limit=0.5) == 0.5
    assert after(1, 0.9, before=0.5) == 0.0


def test_nothing_asked_for_is_no_path_that_could_be_blocked():
    still, none = np.zeros(3), np.zeros((0, 3))
    assert time_blocked(0.5, still, still, none, np.zeros(0), np.zeros(0, np.bool_), DT) == 0.0
