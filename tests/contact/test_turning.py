"""Doubt where an arm accelerates hard: learnt from what is wrong there, bounded, and none elsewhere."""

import numpy as np
from tests.contact.standing_arm import means_of

from pretouch.contact.learning import learn_turning
from pretouch.contact.residual_model import add_reversal_variance, turning_init
from pretouch.contact.scatter import LENGTHS

M, S = np.diag([2.0, 1.0]), 0.04 * np.eye(2)
HARD = np.array([0.0, 10.0])


def turned(times: int, error: float, growth: np.ndarray) -> np.ndarray:
    turning, means = turning_init(2), np.full((len(LENGTHS), 2), error)
    for k in range(times):
        doubt = np.full(2, 1e-3)
        add_reversal_variance(M, growth, turning, doubt)
        learn_turning(k, means_of(S, doubt, mean=means), 0.01 / 300.0, turning)
    doubt = np.zeros(2)
    add_reversal_variance(M, growth, turning, doubt)
    return doubt


def test_what_goes_wrong_where_the_arm_turns_round_becomes_doubt_of_that_joint():
    doubt = turned(400, 0.5, HARD)
    assert doubt[0] == 0.0
    assert 0.15 < doubt[1] < 0.3


def test_it_is_bounded():
    assert turned(4000, 50.0, HARD)[1] <= 25.0


def test_without_hard_acceleration_there_is_none():
    assert not turned(400, 0.5, np.array([1.5, -1.5])).any()


def test_it_is_gone_soon_after():
    turning = turning_init(2)
    turning[1] = 0.01
    for k in range(100):
        doubt = np.zeros(2)
        add_reversal_variance(M, HARD if k == 0 else np.zeros(2), turning, doubt)
    assert doubt[1] < 0.01 * 64.0 * 0.003
