from dataclasses import replace

import numpy as np
import pytest

from pretouch.errors import ParameterError
from pretouch.hardware.franka.collision import (
    CollisionParams,
    check,
    collision_behavior,
    largest_threshold,
    longest_levers,
)
from pretouch.params import PROFILES, profile
from pretouch.robot.model import RobotModel


@pytest.mark.parametrize("name", PROFILES)
def test_ours_lies_below_the_lower_and_that_below_the_upper_threshold(name: str, panda_model: RobotModel) -> None:
    behavior = collision_behavior(profile(name), panda_model)
    ours = largest_threshold(profile(name), CollisionParams())
    assert np.all(ours < behavior.lower_force[:3])
    assert np.all(behavior.lower_force < behavior.upper_force)
    assert np.all(behavior.lower_torque < behavior.upper_torque)


def test_the_papers_parameters_let_the_arm_stop_between_40_and_60_n(panda_model: RobotModel) -> None:
    behavior = collision_behavior(profile("paper"), panda_model)
    assert np.all((behavior.upper_force[:3] >= 40.0) & (behavior.upper_force[:3] <= 60.0))


def test_no_posture_turns_a_force_below_the_threshold_into_a_joint_reflex(panda_model: RobotModel) -> None:
    draw = np.random.default_rng(3)
    behavior = collision_behavior(profile("paper"), panda_model)
    for _ in range(300):
        q = draw.uniform(panda_model.q_min, panda_model.q_max)
        jacobian = panda_model.ee_jacobian(panda_model.kinematics(q))[:3]
        force = draw.normal(size=3)
        force *= 0.95 * behavior.upper_force[0] / np.linalg.norm(force)
        assert np.all(np.abs(jacobian.T @ force) < behavior.upper_torque)


def test_levers_are_the_reach_of_the_arm(panda_model: RobotModel) -> None:
    levers = longest_levers(panda_model)
    assert 0.855 < levers[0] < 1.0  # the vendor's reach, and the hand
    assert levers[6] < 1e-9


def test_a_higher_threshold_of_ours_raises_the_arms(panda_model: RobotModel) -> None:
    higher = collision_behavior(profile("paper:threshold.f_base_n=20"), panda_model)
    assert higher.upper_force[0] == collision_behavior(profile("paper"), panda_model).upper_force[0] + 10.0


def test_thresholds_in_the_wrong_order_are_refused(panda_model: RobotModel) -> None:
    good = collision_behavior(profile("paper"), panda_model)
    with pytest.raises(ParameterError, match=r"report a contact from 15 N, but ours is felt from up to 18 N: give"):
        check(replace(good, lower_force=np.full(6, 15.0)), profile("paper"))
    with pytest.raises(ParameterError, match=r"upper_torque\[0\] is 5: it must be greater than the lower"):
        check(replace(good, upper_torque=np.full(7, 5.0)), profile("paper"))
    with pytest.raises(ParameterError, match=r"upper_force\[0\] is nan"):
        check(replace(good, upper_force=np.full(6, np.nan)), profile("paper"))
    with pytest.raises(ParameterError, match=r"upper_force\[0\] is 23"):
        collision_behavior(profile("paper"), panda_model, CollisionParams(upper_above_n=5.0))
