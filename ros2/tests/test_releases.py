"""What a joint_trajectory_controller of each release asks the arm for by our commands, in simulated time.

Velocities of up to 0.8 rad/s that turn around within 1.6 rad/s^2 use 0.213 of the smallest acceleration limit.
"""

import numpy as np
import pytest
from ros2.tests.simulated import MODEL, SETTLED, TrajectoryRun, V, swing

from pretouch_ros2.params import ArmParams

OWN = 0.25
MOVES = SETTLED - 0.1
JITTER = 1.3e-3 + 2e-3 * np.random.default_rng(0).random(1000)
Q = MODEL.description.q_ready
RELEASES = ("humble", "4.17", "4.21")


def still(_: float) -> np.ndarray:
    return np.zeros(7)


def late(turn: int) -> float:
    return float(JITTER[turn])


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize(("rate", "most"), [(1000, OWN), (250, OWN), (100, OWN)])
def test_with_one_clock_messages_leave_no_trace_in_the_motion(release, rate, most):
    trajectory = TrajectoryRun(release, rate).run(swing, 3.0, late)
    assert not trajectory.tripped
    assert trajectory.acceleration(MOVES) < most
    assert np.abs(trajectory.speed()).max() > 0.75


@pytest.mark.parametrize("skew", [-0.01, -0.005, 0.003, 0.005])
def test_clocks_may_differ_by_milliseconds(skew):
    assert TrajectoryRun("4.21", 1000).run(swing, 3.0, late, skew=skew).acceleration(MOVES) < OWN


@pytest.mark.parametrize(("release", "low", "high"), [("4.17", 0.0, 1.0), ("humble", 50, 200), ("4.21", 50, 200)])
def test_without_one_clock_some_releases_jerk_at_each_message(release, low, high):
    trajectory = TrajectoryRun(release, 1000, ArmParams("on-robot", "base", shared_clock=False)).run(swing, 3.0, late)
    assert low < trajectory.acceleration(MOVES) < high


@pytest.mark.parametrize("lag", [0.01, 0.03])
def test_an_arm_that_is_behind_its_commands_moves_as_well(lag):
    trajectory = TrajectoryRun("4.21", 1000, lag=lag).run(swing, 3.0, late)
    assert not trajectory.tripped
    assert trajectory.acceleration(MOVES) < OWN


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("length", [0.1, 0.15, 0.22, 0.5])
def test_after_lost_commands_the_arm_comes_to_rest_within_its_limits(release, length):
    trajectory = TrajectoryRun(release, 1000).run(swing, 4.0, late, lost=lambda t: 2.1 <= t < 2.1 + length)
    assert trajectory.tripped.startswith("The arm does not follow")
    assert trajectory.acceleration() < 1.01
    assert not np.abs(trajectory.speed()[-500:]).max() > 1e-9


@pytest.mark.parametrize(("length", "acceleration"), [(0.02, 25), (0.05, 250)])
def test_a_few_lost_commands_are_a_step_within_the_velocity_limits(length, acceleration):
    trajectory = TrajectoryRun("4.21", 1000).run(swing, 4.0, late, lost=lambda t: 2.1 <= t < 2.1 + length)
    assert not trajectory.tripped
    assert 1 < trajectory.acceleration(MOVES) < acceleration
    assert (np.abs(trajectory.speed()) < V).all()


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("away", [0.01, 0.03, 0.045])
def test_an_arm_moved_by_hand_while_its_controller_was_off_stays_there(release, away):
    trajectory = TrajectoryRun(release, 1000).run(still, 5.0, late, off=(2.0, 2.5, Q + away))
    assert not trajectory.tripped
    after = np.array(trajectory.times)[1:] > 2.502
    assert np.abs(trajectory.speed()[after]).max() < 1e-9
    # and moves from there
    begins = TrajectoryRun(release, 1000).run(
        lambda t: swing(t - 3.0) if t > 3.0 else still(t), 6.0, late, off=(2.0, 2.5, Q + away)
    )
    assert not begins.tripped
    assert begins.acceleration(2.51) < OWN
    assert np.abs(begins.speed()[after.size :]).max() > 0.5


def test_an_arm_moved_by_hand_too_far_is_told_of():
    trajectory = TrajectoryRun("4.21", 1000).run(still, 3.0, late, off=(2.0, 2.5, Q + 0.06))
    assert "but was commanded to" in trajectory.tripped
    after = np.array(trajectory.times)[1:] > 2.502
    assert np.abs(trajectory.speed()[after]).max() < 1e-9


def test_a_controller_switched_off_in_motion_does_not_jump_when_it_is_back():
    trajectory = TrajectoryRun("4.21", 1000).run(swing, 4.0, late, off=(2.0, 2.04, None))
    assert trajectory.tripped
    assert trajectory.acceleration(2.043) < 1.0


def test_at_rest_nothing_is_sent_and_no_motion_before_the_arm_has_settled():
    trajectory = TrajectoryRun("4.21", 1000).run(still, 3.0, late)
    assert trajectory.messages == 1
    early = TrajectoryRun("4.21", 1000)
    early.wish_from = 0.0
    early.run(lambda t: np.full(7, 0.1), early.params.settle_s, late)
    assert early.messages == 1
    assert np.abs(early.speed()).max() < 1e-12
