"""What a motion answers to the arm, without an arm: set-points by hand, states of an arm that does as it is told."""

import time

import numpy as np
import pytest

from pretouch.arms.franka.exchange import ArmCommand, ArmRequest, Communication, Mailboxes
from pretouch.arms.franka.limits import FrankaParams, motion_limits
from pretouch.arms.franka.process import ProcessSettings, VelocityMotion
from pretouch.robot.model import RobotModel
from tests.arms.franka.made import CheckingArm, middle


class Bench:
    """An arm in a motion, and the program that orders it about."""

    def __init__(self, model: RobotModel) -> None:
        limits = motion_limits(model, "panda")
        self.mailboxes, self.communication, self.over = Mailboxes(), Communication(), False
        self.arm = CheckingArm(limits, middle(limits))
        settings = ProcessSettings("robot", "panda", limits, None, FrankaParams(), None, 0)
        self.motion = VelocityMotion(1, settings, self.mailboxes, self.communication, lambda: self.over)
        self.finished = False

    def command(self, qd: float, age: float = -1000.0, request: ArmRequest = ArmRequest.MOVE) -> None:
        """Have all joints wanted to move so fast [rad/s]; one from the future stays fresh."""
        self.mailboxes.send_command(ArmCommand(1, request, time.monotonic() - age, [qd] * 7))

    def run(self, states: int) -> None:
        for _ in range(states):
            velocity, self.finished = self.motion.answer(self.arm.state(), 1e-3)
            if self.finished:
                assert np.abs(self.arm.qd).max() < 1e-4
                return
            self.arm.take(velocity.tolist())

    @property
    def speed(self) -> float:
        return float(np.abs(self.arm.qd).max())


@pytest.fixture
def bench(panda_model: RobotModel) -> Bench:
    made = Bench(panda_model)
    made.command(0.2)
    made.run(300)
    assert made.speed == pytest.approx(0.2)
    return made


def test_stale_set_points_bring_it_to_rest_in_the_motion_and_fresh_ones_move_it_again(bench: Bench) -> None:
    bench.command(0.2, age=0.1)
    bench.run(500)
    assert bench.speed < 1e-9
    assert not bench.finished
    assert bench.communication.stale == 1
    bench.command(0.1)
    bench.run(300)
    assert bench.speed == pytest.approx(0.1)
    assert bench.motion.trouble == ""


def test_without_set_points_for_long_the_motion_ends_and_fresh_ones_do_not_count(bench: Bench) -> None:
    bench.command(0.2, age=FrankaParams().end_after_s + 0.01)
    bench.run(1)
    bench.command(0.2)
    bench.run(1000)
    assert bench.finished
    assert "its motion ended, because no set-point came for 1 s" in bench.motion.trouble


def test_commands_of_another_request_end_it(bench: Bench) -> None:
    bench.mailboxes.send_command(ArmCommand(2, ArmRequest.MOVE, time.monotonic() + 1000.0, [0.2] * 7))
    bench.run(1000)
    assert bench.finished
    assert bench.mailboxes.feedback.newest().answered == 1


def test_a_set_point_that_is_old_but_not_stale_still_counts(bench: Bench) -> None:
    bench.command(0.1, age=FrankaParams().stale_after_s - 0.03)
    bench.run(1)
    assert bench.communication.stale == 0


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -50.0])
def test_a_set_point_that_is_none_ends_the_motion_at_rest_and_later_ones_do_not_count(
    bench: Bench, wrong: float
) -> None:
    bench.command(wrong)
    bench.run(1)
    bench.command(0.2)
    bench.run(1000)
    assert bench.finished
    assert bench.motion.trouble.startswith("The arm was brought to rest, because joint 1 was to move at ")
    assert bench.mailboxes.feedback.newest().trouble == bench.motion.trouble


@pytest.mark.parametrize("asked_for", [ArmRequest.WAIT, ArmRequest.END, ArmRequest.QUIT])
def test_it_ends_at_rest_when_asked_to(bench: Bench, asked_for: ArmRequest) -> None:
    bench.command(0.0, request=asked_for)
    bench.run(1000)
    assert bench.finished
    assert bench.motion.trouble == ""


def test_it_ends_at_rest_when_the_program_has_died(bench: Bench) -> None:
    bench.over = True
    bench.run(1000)
    assert bench.finished


def test_it_does_not_end_before_the_arm_says_that_it_rests(bench: Bench) -> None:
    bench.command(0.0, request=ArmRequest.END)
    bench.run(60)
    assert not bench.finished
    assert bench.speed > 1e-4


def test_lost_states_are_counted(bench: Bench) -> None:
    line = bench.communication
    cycles, lost = line.cycles, line.lost_states
    bench.motion.answer(bench.arm.state(), 4e-3)
    assert (lost, line.lost_states, line.longest_gap, line.cycles) == (0, 3, 4e-3, cycles + 1)
    assert "3 lost (0.99 %), longest gap 4 ms" in str(line)
    bench.mailboxes.report.put(line)
    assert str(bench.mailboxes.report.newest()) == str(line)
