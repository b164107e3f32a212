"""Eq. 12 by numbers: the arm moves the way it was pushed, not too fast, and for a while."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pretouch.contact import reaction
from pretouch.params import ReactionParams


def test_eq_12_by_numbers():
    force = reaction.external_force(np.array([2.0, -12.0, 0.0]), np.array([0.5, -2.0, 0.0]))
    np.testing.assert_allclose(force, [1.5, -10.0, 0.0])
    # C = 0.02: 0.02 * 1.5 = 0.03, 0.02 * -10 = -0.2
    np.testing.assert_allclose(reaction.reaction_velocity(force, 0.02, 0.3), [0.03, -0.2, 0.0])


def test_the_norm_is_clipped_not_the_axes():
    # 0.03 * (30, 40, 0) = (0.9, 1.2, 0), norm 1.5; scaled by 0.3 / 1.5 = 0.2
    velocity = reaction.reaction_velocity(np.array([30.0, 40.0, 0.0]), 0.03, 0.3)
    np.testing.assert_allclose(velocity, [0.18, 0.24, 0.0])


def test_no_force_moves_nothing():
    np.testing.assert_array_equal(reaction.reaction_velocity(np.zeros(3), 0.03, 0.3), 0.0)


def test_decay_is_linear_and_ends():
    params = ReactionParams(compliance_m_s_n=0.02, decay_cycles=4)
    state = reaction.start_reaction(np.array([0.0, 10.0, 0.0]), params)
    speeds, active = [], []
    for _ in range(6):
        speeds.append(reaction.decayed(state, params)[1])
        active.append(reaction.active(state, params))
        state = reaction.advance(state)
    # 0.02 * 10 = 0.2 m/s, then a quarter less each cycle
    np.testing.assert_allclose(speeds, [0.2, 0.15, 0.1, 0.05, 0.0, 0.0])
    assert active == [True, True, True, True, False, False]


def test_before_any_contact_there_is_no_reaction():
    params = ReactionParams()
    state = reaction.reaction_init(params)
    assert not reaction.active(state, params)
    np.testing.assert_array_equal(reaction.decayed(state, params), 0.0)


@given(arrays(np.float64, 3, elements=st.floats(-1e4, 1e4)))
@settings(deadline=None, derandomize=True, max_examples=200)
def test_velocity_points_along_the_force_within_the_bound(force: np.ndarray):
    velocity = reaction.reaction_velocity(force, 0.03, 0.3)
    speed, size = np.linalg.norm(velocity), np.linalg.norm(force)
    assert speed <= 0.3 * (1 + 1e-12)
    # parallel, and never against the push: v . F = |v| |F|
    assert velocity @ force >= speed * size * (1 - 1e-9)
    np.testing.assert_allclose(speed, min(0.3, 0.03 * size), rtol=1e-9, atol=1e-15)
