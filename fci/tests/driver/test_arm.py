"""In real time, through the vendor's unmodified libraries: what the process does, by what the simulated arm did.

Libraries that lose packets on a busy machine are no fault here; a reflex is.
"""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from subprocess import Popen

import numpy as np
import pytest
from fci.tests.driver.served import Served, child, wait_for

from pretouch.arms.franka.arm import FrankaArm
from pretouch.arms.franka.limits import FrankaParams, collision_behavior
from pretouch.errors import RobotError
from pretouch.profiles import profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.signals import OF_TERMINAL

pytestmark = [pytest.mark.slow, pytest.mark.alone]
one_kind = pytest.mark.parametrize("served", ["fr3"], indirect=True, scope="module")
"""For what does not depend on the vendor's library."""
FROZEN_S = 1.3
"""Longer than `FrankaParams.end_after_s`."""


@pytest.fixture(scope="module", params=["panda", "fr3"])
def served(request, tmp_path_factory):
    arm = Served(tmp_path_factory.mktemp("served"), request.param)
    yield arm
    arm.close()


@pytest.fixture
def model(served):
    return RobotModel(robot_named(served.kind))


@contextmanager
def commander(served: Served) -> Iterator[Popen[str]]:
    """A process that moves the arm; once it does."""
    process = child("commander.py", served.kind, served.address)
    try:
        pid = process.stdout.readline().strip()
        assert pid.isdecimal(), pid + process.stdout.read()
        wait_for(served.moves, "a motion")
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def keep(arm: FrankaArm, speed: float, until: Callable[[], bool], most: float = 20.0) -> None:
    """Command the last joint to move so fast [rad/s] until something has happened."""
    ends = time.monotonic() + most
    while not until():
        assert time.monotonic() < ends, f"nothing happened within {most} s: {arm.state()}"
        arm.command(np.array([0.0, 0, 0, 0, 0, 0, speed]))
        time.sleep(0.01)


def test_the_arm_follows_commands_and_ends_at_rest_and_the_terminals_signals_are_left_to_the_program(served, model):
    with FrankaArm(served.address, served.kind, model, behavior=collision_behavior(profile("paper"), model)) as arm:
        idle = arm.read()
        assert abs(time.monotonic() - idle.stamp) < 1.0
        assert idle.wrench is not None
        arm.begin()
        for number in OF_TERMINAL:
            os.kill(arm.pid, number)
        q = arm.read().q_commanded[6]
        keep(arm, -0.3, lambda: arm.read().q_commanded[6] < q - 0.1)
        assert arm.state().mode == "move"
        for ask in (arm.begin, arm.recover):
            with pytest.raises(RobotError, match="is in a motion: end it first"):
                ask()
        keep(arm, -0.3, lambda: arm.read().q_commanded[6] < q - 0.15)
        arm.end()
        assert np.all(arm.read().qd_commanded == 0.0)
        wait_for(lambda: arm.state().mode == "idle", "idle")
        assert arm.communication.cycles > 100
        assert f"{arm.communication.cycles} states answered" in arm.report()
    assert "Motion ended" not in served.said()


@one_kind
@pytest.mark.parametrize(("speed", "words"), [(np.nan, "not finite"), (3.0 * np.pi, "limit ")])
def test_a_set_point_that_is_none_brings_the_arm_to_rest(served, model, speed, words):
    with FrankaArm(served.address, served.kind, model) as arm:
        arm.begin()
        keep(arm, 0.3, served.moves)
        arm.command(np.array([0.0, 0, 0, speed, 0, 0, 0.3]))
        wait_for(lambda: arm.state().mode == "idle", "the end of the motion")
        with pytest.raises(RobotError, match=f"joint 4 was to move at .*{words}"):
            arm.command(np.zeros(7))
        wait_for(served.rests, "rest")
        arm.begin()
        arm.end()
    assert "Motion ended" not in served.said()


