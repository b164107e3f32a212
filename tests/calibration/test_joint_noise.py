"""Noise of joint positions passes for motion: what is said of a place has to allow for it."""

import numpy as np
import pytest

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.identify import Identifier
from pretouch.calibration.joint_noise import JointNoise
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.signals import rate_of_change, smooth, times
from pretouch.traces import JointTrace
from tests.calibration.made import MovingArm, Noise, pose_error

PARAMS = CalibrationParams()


@pytest.mark.parametrize("rate", [100.0, 208.0, 1000.0])
def test_the_accelerations_noise_is_told_from_the_positions(panda_model, rate):
    rng = np.random.default_rng(0)
    stamp = np.arange(0.0, 20.0, 1 / rate)
    swing = 0.4 * np.sin(2 * np.pi * 0.4 * stamp)[:, None]
    noise = 1e-4 * rng.standard_normal((len(stamp), 7))
    joints = JointTrace(stamp, panda_model.q_mid + swing + noise)
    found = JointNoise(ArmMotion(panda_model, joints, PARAMS), joints, PARAMS).acceleration
    fine = times(0.0, 19.9)
    acceleration = rate_of_change(rate_of_change(smooth(stamp, noise, fine, PARAMS)))[200:-200]
    assert found == pytest.approx(acceleration.std(axis=0), rel=0.3)


def test_a_weak_motion_and_noisy_joints_give_no_place_that_is_said_to_be_sure(panda_model, whole_skin):
    arm = MovingArm(panda_model, 40.0, swings=(0.05,) * 7)  # 3 degrees
    found = calibrate(panda_model, arm.data(whole_skin, noise=Noise(joints=1e-4)))
    errors = [
        np.linalg.norm(pose_error(true.T_link_sensor, unit.place.T_link_sensor)[3:])
        for unit, true in zip(found.units, whole_skin.units, strict=True)
    ]
    assert max(errors) > 0.02
    for unit, error in zip(found.units, errors, strict=True):
        assert error < 3 * unit.place.position_sigma
        assert error < 0.02 or not unit.accepted


def test_a_good_motion_hardly_feels_it(panda_model, moving_arm, pair):
    data = moving_arm.data(pair)
    arm = ArmMotion(panda_model, data.joints, PARAMS)
    assert JointNoise(arm, data.joints, PARAMS).acceleration.max() < 0.05
    for unit in calibrate(panda_model, data).units:
        assert unit.place.position_sigma < 5e-4


def test_noisy_joints_make_a_position_less_certain_in_every_direction(panda_model, moving_arm, pair):
    data = moving_arm.data(pair, noise=Noise(joints=1e-4))
    arm = ArmMotion(panda_model, data.joints, PARAMS)
    located = Identifier(arm, PARAMS).identify(data.units[0]).located
    added = (JointNoise(arm, data.joints, PARAMS).covariance(located) - located.covariance)[3:, 3:]
    assert np.linalg.matrix_rank(added, tol=1e-6 * np.linalg.norm(added)) == 3
