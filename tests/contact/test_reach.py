"""How far a contact may move the arm: the share of the joint velocities that is left near the bound."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.contact.reach import BRAKES_S, axis_ends, within_reach
from pretouch.robot.model import RobotModel

REACH = 0.3
TURN = np.eye(7)[0]
"""About the base's vertical axis [rad/s]."""


def slowed(model: RobotModel, q, qd, origin):
    kin = model.kinematics(q)
    return within_reach(qd, kin, model.moved_by, model.body, origin, REACH)


def ends(model: RobotModel, q):
    return axis_ends(model.body, model.kinematics(q))


def test_where_the_contact_began_nothing_is_slower(panda_model: RobotModel):
    q = panda_model.description.q_ready
    velocity, moved = slowed(panda_model, q, TURN, ends(panda_model, q))
    assert np.array_equal(velocity, TURN)
    assert moved == pytest.approx(0.0, abs=1e-9)


def test_near_the_bound_the_speed_away_falls_to_what_is_left_over_the_time_constant(panda_model: RobotModel):
    q = panda_model.description.q_ready
    origin, turned = ends(panda_model, q), q + 0.8 * TURN
    # the chord of the farthest end, which turns about the vertical axis through the base
    radius = np.linalg.norm(origin[..., :2], axis=-1).max()
    far = 2.0 * radius * np.sin(0.4)
    assert 0.2 < far < REACH
    velocity, moved = slowed(panda_model, turned, 10.0 * TURN, origin)
    assert moved == pytest.approx(far)
    # along the chord an end is faster by the radius times the cosine of half the angle
    assert velocity[0] * radius * np.cos(0.4) == pytest.approx((REACH - far) / BRAKES_S)


def test_beyond_the_bound_the_way_back_is_free_and_the_way_on_is_not(panda_model: RobotModel):
    q = panda_model.description.q_ready
    origin, beyond = ends(panda_model, q), q + 1.2 * TURN
    assert not slowed(panda_model, beyond, TURN, origin)[0].any()
    back, moved = slowed(panda_model, beyond, -TURN, origin)
    assert moved > REACH
    assert np.array_equal(back, -TURN)


@given(st.lists(st.floats(-0.6, 0.6), min_size=7, max_size=7), st.lists(st.floats(-2, 2), min_size=7, max_size=7))
def test_no_joint_turns_round_and_no_end_is_faster_away_than_is_allowed(panda_model, turned, qd):
    q, dt = panda_model.description.q_ready, 1e-6
    origin, there, wanted = ends(panda_model, q), q + np.array(turned), np.array(qd)
    velocity, moved = slowed(panda_model, there, wanted, origin)
    share = velocity @ wanted / max(wanted @ wanted, 1e-300)
    assert -1e-12 <= share <= 1.0 + 1e-12
    np.testing.assert_allclose(velocity, share * wanted, atol=1e-12)
    far = np.linalg.norm(ends(panda_model, there) - origin, axis=-1)
    assert moved == pytest.approx(far.max())
    later = np.linalg.norm(ends(panda_model, there + dt * velocity) - origin, axis=-1)
    allowed = np.maximum(0.0, REACH - far) / BRAKES_S
    assert np.all(((later - far) / dt <= allowed + 1e-4) | (far < 1e-5))
