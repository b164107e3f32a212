"""A torque sensor that sticks is no force estimate."""

from dataclasses import replace

import numpy as np

from pretouch.arms.franka.state import STUCK_S, TorqueWatch
from pretouch.types import RobotState


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
