"""The vendor's force is that of the arm on its environment; ours is the opposite. Pinned from value to reaction."""

from dataclasses import replace

import numpy as np

from pretouch.arms.franka.state import STUCK_S, TorqueWatch, error_names, robot_state
from pretouch.contact.reaction import DecayingVelocity
from pretouch.types import RobotState
from tests.arms.franka.made import state


def test_a_push_on_the_arm_is_negative_for_the_vendor_positive_for_us_and_moves_the_arm_along() -> None:
    vendor = np.array([0.0, -20.0, 0.0, 0.0, 0.0, -4.0])  # a hand pushes the arm towards +y with 20 N
    ours = robot_state(state(wrench=vendor, tau_ext=np.full(7, -2.0)), 3.0)
    assert ours.wrench is not None
    np.testing.assert_array_equal(ours.wrench, [0.0, 20.0, 0.0, 0.0, 0.0, 4.0])
    np.testing.assert_array_equal(ours.tau_ext, np.full(7, 2.0))
    velocity = DecayingVelocity().begin(ours.wrench[:3]).velocity
    assert velocity[1] > 0.1
    assert velocity[0] == velocity[2] == 0.0


def test_six_zeros_are_no_estimate_and_five_are_one() -> None:
    assert robot_state(state(wrench=np.zeros(6)), 0.0).wrench is None
    assert robot_state(state(wrench=np.array([0, 0, 0, 0, 0, 1e-9])), 0.0).wrench is not None


def test_all_else_keeps_its_sign() -> None:
    vendor = state()
    ours = robot_state(vendor, 7.0)
    assert ours.stamp == 7.0
    for theirs, name in (("q", "q"), ("qd", "qd"), ("q_d", "q_commanded"), ("dq_d", "qd_commanded")):
        np.testing.assert_array_equal(getattr(vendor, theirs), getattr(ours, name))


def test_error_names_are_found_in_what_the_libraries_print() -> None:
    text = 'Move command aborted: motion aborted by reflex! ["joint_reflex", "cartesian_reflex"] rate: 0.99 [x]'
    assert error_names(text) == ("joint_reflex", "cartesian_reflex")
    assert error_names("[]") == error_names("nothing") == ()


def reports(seconds: float, stuck: tuple[int, ...]) -> list[RobotState]:
    """What an arm says each hundredth of a second, some of its torques always the same."""
    rng, found = np.random.default_rng(3), []
    for k in range(round(100 * seconds)):
        tau = rng.normal(size=7)
        tau[list(stuck)] = 0.25
        zeros = np.zeros(7)
        found.append(RobotState(5.0 + 0.01 * k, zeros, zeros, zeros, zeros, tau, np.ones(6)))
    return found


def test_torques_that_waver_are_passed_on_as_they_are() -> None:
    watch = TorqueWatch()
    for report in reports(1.0, ()):
        assert watch.believed(report) is report


def test_one_that_repeats_for_long_takes_torques_and_force_away_until_it_wavers_again() -> None:
    watch = TorqueWatch()
    known = [watch.believed(report).wrench is not None for report in reports(0.5, (4,))]
    assert known == [0.01 * k <= STUCK_S for k in range(50)]
    assert np.isnan(watch.believed(reports(0.5, (4,))[-1]).tau_ext).all()
    later = [RobotState(r.stamp + 1.0, r.q, r.qd, r.q, r.qd, r.tau_ext, r.wrench) for r in reports(0.1, ())]
    assert [watch.believed(report).wrench is not None for report in later] == [True] * 10


def test_the_same_state_read_again_and_again_is_not_stuck_and_with_a_new_stamp_the_old_one() -> None:
    watch, (report,) = TorqueWatch(), reports(0.01, ())
    for _ in range(100):
        assert watch.believed(report).stamp == report.stamp
        assert watch.believed(report).wrench is not None
    assert watch.believed(replace(report, stamp=report.stamp + 3.0)).stamp == report.stamp
