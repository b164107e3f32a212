"""The line from readings to a joint velocity, closed over an arm that follows its commands exactly."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.controller import Controller
from pretouch.errors import RobotStateError
from pretouch.profiles import PROFILES
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Inputs, Mode
from tests.following_arm import PAPER, Arm, on_its_way

LEFT, RIGHT = 0, 1  # units of the paper's skin that look along +y and -y in the ready posture


@pytest.fixture
def arm(panda_model: RobotModel, paper_skin: Skin) -> Arm:
    """An arm under the paper's profile, on its way along the path at full speed."""
    return on_its_way(panda_model, paper_skin)


def speed(arm: Arm, step: ControlStep) -> np.ndarray:
    """Velocity of the hand that a command stands for."""
    return (arm.model.ee_jacobian(arm.model.kinematics(step.q)) @ step.command)[:3]


def test_the_arm_follows_its_path_at_the_speed_asked(arm: Arm):
    steps = arm.run(60)
    assert {s.mode for s in steps} == {Mode.TRACK}
    np.testing.assert_allclose(speed(arm, steps[-1]), [0.0, 0.3, 0.0], atol=0.01)
    assert np.linalg.norm(steps[-1].ee_position - steps[-1].path_position) < 0.01
    # the phase is what was travelled: 60 cycles of 0.01 s at 0.3 m/s
    assert steps[-1].path_phase - steps[0].path_phase == pytest.approx(59 * 0.003, rel=0.02)


def test_torques_alone_arm_the_sequential_test_where_there_is_no_force(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin, PROFILES["pretouch"])
    steps = [arm.step(change=lambda robot: replace(robot, wrench=None)) for _ in range(101)]
    assert [step.armed for step in steps] == [False] * 100 + [True]
    assert steps[-1].mode is Mode.TRACK


def test_at_the_end_of_its_path_the_arm_stands(arm: Arm):
    steps = arm.run(600)
    np.testing.assert_allclose(arm.ee(), arm.controller.path.point(0.4), atol=2e-3)
    phases = [step.path_phase for step in steps]
    assert phases == sorted(phases)
    assert phases[-1] == arm.controller.path.length
    assert np.linalg.norm(speed(arm, steps[-1])) < 1e-3


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_arm_moves_the_way_it_is_pushed(arm: Arm, axis: int, sign: float):
    push = np.zeros(3)
    push[axis] = sign * 40.0
    arm.run(5, force=tuple(push))
    start = arm.ee()
    step = arm.step(force=tuple(push))
    assert step.mode is Mode.REACT
    # nothing but the push: the window's mean of about zero is subtracted (eq. 12)
    direction = step.desired_velocity / np.linalg.norm(step.desired_velocity)
    np.testing.assert_allclose(direction, push / 40.0, atol=1e-9)
    np.testing.assert_array_equal(step.reaction_velocity, step.desired_velocity)
    arm.run(50)
    moved = arm.ee() - start
    assert sign * moved[axis] > 0.05
    assert np.linalg.norm(moved) < 1.3 * abs(moved[axis])


def test_after_a_reaction_the_arm_returns_gently(arm: Arm):
    arm.run(3, force=(0.0, 0.0, 50.0))
    arm.run(199)
    back = arm.run(500)
    assert {s.mode for s in back} == {Mode.TRACK}
    assert np.linalg.norm(back[0].ee_position - back[0].path_position) > 0.1
    # 1 m/s^2 for 0.01 s
    speeds = [0.0, *(np.linalg.norm(s.desired_velocity) for s in back)]
    assert np.diff(speeds).max() <= 0.01 + 1e-12
    assert max(speeds) == pytest.approx(0.3)


@pytest.mark.parametrize(("name", "tracks"), [("paper", 18), ("pretouch", 0)])
@pytest.mark.parametrize("torques", [None, "many", np.full(7, np.nan), np.zeros(3), np.full(7, 1e9)])
def test_without_a_force_estimate_the_arm_holds_and_says_for_how_long(panda_model, paper_skin, name, tracks, torques):
    arm = on_its_way(panda_model, paper_skin, PROFILES[name])
    step = arm.run(40, change=lambda robot: replace(robot, tau_ext=torques))[-1]
    assert np.isnan(step.residual).all()
    assert (step.mode is Mode.TRACK) is (name == "paper"), "which needs the wrench alone"
    arm.run(5)
    steps = arm.run(240, change=lambda robot: replace(robot, wrench=None, tau_ext=torques))
    assert [s.mode for s in steps[:tracks]] == [Mode.TRACK] * tracks
    assert {s.mode for s in steps[20:]} == {Mode.HOLD}
    assert np.all(np.isnan(steps[-1].force))
    assert "has given no force estimate for 2.40 s" in steps[-1].reason
    assert arm.step().mode is Mode.TRACK


def test_a_blind_arm_needs_no_readings(panda_model: RobotModel, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin, PROFILES["blind"])
    step, _ = arm.controller.step(arm.state, Inputs(arm.time, arm.robot(), None))
    assert step.mode is Mode.TRACK
    assert len(step.obstacles.unit) == 0


# what a step is given and gives is a value: nothing is shared, changed, or mistaken for another's


def test_a_state_of_another_controller_is_refused(arm: Arm, panda_model: RobotModel):
    other = Arm(panda_model, Skin([], panda_model))
    with pytest.raises(RobotStateError, match="another arm or skin"):
        arm.controller.step(other.state, Inputs(arm.time, arm.robot(), arm.readings()))


def test_a_command_changed_by_its_user_is_not_the_one_remembered(arm: Arm):
    step, after = arm.controller.step(arm.state, Inputs(arm.time, arm.robot(), arm.readings()))
    sent = step.command.copy()
    step.command[:] = 0.0
    np.testing.assert_array_equal(after.memory.get("command"), sent)


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
