"""Eq. 12 by numbers: the arm moves the way it was pushed, not too fast, and for a while."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pretouch.contact.admittance import Admittance
from pretouch.contact.reaction import DecayingVelocity, reaction_velocity


@pytest.mark.parametrize(
    ("force", "compliance", "velocity"),
    [
        # C = 0.02: 0.02 * 1.5 = 0.03, 0.02 * -10 = -0.2
        ((1.5, -10.0, 0.0), 0.02, (0.03, -0.2, 0.0)),
        # not the axes are clipped, but the norm: 0.03 * (30, 40, 0) = (0.9, 1.2, 0), norm 1.5; scaled by 0.3 / 1.5
        ((30.0, 40.0, 0.0), 0.03, (0.18, 0.24, 0.0)),
        ((0.0, 0.0, 0.0), 0.03, (0.0, 0.0, 0.0)),
    ],
)
def test_eq_12_by_numbers(force: tuple, compliance: float, velocity: tuple):
    np.testing.assert_allclose(reaction_velocity(np.array(force), compliance, 0.3), velocity)


def test_decay_is_linear_and_ends():
    part = DecayingVelocity(compliance_m_s_n=0.02, decay_cycles=4)
    state = part.begun(np.array([0.0, 10.0, 0.0]))
    speeds, active = [], []
    for _ in range(6):
        speeds.append(state.decayed(4)[1])
        active.append(part.active(state))
        state = state.advanced()
    # 0.02 * 10 = 0.2 m/s, then a quarter less each cycle
    np.testing.assert_allclose(speeds, [0.2, 0.15, 0.1, 0.05, 0.0, 0.0])
    assert active == [True, True, True, True, False, False]


def test_without_an_arm_an_answer_lasts_as_long_as_the_reaction_or_that_of_the_paper():
    short = DecayingVelocity(decay_cycles=25)
    assert DecayingVelocity.of(short, 0.001) is short
    assert DecayingVelocity.of(Admittance(), 0.01) == DecayingVelocity()
    assert DecayingVelocity.of(Admittance(), 0.001).decay_cycles == 2000


@given(arrays(np.float64, 3, elements=st.floats(-1e4, 1e4)))
@settings(deadline=None, derandomize=True, max_examples=200)
def test_velocity_points_along_the_force_within_the_bound(force: np.ndarray):
    velocity = reaction_velocity(force, 0.03, 0.3)
    speed, size = np.linalg.norm(velocity), np.linalg.norm(force)
    assert speed <= 0.3 * (1 + 1e-12)
    # parallel, and never against the push: v . F = |v| |F|
    assert velocity @ force >= speed * size * (1 - 1e-9)
    np.testing.assert_allclose(speed, min(0.3, 0.03 * size), rtol=1e-9, atol=1e-15)
