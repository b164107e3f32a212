"""However a motion ends, the arm is brought to rest, and it is said what happened."""

import os
import signal
from dataclasses import replace

import numpy as np
import pytest

from pretouch import realtime
from pretouch.calibration.motion.plan import Plan
from pretouch.control.path import segment
from pretouch.controller import Controller
from pretouch.errors import RobotError
from pretouch.loop import MonotonicClock
from pretouch.perception.scene_filter import no_fixtures
from pretouch.ports import NoUnits
from pretouch.profiles import PROFILES
from pretouch.sensing.skin import Skin
from pretouch.session.may_move import StandingArm
from pretouch.session.run import Ending, execute, follow, go
from pretouch.signals import Terminated, ends_raise
from pretouch.types import Mode
from tests.session.arms import AT_REST, FollowingArm


@pytest.fixture(autouse=True)
def _passing_time(monkeypatch):
    """Let time pass when somebody waits, and only then: how fast the machine is does not matter."""
    passed = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: sum(passed))
    monkeypatch.setattr("time.sleep", passed.append)


@pytest.fixture
def arm(panda_model):
    return FollowingArm(panda_model.description.q_ready)


@pytest.fixture(scope="module")
def controller(panda_model):
    x, y, z = panda_model.kinematics(panda_model.description.q_ready).position[panda_model.ee]
    blind = PROFILES["blind"]
    profile = replace(blind, window=replace(blind.window, samples=10))  # moves after a tenth of a second
    path = segment((x, y, z), (x, y + 0.4, z))
    return Controller(panda_model, Skin((), panda_model), no_fixtures(), path, profile)


class Keeper:
    """Keeps steps, and does something at one of them."""

    def __init__(self, at=10**9, then=lambda: None):
        self.steps, self.at, self.then = [], at, then

    def record(self, cycle):
        self.steps.append(cycle.step)
        if len(self.steps) == self.at:
            self.then()


def followed(controller, arm, keeper, cycles=80):
    ending = Ending()
    clock = MonotonicClock(0.01)
    options = realtime.RealTimeOptions(tell=lambda _: None)
    standing = StandingArm(arm, NoUnits(), controller, 0.0, clock)
    follow(standing, clock, keeper, lambda _: len(keeper.steps) >= cycles, options, ending)
    return ending


def fast(arm):
    return np.abs(np.array(arm.commands)).max()


def test_a_run_begins_and_ends_at_rest(controller, arm, panda_model):
    keeper = Keeper()
    assert followed(controller, arm, keeper) == AT_REST
    assert keeper.steps[-1].mode is Mode.TRACK
    assert fast(arm) > 0.05
    assert not arm.commands[-1].any()
    assert (arm.begun, arm.ended) == (1, 1)
    steps = np.diff(np.array(arm.commands), axis=0) / 0.01
    assert np.all(np.abs(steps) <= 1.001 * panda_model.description.qdd_max)


def test_an_exception_in_the_recorder_brings_the_arm_to_rest_and_is_said(controller, arm):
    def fail():
        raise ZeroDivisionError("by a recorder")

    ending = followed(controller, arm, Keeper(60, fail))
    assert ending == Ending("ZeroDivisionError: by a recorder", "")
    assert fast(arm) > 0.05
    assert not arm.commands[-1].any()
    assert arm.ended == 1


@pytest.mark.parametrize(
    ("number", "raised"),
    [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, Terminated), (signal.SIGHUP, Terminated)],
)
def test_a_signal_is_raised_after_the_arm_has_come_to_rest(controller, arm, number, raised):
    before = signal.getsignal(signal.SIGTSTP)
    with ends_raise(), pytest.raises(raised):
        followed(controller, arm, Keeper(60, lambda: os.kill(os.getpid(), number)))
    assert fast(arm) > 0.05
    assert not arm.commands[-1].any()
    assert arm.ended == 1
    assert signal.getsignal(signal.SIGTSTP) is before


def test_ctrl_z_does_not_stop_a_program_whose_arm_moves(controller, arm):
    assert followed(controller, arm, Keeper(20, lambda: os.kill(os.getpid(), signal.SIGTSTP)), 40) == AT_REST


def test_an_arm_that_takes_no_more_commands_is_said_and_its_motion_ended(controller, arm):
    arm.dies_after = 60
    ending = followed(controller, arm, Keeper())
    assert ending.stopped == "The process that speaks with the arm has ended."
    assert arm.ended == 1


@pytest.mark.parametrize(("stands", "rest_unknown"), [(True, ""), (False, "The arm does not answer.")])
def test_an_arm_whose_motion_cannot_be_ended_is_looked_at(controller, arm, stands, rest_unknown):
    arm.end_fails, arm.gone = True, not stands
    assert followed(controller, arm, Keeper(), 20) == Ending(
        stopped="The arm does not answer.", rest_unknown=rest_unknown
    )


def test_of_an_arm_that_is_lost_before_it_is_commanded_nothing_is_said_but_after_its_way_that_it_may_move(
    controller, arm
):
    clock, options, ending = MonotonicClock(0.01), realtime.RealTimeOptions(tell=lambda _: None), Ending()
    standing, arm.gone = StandingArm(arm, NoUnits(), controller, 0.0, clock), True
    way = Plan(np.array([0.0, 0.2]), np.array([arm.q, arm.q]))
    execute(standing, way, 1.0, Keeper(), clock, options, ending)
    assert ending.sentences() == (
        "The arm may not be at rest: No state has come. Check it, and press the user stop.",
        "The run ended early: The arm did not reach the start of its path. No state has come.",
    )
    ending = Ending()
    with pytest.raises(RobotError, match="No state has come"):
        execute(standing, None, 1.0, Keeper(), clock, options, ending)
    assert ending.sentences() == ()


def test_an_arm_goes_along_a_plan_and_a_signal_stops_it(controller, panda_model):
    q = panda_model.description.q_ready
    plan = Plan(np.array([0.0, 1.5]), np.array([q, q + 0.1]))
    arm, ending = FollowingArm(q), Ending()
    go(arm, controller, plan, ending)
    assert ending == AT_REST
    assert np.allclose(arm.q, q + 0.1, atol=0.01)
    assert not arm.commands[-1].any()

    arm, ending = FollowingArm(q), Ending()
    command = arm.command

    def commanded(qd):
        command(qd)
        if np.abs(arm.q - q).max() > 0.03 and np.any(qd):
            os.kill(os.getpid(), signal.SIGTERM)

    arm.command = commanded
    with ends_raise(), pytest.raises(Terminated):
        go(arm, controller, plan, ending)
    assert ending.stopped == "A signal came."
    assert 0.005 < np.abs(arm.q - q).max() < 0.09
    assert not arm.commands[-1].any()
