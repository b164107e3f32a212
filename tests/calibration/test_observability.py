"""What a motion tells of a pose, and what not: in one direction, or for the noise of joint positions."""

import re

import numpy as np
import pytest

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.findings import unknown_directions
from pretouch.calibration.identify import Identifier
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import JointNoise
from pretouch.calibration.signals import rate_of_change, smooth, times
from pretouch.sensing.skin import Skin
from pretouch.sim.random_skin import random_skin
from pretouch.traces import JointTrace
from tests.calibration.made import MovingArm, Noise, pose_error


def test_a_direction_is_named_by_its_coordinates():
    """All is known well, but for one direction in the link's frame, and one axis of it to turn about."""
    T, C = np.eye(4), 1e-8 * np.eye(6)
    T[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    along, turn = np.array([0.6, 0.8, 0.0]), T[:3, :3].T @ [1.0, 0.0, 0.0]
    C[3:, 3:] += 0.05**2 * np.outer(along, along)
    C[:3, :3] += 0.2**2 * np.outer(turn, turn)
    assert unknown_directions(C, T) == [
        "its position along (0.60, 0.80, 0.00) of the link (sigma 50 mm)",
        "its orientation about x of the link (sigma 11.5 degrees)",
    ]


def test_link_1_tells_its_distance_from_the_vertical_and_how_it_faces_and_no_more(panda_model, moving_arm):
    for seed in range(3):
        true = random_skin(panda_model, seed, first_link=True).units[0]
        unit = calibrate(panda_model, moving_arm.data(Skin([true], panda_model), seed)).units[0]
        assert [(finding.kind, finding.refused) for finding in unit.findings] == [("unobservable", True)]
        sentence = unit.findings[0].sentence
        assert re.search("its position along z of the link .*, and its orientation about z of the link", sentence)
        assert "panda_joint1 alone moves panda_link1" in sentence
        found, T = unit.place.T_link_sensor, true.T_link_sensor
        # the axis is z of the link
        assert np.hypot(*found[:2, 3]) == pytest.approx(np.hypot(*T[:2, 3]), abs=2e-3)
        assert found[2, :3] == pytest.approx(T[2, :3], abs=0.01)
        assert seen_from_axis(found) == pytest.approx(seen_from_axis(T), abs=0.02)


def seen_from_axis(T: np.ndarray) -> np.ndarray:
    """The sensor's axes along outwards, around and up."""
    x, y = T[:2, 3] / np.hypot(*T[:2, 3])
    return np.array([[x, y, 0], [-y, x, 0], [0, 0, 1]]) @ T[:3, :3]


def test_a_link_below_which_one_joint_moved_is_not_known_along_its_axis(panda_model, whole_skin):
    arm = MovingArm(panda_model, 30.0, stand=(0,))
    found = calibrate(panda_model, arm.data(Skin(whole_skin.units[:3], panda_model)))
    link2, link3, link4 = found.units
    (finding,) = link2.findings
    assert finding.kind == "unobservable"
    assert re.search("its position along z of the link .*, and its orientation about z of the link", finding.sentence)
    assert finding.sentence.endswith(" Move panda_joint1 (it moved by 0.0 degrees) more.")
    assert link3.accepted
    assert link4.accepted


@pytest.mark.parametrize("rate", [100.0, 208.0, 1000.0])
def test_the_accelerations_noise_is_told_from_the_positions(panda_model, rate):
    rng = np.random.default_rng(0)
    stamp = np.arange(0.0, 20.0, 1 / rate)
    swing = 0.4 * np.sin(2 * np.pi * 0.4 * stamp)[:, None]
    noise = 1e-4 * rng.standard_normal((len(stamp), 7))
    joints = JointTrace(stamp, panda_model.q_mid + swing + noise)
    found = JointNoise(ArmMotion(panda_model, joints), joints).acceleration
    fine = times(0.0, 19.9)
    acceleration = rate_of_change(rate_of_change(smooth(stamp, noise, fine)))[200:-200]
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


def test_noisy_joints_make_a_position_less_certain_in_every_direction(panda_model, moving_arm, pair):
    data = moving_arm.data(pair, noise=Noise(joints=1e-4))
    arm = ArmMotion(panda_model, data.joints)
    located = Identifier(arm).identify(data.units[0]).located
    added = (JointNoise(arm, data.joints).covariance(located) - located.covariance)[3:, 3:]
    assert np.linalg.matrix_rank(added, tol=1e-6 * np.linalg.norm(added)) == 3