@one_kind
def test_stale_set_points_bring_the_arm_to_rest_and_fresh_ones_move_it_again(served, model):
    with FrankaArm(served.address, served.kind, model, FrankaParams(end_after_s=30.0)) as arm:
        arm.begin()
        keep(arm, -0.3, served.moves)
        wait_for(served.rests, "rest")
        assert arm.state().mode == "move"
        keep(arm, 0.3, served.moves)
        arm.end()
        assert arm.communication.stale >= 1
    assert "Motion ended" not in served.said()


def test_sigterm_to_the_process_brings_the_arm_to_rest_first(served, model):
    with FrankaArm(served.address, served.kind, model) as arm:
        arm.begin()
        keep(arm, 0.3, served.moves)
        os.kill(arm.pid, signal.SIGTERM)
        with pytest.raises(RobotError, match="told to end"):
            keep(arm, 0.3, lambda: False)
    wait_for(served.rests, "rest")
    assert "Motion ended" not in served.said()


@one_kind
def test_a_program_that_was_frozen_for_long_does_not_move_the_arm_again(served):
    with commander(served) as process:
        process.send_signal(signal.SIGSTOP)
        wait_for(served.rests, "rest")
        time.sleep(FROZEN_S)
        process.send_signal(signal.SIGCONT)
        assert process.wait(20.0) == 1
        assert "its motion ended, because no set-point came for 1 s" in process.stdout.read()
        assert served.rests()
    assert "Motion ended" not in served.said()


@one_kind
def test_a_program_that_is_killed_leaves_the_arm_at_rest(served):
    gone = served.clients_gone()
    with commander(served) as process:
        process.kill()
        wait_for(lambda: served.clients_gone() > gone, "the end of the process that moved the arm")
        wait_for(served.rests, "rest")
    assert "Motion ended" not in served.said()


def test_another_arm_than_was_said_is_refused_in_one_sentence(served, model):
    other, speaks = {"panda": ("fr3", 5), "fr3": ("panda", 10)}[served.kind]
    with pytest.raises(RobotError, match=f"^The arm at {served.address} speaks version {speaks} of .*: choose .*$"):
        FrankaArm(served.address, other, model)


@one_kind
def test_when_the_process_is_killed_the_arm_stops_by_itself_and_nobody_says_that_it_rests(served, model):
    with FrankaArm(served.address, served.kind, model) as arm:
        arm.begin()
        keep(arm, 0.3, served.moves)
        os.kill(arm.pid, signal.SIGKILL)
        with pytest.raises(RobotError, match=r"has ended, and the arm stops by itself: check that it stands"):
            keep(arm, 0.3, lambda: False)
        wait_for(served.rests, "rest")
        for ask in (arm.state, arm.read, arm.begin, arm.end):
            with pytest.raises(RobotError, match="has ended"):
                ask()
    with FrankaArm(served.address, served.kind, model) as arm:
        assert arm.state().mode == "idle"


@one_kind
def test_when_the_process_is_stopped_the_arm_stops_by_itself_and_the_caller_is_told(served, model):
    with FrankaArm(served.address, served.kind, model) as arm:
        arm.begin()
        keep(arm, 0.3, served.moves)
        os.kill(arm.pid, signal.SIGSTOP)
        with pytest.raises(
            RobotError, match=r"No state has come from the arm at .* for \d+\.\d s; without commands it stops by itself"
        ):
            keep(arm, 0.3, lambda: False)
        wait_for(served.rests, "rest")
        for ask in (arm.state, arm.read, arm.begin):
            with pytest.raises(RobotError, match="No state has come"):
                ask()
        os.kill(arm.pid, signal.SIGCONT)
        wait_for(lambda: fresh(arm), "states")
        with pytest.raises(RobotError, match="communication_constraints_violation"):
            keep(arm, 0.3, lambda: False)
        assert served.rests()
        arm.recover()
        assert arm.state().mode == "idle"


def fresh(arm: FrankaArm) -> bool:
    """Whether states come."""
    try:
        arm.state()
    except RobotError:
        return False
    return True
