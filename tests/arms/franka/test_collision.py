from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from pretouch.arms.franka.limits import BIAS_N, collision_behavior, largest_threshold
from pretouch.contact.detector import Body
from pretouch.contact.residual_model import sequential_init, sequential_numbers
from pretouch.contact.sequential import Moment
from pretouch.contact.sequential_step import SampleTest, assess_sample
from pretouch.errors import ParameterError
from pretouch.profiles import PROFILES, profile
from pretouch.records import zeros
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import no_obstacles


@pytest.mark.parametrize("name", PROFILES)
def test_ours_lies_below_the_lower_and_that_below_the_upper_threshold(name: str, panda_model: RobotModel) -> None:
    behavior = collision_behavior(profile(name), panda_model)
    assert np.all(largest_threshold(profile(name), panda_model) < behavior.lower_force[:3])
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


def test_a_higher_threshold_of_ours_raises_the_arms(panda_model: RobotModel) -> None:
    higher = collision_behavior(profile("paper:detect.f_base_n=20"), panda_model)
    assert higher.upper_force[0] == collision_behavior(profile("paper"), panda_model).upper_force[0] + 10.0


def test_a_detector_that_cannot_tell_what_it_misses_is_refused(panda_model: RobotModel) -> None:
    for missed_n in (np.nan, np.inf):
        own = replace(profile("paper"), detect=Mock(largest_missed_n=lambda *_, n=missed_n: n, by_torques=False))
        with pytest.raises(ParameterError, match=f"may miss {missed_n} N"):
            collision_behavior(own, panda_model)


def evidence(model: RobotModel, force: np.ndarray) -> float:
    """Evidence of one sample with a force (3,) [N] on the end-effector of an arm that has learnt nothing, and moves."""
    q, speed, p = model.description.q_ready, np.full(7, 0.3), PROFILES["pretouch"].detect
    kin, state = model.kinematics(q), sequential_init(model.n, p)
    state = state._replace(model=state.model._replace(speed=speed))
    torque, gain = model.ee_jacobian(kin)[:3].T @ force, np.ones(len(model.links))
    results = zeros(SampleTest, n=model.n, W=6)
    now = Moment(kin, speed, speed, torque, no_obstacles(), gain, False, False)
    assess_sample(state, now, sequential_numbers(model.n, 0.01, p), model.mechanism, results)
    return float(results.log_likelihood_ratio[0])


def missed(model: RobotModel) -> float:
    ours = PROFILES["pretouch"]
    return ours.detect.largest_missed_n(Body(model, Skin((), model), ours.task.control_period_s), ours.task.speed_m_s)


def test_what_the_sequential_detector_may_miss_is_what_it_misses(panda_model: RobotModel) -> None:
    most = missed(panda_model)
    assert 30.0 < most < 50.0
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        assert evidence(panda_model, 1.02 * most * axis) >= 1.0
    assert min(evidence(panda_model, 0.98 * most * axis) for axis in np.eye(3)) < 1.0


def test_ours_stops_by_itself_later_than_it_is_felt_and_before_it_hurts(panda_model: RobotModel) -> None:
    ours = PROFILES["pretouch"]
    behavior = collision_behavior(ours, panda_model)
    felt = missed(panda_model)
    assert np.all(behavior.lower_force[:3] >= felt + 6.0)
    assert np.all(behavior.upper_force[:3] >= felt + 12.0)
    face_n, bias_n = 65.0, BIAS_N
    assert np.all(behavior.upper_force[:3] + bias_n <= face_n)


def test_an_arm_that_is_pushed_yields_in_any_direction_before_it_stops_by_itself(panda_model: RobotModel) -> None:
    p, q = PROFILES["pretouch"].react, panda_model.description.q_ready
    J = panda_model.ee_jacobian(panda_model.kinematics(q))[:3]
    band = p.dead_band_nm + p.dead_band_fraction * panda_model.description.tau_max
    draw, force = np.random.default_rng(1), collision_behavior(PROFILES["pretouch"], panda_model).upper_force[0]
    for axis in draw.normal(size=(200, 3)):
        torque = J.T @ (force * axis / np.linalg.norm(axis))
        v = np.sign(torque) * np.maximum(np.abs(torque) - band, 0.0) / p.damping_nm_s
        assert np.linalg.norm(J @ v) > 0.85 * p.speed_max_m_s


def test_a_detector_that_feels_too_late_for_the_arm_is_refused(panda_model: RobotModel) -> None:
    with pytest.raises(ParameterError, match=r"must stop by itself from 60 N on"):
        collision_behavior(profile("pretouch:detect.offset_prior_nm=3"), panda_model)
    with pytest.raises(ParameterError, match=r"may miss inf N"):
        collision_behavior(profile("pretouch:detect.contact_gain=0.5"), panda_model)
