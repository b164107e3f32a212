"""Coming to rest from the last command, whatever ticks and commands do."""

import numpy as np
import pytest

from pretouch import loop
from pretouch.control.joint_box import JointLimits
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES, at_rate
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin


@pytest.fixture
def controller(panda_model: RobotModel, paper_skin: Skin) -> Controller:
    return Controller(panda_model, paper_skin, no_fixtures(), Circle(), PROFILES["paper"])


class Arm:
    """A robot that cannot be read and its clock; they keep what they are told, and fail at some numbers of calls."""

    def __init__(self, bad_ticks: range = range(0), bad_commands: range = range(0)) -> None:
        self.bad_ticks, self.bad_commands = bad_ticks, bad_commands
        self.ticks = self.asked = 0
        self.sent: list[np.ndarray] = []

    def tick(self) -> float:
        self.ticks += 1
        if self.ticks in self.bad_ticks:
            raise OSError(f"tick {self.ticks}")
        return 0.0

    def command(self, qd: np.ndarray) -> None:
        self.asked += 1
        if self.asked in self.bad_commands:
            raise OSError(f"command {self.asked}")
        self.sent.append(qd)

    def assert_braked(self, limits: JointLimits) -> None:
        """From full speed, to rest; every command is slower than the one before, none more is sent to who stands."""
        np.testing.assert_array_equal(self.sent[-1], 0.0)
        sent = np.array([limits.qd_max, *self.sent])
        assert np.all(np.abs(np.diff(sent, axis=0)).max(axis=0) <= limits.qdd_max * limits.period * (1 + 1e-9))
        assert np.all(np.diff(np.linalg.norm(sent, axis=1)) < 0)


@pytest.mark.parametrize("rate", [30.0, 100.0, 1000.0, 4000.0])
def test_an_arm_at_full_speed_comes_to_rest_at_any_rate(panda_model: RobotModel, paper_skin: Skin, rate: float):
    limits = Controller(panda_model, paper_skin, no_fixtures(), Circle(), at_rate(PROFILES["paper"], rate)).limits
    arm = Arm()
    loop.come_to_rest(limits, arm, arm, panda_model.q_mid, limits.qd_max)
    arm.assert_braked(limits)
    loop.come_to_rest(limits, arm, arm, panda_model.q_mid, np.zeros(7))
    assert arm.ticks == len(arm.sent), "at rest it is told nothing"


def test_a_speed_that_is_no_number_is_not_braked_for_ever(controller: Controller):
    arm = Arm()
    loop.come_to_rest(controller.limits, arm, arm, controller.model.q_mid, np.full(7, np.nan))
    assert len(arm.sent) < 100


@pytest.mark.parametrize(
    ("ticks", "commands", "first"),
    [
        (range(1, 2), range(0), "tick 1"),
        (range(1, 999), range(0), "tick 1"),
        (range(0), range(1, 12), "command 1"),
        (range(3, 5), range(2, 4), "command 2"),
    ],
)
def test_braking_goes_on_through_ticks_and_commands_that_fail(
    controller: Controller, ticks: range, commands: range, first: str
):
    arm, limits = Arm(ticks, commands), controller.limits
    with pytest.raises(OSError, match=f"^{first}$"):
        loop.come_to_rest(limits, arm, arm, controller.model.q_mid, limits.qd_max)
    arm.assert_braked(limits)


def test_a_robot_that_takes_no_command_is_given_up(controller: Controller):
    arm = Arm(bad_commands=range(1, 999))
    with pytest.raises(OSError, match=r"^command 1$"):
        loop.come_to_rest(controller.limits, arm, arm, controller.model.q_mid, controller.limits.qd_max)
    assert arm.asked < 100
