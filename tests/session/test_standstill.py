"""What is seen of an arm that stands."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.errors import RobotError
from pretouch.session.standstill import watch
from tests.session.arms import PushedArm


def test_force_and_noise_at_rest_are_those_the_arm_was_given(panda_model):
    bias = np.array([1.0, -2.0, 3.0])
    arm = PushedArm(panda_model, lambda _: bias, noise=1.0)
    seen = watch(arm, arm, panda_model.description.qd_max, 10.0)
    assert np.allclose(seen.rest_wrench[:3], bias, atol=0.2)
    assert np.allclose(seen.noise, 1.0, atol=0.1)
    assert seen.disturbance < 2.0
    assert seen.missing_share == 0.0


def test_a_touch_of_a_moment_shows(panda_model):
    arm = PushedArm(panda_model, lambda t: np.array([0.0, 8.0 if 101.0 < t < 101.2 else 0.0, 0.0]))
    assert watch(arm, arm, panda_model.description.qd_max, 3.0).disturbance > 6.0


def test_one_noisy_state_in_a_span_without_others_is_no_touch(panda_model):
    arm = PushedArm(panda_model)
    seen = watch(arm, arm, panda_model.description.qd_max, 3.0)
    lone = np.searchsorted(seen.stamp, seen.stamp[0] + 1.02)
    kept = np.ones(len(seen.stamp), dtype=bool)
    kept[lone - 2 : lone + 8] = False
    kept[lone] = True
    seen.wrench[lone, 0] = 6.0
    thinned = replace(seen, stamp=seen.stamp[kept], wrench=seen.wrench[kept])
    assert thinned.disturbance < 1.0


def test_states_without_an_estimate_are_counted(panda_model):
    arm = PushedArm(panda_model)
    read, count = arm.read, iter(range(1000))
    arm.read = lambda: replace(read(), wrench=None) if next(count) % 2 else read()
    assert watch(arm, arm, panda_model.description.qd_max, 1.0).missing_share == pytest.approx(0.5, abs=0.02)


def test_a_robot_whose_state_stands_still_is_an_error(panda_model):
    arm = PushedArm(panda_model)
    state = arm.read()
    arm.read = lambda: state
    with pytest.raises(RobotError, match="sent 1 states in"):
        watch(arm, arm, panda_model.description.qd_max, 1.0)


def test_a_state_that_is_no_number_is_an_error(panda_model):
    arm = PushedArm(panda_model)
    read = arm.read
    arm.read = lambda: replace(read(), q=np.full(7, np.nan))
    with pytest.raises(RobotError, match="cannot be used"):
        watch(arm, arm, panda_model.description.qd_max, 1.0)
