"""What a step is given and gives is a value: nothing is shared, changed, or mistaken for another's."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.controller import Controller
from pretouch.errors import RobotStateError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Inputs, Mode
from tests.following_arm import PAPER, Arm

LEFT = 0  # unit of the paper's skin that looks along +y in the ready posture


@pytest.fixture
def arm(panda_model: RobotModel, paper_skin: Skin) -> Arm:
    """An arm under the paper's profile, on its way along the path at full speed."""
    arm = Arm(panda_model, paper_skin)
    arm.run(150)
    return arm


def test_a_state_of_another_controller_is_refused(arm: Arm, panda_model: RobotModel):
    other = Arm(panda_model, Skin([], panda_model))
    with pytest.raises(RobotStateError, match="another arm or skin"):
        arm.controller.step(other.state, Inputs(arm.time, arm.robot(), arm.readings()))


def test_a_command_changed_by_its_user_is_not_the_one_remembered(arm: Arm):
    step, after = arm.controller.step(arm.state, Inputs(arm.time, arm.robot(), arm.readings()))
    sent = step.command.copy()
    step.command[:] = 0.0
    np.testing.assert_array_equal(after.command, sent)


def test_a_path_that_hands_out_its_own_memory_changes_no_step(panda_model: RobotModel, paper_skin: Skin):
    class Reused:
        """The same array each time, as a path in a hurry may do."""

        length, closed, at = 1.0, True, np.array([0.5, 0.0, 0.4])

        def point(self, phase: float) -> np.ndarray:
            self.at[2] += 0.001
            return self.at

        def tangent(self, phase: float) -> np.ndarray:
            return np.array([0.0, 0.0, 1.0])

    arm = Arm(panda_model, paper_skin)
    arm.controller = Controller(panda_model, paper_skin, arm.controller.fixtures, Reused(), PAPER)
    first, second = arm.step(), arm.step()
    assert second.path_position[2] - first.path_position[2] == pytest.approx(0.001)


@pytest.mark.parametrize("seen", [True, False])
def test_after_a_clock_set_back_with_a_broken_state_the_arm_sees_again(arm: Arm, seen: bool):
    arm.time = 0.5
    assert arm.step(change=lambda robot: replace(robot, qd=np.full(7, np.nan))).mode is Mode.HOLD
    units = dict.fromkeys(range(7), 0.05 if seen else 1.0)
    step = arm.run(40, resume=True, **{"seen" if seen else "silent": units})[-1]
    if seen:
        assert step.speed_scale < 0.3
    else:
        assert step.mode is Mode.HOLD
        assert "No usable reading" in step.reason
