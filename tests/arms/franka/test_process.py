"""The process and its motions, over an arm that does as it is told: what set-points and commands make of it."""

import os
import signal
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from pretouch.arms.franka.connection import StateCallback
from pretouch.arms.franka.exchange import ArmCommand, ArmRequest, Communication, Feedback, Mailboxes
from pretouch.arms.franka.limits import FrankaParams, motion_limits
from pretouch.arms.franka.process import ArmServer, ProcessSettings, VelocityMotion
from pretouch.arms.franka.state import FrankaState
from pretouch.errors import RobotError
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

    def command(self, qd: float, age: float = -1000.0, request: ArmRequest = ArmRequest.MOVE, number: int = 1) -> None:
        """Have all joints wanted to move so fast [rad/s]; one from the future stays fresh."""
        self.mailboxes.commands.put(ArmCommand(number, request, time.monotonic() - age, [qd] * 7))

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


def test_a_set_point_that_is_old_but_not_stale_still_counts(bench: Bench) -> None:
    bench.command(0.1, age=FrankaParams().stale_after_s - 0.03)
    bench.run(1)
    assert bench.communication.stale == 0


@pytest.mark.parametrize(
    ("wrong", "words"),
    [({"qd": qd}, "The arm was brought to rest, because joint 1 was to move at ") for qd in (np.nan, np.inf, -50.0)]
    + [({"qd": 0.2, "age": FrankaParams().end_after_s + 0.01}, "its motion ended, because no set-point came for 1 s")],
)
def test_none_or_a_wrong_set_point_ends_the_motion_at_rest_and_later_ones_do_not_count(
    bench: Bench, wrong: dict[str, float], words: str
) -> None:
    bench.command(**wrong)
    bench.run(1)
    bench.command(0.2)
    bench.run(1000)
    assert bench.finished
    assert words in bench.motion.trouble
    assert bench.mailboxes.feedback.read().trouble == bench.motion.trouble


@pytest.mark.parametrize(
    "end",
    [
        lambda bench: bench.command(0.0, request=ArmRequest.WAIT),
        lambda bench: bench.command(0.0, request=ArmRequest.END),
        lambda bench: bench.command(0.0, request=ArmRequest.QUIT),
        lambda bench: bench.command(0.2, number=2),
        lambda bench: setattr(bench, "over", True),
    ],
)
def test_it_ends_at_rest_when_asked_to_for_another_request_and_when_the_program_has_died(
    bench: Bench, end: Callable[[Bench], None]
) -> None:
    end(bench)
    bench.run(1000)
    assert bench.finished
    assert bench.motion.trouble == ""
    assert bench.mailboxes.feedback.read().answered == 1


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
    assert str(bench.mailboxes.report.read()) == str(line)


# what the process does with its commands, which a script sends


class ScriptedClient:
    """Before each of its states, the script is handed the number of it, from 1 on."""

    def __init__(self, arm: CheckingArm, script: Callable[[int], None]) -> None:
        self._arm, self._script, self._states = arm, script, 0
        self.did: list[str] = []

    def read(self) -> FrankaState:
        self._states += 1
        self._script(self._states)
        return self._arm.state()

    def control(self, on_state: StateCallback) -> None:
        self.did.append("motion")
        finished = False
        while not finished:
            velocity, finished = on_state(self.read(), 1e-3)
            self._arm.take(velocity.tolist())

    def recover(self) -> None:
        self.did.append("recovery")
        raise RobotError("there is nothing to recover from")


class Program:
    """Gives orders by the number of the state."""

    def __init__(self, model: RobotModel) -> None:
        self.mailboxes, self.steps = Mailboxes(), {}
        self.limits = motion_limits(model, "panda")
        self.arm = CheckingArm(self.limits, middle(self.limits))
        self.client = ScriptedClient(self.arm, self._at)

    def _at(self, number: int) -> None:
        self.steps.get(number, lambda: None)()

    def command(self, at: int, number: int, request: ArmRequest, speed: float = 0.0) -> None:
        """From the state with a number on, want this."""
        self.steps[at] = lambda: self.mailboxes.commands.put(
            ArmCommand(number, request, time.monotonic() + 1000.0, [speed] * 7)
        )

    def look(self, at: int) -> list[Feedback | None]:
        """Note the feedback before the state with a number."""
        feedback: list[Feedback | None] = []
        self.steps[at] = lambda: feedback.append(self.mailboxes.feedback.read())
        return feedback

    def run(self) -> Feedback:
        """Serve until the command to quit; return the last feedback."""
        task = ProcessSettings("robot", "panda", self.limits, None, FrankaParams(), None, os.getppid())
        ArmServer(self.client, task, self.mailboxes).serve()  # type: ignore[arg-type]
        feedback = self.mailboxes.feedback.read()
        assert feedback is not None
        return feedback


@pytest.fixture
def program(panda_model: RobotModel) -> Iterator[Program]:
    before = signal.getsignal(signal.SIGTERM)
    yield Program(panda_model)
    signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize("asked_for", [ArmRequest.MOVE, ArmRequest.RECOVER])
def test_what_is_asked_in_a_motion_ends_it_at_rest_and_is_not_done_later(
    program: Program, asked_for: ArmRequest
) -> None:
    program.command(3, 1, ArmRequest.MOVE, 0.2)
    in_motion = program.look(99)
    program.command(100, 2, asked_for, 0.2)
    asked = program.look(101)
    program.command(2000, 3, ArmRequest.QUIT)
    last = program.run()
    assert program.client.did == ["motion"]
    assert np.abs(program.arm.qd).max() < 1e-4
    assert [feedback and (feedback.answered, feedback.moving) for feedback in in_motion + asked] == [(1, True)] * 2
    assert (last.answered, last.moving) == (2, False)


def test_a_request_that_is_taken_back_does_not_begin_a_motion(program: Program) -> None:
    program.command(3, 1, ArmRequest.WAIT)
    program.command(100, 2, ArmRequest.QUIT)
    assert program.run().answered == 1
    assert program.client.did == []


def test_motions_and_a_recovery_are_done_in_turn_and_trouble_is_told_once(program: Program) -> None:
    program.command(3, 1, ArmRequest.MOVE, 0.1)
    program.command(100, 1, ArmRequest.END)
    program.command(1000, 2, ArmRequest.RECOVER)
    recovered = program.look(1002)
    program.command(1010, 3, ArmRequest.MOVE, 0.1)
    program.command(1100, 3, ArmRequest.END)
    program.command(2000, 4, ArmRequest.QUIT)
    assert program.run().trouble == ""
    assert program.client.did == ["motion", "recovery", "motion"]
    assert [feedback and feedback.trouble for feedback in recovered] == ["there is nothing to recover from"]


def test_an_arm_that_is_lost_in_motion_is_told_as_it_was_last_seen(program: Program) -> None:
    def fail() -> None:
        raise RobotError("the line is dead" + 100_000 * "!")

    program.command(3, 1, ArmRequest.MOVE, 0.2)
    before = program.look(100)
    program.steps[101] = program.steps[102] = fail
    last = program.run()
    assert last.trouble == "the line is dead".ljust(2000, "!")
    assert not last.moving
    assert before[0] is not None
    assert last.state.time > before[0].state.time
    assert last.state.qd.max() > 0.01
    assert before[0].stamp <= last.stamp < time.monotonic()
