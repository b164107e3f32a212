"""Which link a unit sits on."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.calibration.calibrate import calibrate
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.random_skin import random_skin
from tests.calibration.faulty import cut, kept, traced
from tests.calibration.made import MovingArm


def test_the_user_s_choice_among_links_fixed_to_each_other_stays(panda_model, moving_arm, paper_skin):
    on_hand = next(unit for unit in paper_skin.units if unit.link == "panda_hand")
    kin = panda_model.kinematics(panda_model.q_mid)
    hand, link8 = panda_model.link_index("panda_hand"), panda_model.link_index("panda_link8")
    T = on_hand.T_link_sensor.copy()
    turn = kin.rotation[link8].T @ kin.rotation[hand]
    T[:3, :3] = turn @ T[:3, :3]
    T[:3, 3] = turn @ T[:3, 3] + kin.rotation[link8].T @ (kin.position[hand] - kin.position[link8])
    unit = SensorUnit("u", "panda_link8", T)
    place = calibrate(panda_model, moving_arm.data(Skin([unit], panda_model))).units[0].place
    assert place.link == "panda_link8"
    assert place.T_link_sensor == pytest.approx(T, abs=1e-3)


@pytest.fixture(scope="module")
def fourth_joint_stands(panda_model):
    return MovingArm(panda_model, stand=(3,))


def test_a_joint_that_stood_cannot_tell_its_neighbours_apart(panda_model, fourth_joint_stands, pair):
    found = calibrate(panda_model, fourth_joint_stands.data(pair, links_known=False))
    assert [finding.kind for finding in found.findings] == ["joints_stood"]
    assert "panda_joint4 did not move" in found.findings[0].sentence
    link4, hand = found.units
    assert [(finding.kind, finding.refused) for finding in link4.findings] == [("ambiguous", True)]
    assert "move panda_joint4 more, or name the link" in link4.findings[0].sentence
    assert hand.accepted
    assert hand.findings == ()


def test_a_link_that_is_named_is_believed_where_another_moved_alike(panda_model, fourth_joint_stands, pair):
    link4 = calibrate(panda_model, fourth_joint_stands.data(pair)).units[0]
    assert link4.accepted
    assert link4.place.link == "panda_link4"
    assert [(finding.kind, finding.refused) for finding in link4.findings] == [("ambiguous", False)]


def test_a_unit_on_a_link_that_did_not_move_fits_no_link(panda_model, whole_skin):
    arm = MovingArm(panda_model, 30.0, stand=(0, 1))
    data = arm.data(Skin(whole_skin.units[:1], panda_model))
    (finding,) = calibrate(panda_model, data).units[0].findings
    assert (whole_skin.units[0].link, finding.kind, finding.refused) == ("panda_link2", "no_link", True)


@pytest.mark.slow
def test_links_fixed_to_each_other_are_told_apart_by_where_the_unit_sits_and_looks(panda_model, moving_arm):
    right = []
    for seed in range(12):
        units = [unit for unit in random_skin(panda_model, seed).units if unit.link in ("panda_link7", "panda_hand")]
        found = calibrate(panda_model, moving_arm.data(Skin(units, panda_model), seed, links_known=False))
        right += [unit.place.link == true.link for unit, true in zip(found.units, units, strict=True)]
    assert np.mean(right) > 0.8


def test_a_clock_is_not_judged_from_what_is_too_little(panda_model, good):
    imu = good.units[0].imu
    late = kept(replace(imu, stamp=imu.stamp + 100.0), imu.stamp > 8.0)
    data = cut(traced(good, "on_panda_link4", late), good.joints.stamp < 20.0)
    unit = calibrate(panda_model, data).units[0]
    assert [(finding.kind, finding.refused) for finding in unit.findings] == [("too_little", True)]
