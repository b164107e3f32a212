"""From joint positions and IMU data to where units sit, on data made by finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.values import CalibrationData
from pretouch.errors import CalibrationError, RobotModelError
from pretouch.sim.random_skin import random_skin
from tests.calibration.made import EXACT, MovingArm, Noise, pose_error


def test_exact_data_give_the_exact_place(panda_model, moving_arm, pair):
    found = calibrate(panda_model, moving_arm.data(pair, noise=EXACT))
    for unit, true in zip(found.units, pair.units, strict=True):
        error = pose_error(true.T_link_sensor, unit.place.T_link_sensor)
        assert np.abs(error[:3]).max() < 2e-5
        assert np.abs(error[3:]).max() < 2e-5
        assert unit.findings == ()


def test_a_whole_skin_is_found_without_any_finding(panda_model, moving_arm, whole_skin):
    found = calibrate(panda_model, moving_arm.data(whole_skin, links_known=False))
    assert found.findings == ()
    for unit, true in zip(found.units, whole_skin.units, strict=True):
        error = pose_error(true.T_link_sensor, unit.place.T_link_sensor)
        assert (unit.id, unit.accepted, unit.findings) == (true.id, True, ())
        assert unit.place.link == true.link
        assert np.linalg.norm(error[3:]) < 1e-3
        assert np.linalg.norm(error[:3]) < np.deg2rad(0.05)


def test_clock_and_biases_are_found_with_the_place(panda_model, moving_arm, pair):
    found = calibrate(panda_model, moving_arm.data(pair, seed=3))
    for unit in pair.units:
        rng = np.random.default_rng([3, *unit.id.encode()])
        late = 0.02 * rng.uniform(-1, 1)
        place = next(one.place for one in found.units if one.id == unit.id)
        assert place.clock_offset == pytest.approx(late, abs=2e-4)
        factor, bias = 1 + 0.008 * rng.standard_normal(3), 0.3 * rng.standard_normal(3)
        assert place.acceleration_bias == pytest.approx(bias, abs=0.01)
        assert place.acceleration_scale == pytest.approx(factor - 1, abs=0.002)


@pytest.mark.slow
def test_what_is_said_of_errors_is_true_of_them(panda_model):
    arm, nees = MovingArm(panda_model, 60.0), []  # as long as the motion that is planned by default
    for seed in range(6):
        skin = random_skin(panda_model, 20 + seed)
        for unit, true in zip(calibrate(panda_model, arm.data(skin, seed)).units, skin.units, strict=True):
            error = pose_error(true.T_link_sensor, unit.place.T_link_sensor)
            nees.append(error @ np.linalg.solve(unit.place.covariance, error))
    # 42 values of a chi-squared distribution of 6 degrees of freedom: their mean has the standard deviation 0.53
    assert 4.0 < np.mean(nees) < 9.0


def test_covariances_are_symmetric_and_positive_even_where_nothing_is_known(panda_model, moving_arm):
    skin = random_skin(panda_model, 3, first_link=True)
    for unit in calibrate(panda_model, moving_arm.data(skin)).units:
        C = unit.place.covariance
        assert pytest.approx(C.T, rel=1e-12) == C
        assert np.linalg.eigvalsh(C)[0] > 0
        assert np.isfinite(C).all()


def test_two_units_of_one_name_are_refused(panda_model, good):
    with pytest.raises(CalibrationError, match="on_panda_hand is used more than once"):
        calibrate(panda_model, CalibrationData(good.joints, (good.units[1], good.units[1])))


def test_a_link_that_the_arm_does_not_have_is_refused(panda_model, good):
    with pytest.raises(RobotModelError, match="panda_elbow"):
        calibrate(panda_model, replace(good, units=(replace(good.units[0], link="panda_elbow"),)))


def test_stamps_may_count_from_long_ago(panda_model, good, pair):
    ago = 1.7e9
    units = tuple(replace(unit, imu=replace(unit.imu, stamp=unit.imu.stamp + ago)) for unit in good.units)
    found = calibrate(panda_model, CalibrationData(replace(good.joints, stamp=good.joints.stamp + ago), units))
    for unit, true in zip(found.units, pair.units, strict=True):
        assert unit.findings == ()
        assert np.linalg.norm(pose_error(true.T_link_sensor, unit.place.T_link_sensor)[3:]) < 1e-3


def test_noise_of_the_joints_may_hide_a_place(panda_model, moving_arm, pair):
    found = calibrate(panda_model, moving_arm.data(pair, noise=Noise(joints=1e-3)))
    (finding,) = [finding for finding in found.units[0].findings if finding.kind == "unobservable"]
    assert "record joint positions with all their digits" in finding.sentence
