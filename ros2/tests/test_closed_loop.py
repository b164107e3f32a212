"""The controller over ROS 2, with a simulated arm in another process that is pushed."""

from contextlib import suppress
from functools import partial
from threading import Thread
from time import sleep
from types import SimpleNamespace

import numpy as np
import pytest
from ros2.tests.asking import turned

from pretouch.control.path import segment
from pretouch.controller import Controller
from pretouch.errors import RobotError
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.types import ControlStep, Mode
from pretouch_ros2.params import ArmParams
from pretouch_ros2.robot import Ros2Robot
from pretouch_ros2.skin import Ros2Skin

PUSH_N = 25.0


@pytest.fixture
def run(panda_model, paper_skin, node, arm):
    """An arm and its units, over which a controller is turned until something has happened."""
    x, y, z = panda_model.kinematics(panda_model.description.q_ready).position[panda_model.ee]
    path = segment((x, y, z), (x, y + 0.4, z))
    controller = Controller(panda_model, paper_skin, no_fixtures(), path, PROFILES["paper"])
    units = Ros2Skin(paper_skin, node)
    with Ros2Robot(ArmParams("by-robot", "base"), panda_model, node) as robot:
        robot.wait(10)
        units.wait(10)
        yield SimpleNamespace(robot=robot, until=partial(turned, controller, robot, units))


def test_a_pushed_arm_yields_to_the_push(run, arm):
    tracked, reacted = [0], [0]

    def done(step: ControlStep) -> bool:
        tracked[0] += step.mode is Mode.TRACK
        if tracked[0] == 60:
            arm.tell(f"push 0 0 {PUSH_N}")
            tracked[0] += 1
        reacted[0] += step.mode is Mode.REACT
        return reacted[0] >= 50

    steps = run.until(done, resume=lambda: True)  # a busy machine may be late
    contact = next(step for step in steps if step.contact is not None)
    reaction = [step for step in steps if step.mode is Mode.REACT]
    assert contact.contact.force[2] > 10
    assert abs(reaction[-1].force[2]) < 2 * PUSH_N
    assert reaction[0].reaction_velocity[2] > 0.2
    # the arm itself moved up, and along the path before
    assert reaction[-1].ee_position[2] - contact.ee_position[2] > 0.05
    tracking = [step for step in steps if step.mode is Mode.TRACK]
    assert tracking[-1].ee_position[1] - tracking[0].ee_position[1] > 0.05
    # what it was thought to be sent to is what it followed
    lag = np.array([step.q_commanded - step.q for step in steps])
    assert np.percentile(np.abs(lag), 95) < 0.05
    # left behind, the arm stands
    sleep(0.6)
    log = arm.stop()
    assert np.abs(np.diff(log[-100:, 1:], axis=0)).max() < 1e-9


@pytest.mark.parametrize("fault", ["mute", pytest.param("freeze", marks=pytest.mark.slow)])
def test_a_state_that_does_not_come_or_only_comes_again_latches_a_hold(run, arm, fault):
    turns = [0]

    def done(step: ControlStep) -> bool:
        turns[0] += 1
        if turns[0] == 20:
            arm.tell(fault)
        return "The robot's state is" in step.reason

    steps = run.until(done)
    assert steps[-1].mode is Mode.HOLD
    assert "check the connection to the arm, then resume" in steps[-1].reason


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["no commands arrive", "its machine pauses"])
def test_an_arm_that_is_lost_in_motion_ends_the_run_and_is_at_rest(run, arm, fault):
    run.robot.begin()
    turns, deaf, pause = [0], fault == "no commands arrive", Thread(target=arm.pause, args=(0.5,))

    def done(step: ControlStep) -> bool:
        turns[0] += step.mode is Mode.TRACK and float(np.abs(step.command).max()) > 0.1
        if turns[0] == 20:
            turns[0] += 1
            arm.tell("deaf") if deaf else pause.start()
        return not deaf and turns[0] > 20 and "The robot's state is" in step.reason  # a busy machine may be late before

    # after a pause, that it does not follow may be seen first
    with pytest.raises(RobotError, match="The arm does not follow") if deaf else suppress(RobotError):
        assert run.until(done, resume=lambda: True)[-1].mode is Mode.HOLD
    sleep(1.3)
    assert np.abs(np.diff(arm.stop()[-20:, 1:], axis=0)).max() < 1e-9
