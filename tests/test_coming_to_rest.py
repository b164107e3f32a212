"""Coming to rest from the last command, whatever ticks and commands do."""

import numpy as np
import pytest

from pretouch import loop
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES, at_rate
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin

DT = 0.01
PAPER = PROFILES["paper"]


@pytest.fixture
def controller(panda_model: RobotModel, paper_skin: Skin) -> Controller:
    return Controller(panda_model, paper_skin, no_fixtures(), Circle(), PAPER)


class Ticks:
    """A clock and a robot that only count and keep."""

    def __init__(self) -> None:
        self.sent: list[np.ndarray] = []

    def tick(self) -> float:
        return 0.0

    def command(self, qd: np.ndarray) -> None:
        self.sent.append(qd)


@pytest.mark.parametrize("rate", [30.0, 100.0, 1000.0, 4000.0])
def test_an_arm_at_full_speed_comes_to_rest_at_any_rate(panda_model: RobotModel, paper_skin: Skin, rate: float):
    controller = Controller(panda_model, paper_skin, no_fixtures(), Circle(), at_rate(PAPER, rate))
    arm, fastest = Ticks(), panda_model.description.qd_max
    loop.come_to_rest(controller.limits, arm, arm, panda_model.q_mid, fastest)
    np.testing.assert_array_equal(arm.sent[-1], 0.0)
    change = np.abs(np.diff([fastest, *arm.sent], axis=0)).max(axis=0) * rate
    assert np.all(change <= panda_model.description.qdd_max * (1 + 1e-9))


def test_a_speed_that_is_no_number_is_not_braked_for_ever(controller: Controller):
    arm = Ticks()
    loop.come_to_rest(controller.limits, arm, arm, controller.model.q_mid, np.full(7, np.nan))
    assert len(arm.sent) < 100


class Stubborn(Ticks):
    """Fails at some of its ticks, and at some commands, by number."""

    def __init__(self, ticks: range, commands: range) -> None:
        super().__init__()
        self.bad_ticks, self.bad_commands = ticks, commands
        self.ticks = self.asked = 0

    def tick(self) -> float:
        self.ticks += 1
        if self.ticks in self.bad_ticks:
            raise OSError(f"tick {self.ticks}")
        return 0.0

    def command(self, qd: np.ndarray) -> None:
        self.asked += 1
        if self.asked in self.bad_commands:
            raise OSError(f"command {self.asked}")
        super().command(qd)


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
    arm, model = Stubborn(ticks, commands), controller.model
    fastest = model.description.qd_max
    with pytest.raises(OSError, match=f"^{first}$"):
        loop.come_to_rest(controller.limits, arm, arm, model.q_mid, fastest)
    np.testing.assert_array_equal(arm.sent[-1], 0.0)
    change = np.abs(np.diff([fastest, *arm.sent], axis=0)).max(axis=0) / DT
    assert np.all(change <= model.description.qdd_max * (1 + 1e-9))


def test_a_robot_that_takes_no_command_is_given_up(controller: Controller):
    arm = Stubborn(range(0), range(1, 999))
    with pytest.raises(OSError, match=r"^command 1$"):
        loop.come_to_rest(controller.limits, arm, arm, controller.model.q_mid, controller.limits.qd_max)
    assert arm.asked < 100
