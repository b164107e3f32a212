"""The loop with fakes for everything around it."""

import signal
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from pretouch import loop
from pretouch.control.joint_box import JointLimits
from pretouch.controller import Controller
from pretouch.errors import RobotStateError
from pretouch.profiles import PROFILES, at_rate
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Mode, RangeReadings, RangeStatus, RobotState
from tests.following_arm import controller_of

DT = 0.01
PAPER = PROFILES["paper"]
PROFILE = replace(PAPER, window=replace(PAPER.window, samples=2))


class World:
    """An arm that holds its last command until the next tick, a skin that sees nothing, and their clock."""

    period = DT

    def __init__(self, model: RobotModel, units: int) -> None:
        self.model, self.units = model, units
        self.now, self.q, self.qd = 0.0, model.description.q_ready.copy(), np.zeros(7)
        self.broken = False
        self.held: list[np.ndarray] = [self.qd]
        """Velocity of each period so far."""

    def tick(self) -> float:
        self.now += self.period
        self.q = self.q + self.qd * self.period
        self.held.append(self.qd)
        return self.now

    def read(self) -> RobotState:
        q = np.full(7, np.nan) if self.broken else self.q
        return RobotState(self.now, q, self.qd, q, self.qd, np.zeros(7), np.zeros(6))

    def command(self, qd: np.ndarray) -> None:
        assert np.all(np.isfinite(qd))
        self.qd = qd

    def skin(self) -> "FakeSkin":
        return FakeSkin(self)


@dataclass
class FakeSkin:
    world: World

    def read(self) -> RangeReadings:
        k = self.world.units
        return RangeReadings(np.full(k, self.world.now), np.zeros(k), np.full(k, int(RangeStatus.SIGNAL)))


@dataclass
class FakeRecorder:
    steps: list[ControlStep] = field(default_factory=list)
    on_step: Callable[[int], None] = lambda count: None

    def record(self, cycle: loop.Cycle) -> None:
        self.steps.append(cycle.step)
        self.on_step(len(self.steps))


@pytest.fixture
def world(panda_model: RobotModel, paper_skin: Skin) -> World:
    return World(panda_model, len(paper_skin))


@pytest.fixture
def controller(panda_model: RobotModel, paper_skin: Skin) -> Controller:
    return controller_of(panda_model, paper_skin, PROFILE)


def turn(controller: Controller, world: World, recorder: FakeRecorder, done: Callable[[ControlStep], bool]) -> None:
    loop.run(controller, world, world.skin(), world, recorder, done)


def never(step: ControlStep) -> bool:
    assert step.stamp < 10, "the loop should have ended"
    return False


def assert_brought_to_rest(world: World) -> None:
    """The arm stands, had moved, and was never asked for more than its acceleration."""
    world.tick()
    np.testing.assert_array_equal(world.held[-1], 0.0)
    assert max(np.linalg.norm(qd) for qd in world.held) > 0.05
    change = np.abs(np.diff(world.held, axis=0)).max(axis=0) / DT
    assert np.all(change <= world.model.description.qdd_max + 1e-9)


def test_the_loop_commands_each_step_and_ends_when_done_says_so(controller: Controller, world: World):
    recorder = FakeRecorder()
    turn(controller, world, recorder, lambda step: step.stamp >= 0.5 - 1e-9)
    # a step at every tick, the last one recorded too
    np.testing.assert_allclose([s.stamp for s in recorder.steps], 0.01 * np.arange(1, 51))
    assert recorder.steps[-1].mode is Mode.TRACK
    # each is commanded: held[0] is before the first tick, held[1] the period before the first command
    for step, held in zip(recorder.steps, world.held[2:], strict=False):
        np.testing.assert_array_equal(held, step.command)
    assert_brought_to_rest(world)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), RuntimeError("the disk is full")])
@pytest.mark.parametrize("where", ["record", "read", "command"])
def test_an_interrupt_or_error_brings_the_arm_to_rest_and_is_passed_on(
    controller: Controller, world: World, monkeypatch: pytest.MonkeyPatch, where: str, error: BaseException
):
    recorder, calls = FakeRecorder(), []
    whose = recorder if where == "record" else world
    well = getattr(whose, where)

    def failing(*given: object) -> object:
        calls.append(given)
        if len(calls) == 50 or (where == "read" and len(calls) > 50):
            raise error
        return well(*given)

    monkeypatch.setattr(whose, where, failing)
    with pytest.raises(type(error)) as caught:
        turn(controller, world, recorder, never)
    assert caught.value is error
    assert len(recorder.steps) == {"record": 49, "read": 48, "command": 49}[where]  # the first state is no step's
    assert_brought_to_rest(world)


def test_a_command_that_was_not_sent_is_not_reckoned_with(
    controller: Controller, world: World, monkeypatch: pytest.MonkeyPatch
):
    good, calls = world.read, []

    def command(qd: np.ndarray) -> None:
        calls.append(qd)
        if len(calls) == 42:
            raise ConnectionError("lost")
        World.command(world, qd)

    # from the 41st step on the controller brakes, and the second braking command is lost
    monkeypatch.setattr(world, "read", lambda: replace(good(), q=np.full(7, np.nan)) if len(calls) >= 40 else good())
    monkeypatch.setattr(world, "command", command)
    with pytest.raises(ConnectionError, match="lost"):
        turn(controller, world, FakeRecorder(), never)
    assert np.abs(calls[41]).max() < np.abs(calls[40]).max() < np.abs(calls[39]).max()
    assert_brought_to_rest(world)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["q", "qd", "q_commanded", "qd_commanded", "stamp"])
def test_no_start_from_a_state_that_is_not_finite(controller: Controller, world: World, monkeypatch, name, value):
    first = replace(world.read(), **{name: value if name == "stamp" else np.array([0, 0, 0, value, 0, 0, 0])})
    monkeypatch.setattr(world, "read", lambda: first)
    monkeypatch.setattr(world, "command", lambda qd: pytest.fail("no command is due"))
    with pytest.raises(RobotStateError, match=rf"cannot start: RobotState\.{name} holds {value}.*: check"):
        turn(controller, world, FakeRecorder(), never)


@pytest.mark.parametrize("asked", [True, False])
def test_a_latched_hold_goes_on_when_resume_says_so(controller: Controller, world: World, asked: bool):
    def break_down(count: int) -> None:
        world.broken = count == 30

    recorder = FakeRecorder(on_step=break_down)
    options = loop.Options(resume=lambda: asked and len(recorder.steps) == 60)
    loop.run(controller, world, world.skin(), world, recorder, lambda step: step.stamp >= 0.8, options)
    modes = [step.mode for step in recorder.steps]
    assert set(modes[30:60]) == {Mode.HOLD}
    assert set(modes[60:]) == {Mode.TRACK if asked else Mode.HOLD}


def test_an_arm_that_brakes_when_the_loop_ends_keeps_the_acceleration_limits(controller: Controller, world: World):
    def break_down(count: int) -> None:
        world.broken = count >= 50

    recorder = FakeRecorder(on_step=break_down)
    turn(controller, world, recorder, lambda step: step.stamp > 0.4 and step.mode is Mode.HOLD)
    assert recorder.steps[-1].mode is Mode.HOLD
    assert_brought_to_rest(world)


@pytest.mark.parametrize("times", [1, 3])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_that_come_while_the_arm_brakes_wait(controller: Controller, world: World, number: int, times: int):
    before = signal.signal(number, signal.default_int_handler)
    ticks = 0
    tick = world.tick

    def ticking() -> float:
        nonlocal ticks
        ticks += 1
        if ticks >= 60 and ticks < 60 + 4 * times and ticks % 4 == 0:
            signal.raise_signal(number)
        return tick()

    world.tick = ticking
    try:
        with pytest.raises(KeyboardInterrupt):
            loop.run(controller, world, world.skin(), world, FakeRecorder(), lambda step: False)
    finally:
        signal.signal(number, before)
    assert not world.qd.any()
    assert np.abs(world.held[59]).max() > 0.05


@pytest.mark.parametrize(("ahead", "mode"), [(2e-4, Mode.TRACK), (2 * DT, Mode.HOLD)])
def test_a_skin_that_stamps_as_it_reads_is_heard_but_a_clock_that_is_ahead_is_none(
    controller: Controller, world: World, ahead: float, mode: Mode
):
    class Ahead(FakeSkin):
        def read(self) -> RangeReadings:
            return replace(super().read(), stamp=np.full(self.world.units, self.world.now + ahead))

    recorder = FakeRecorder()
    loop.run(controller, world, Ahead(world), world, recorder, lambda step: len(recorder.steps) == 60)
    assert recorder.steps[-1].mode is mode


def test_a_loop_that_waits_between_its_tick_and_the_arms_state_is_late_and_goes_on(
    controller: Controller, world: World
):
    read = world.read

    def read_late() -> RobotState:
        if len(recorder.steps) == 30:
            world.now += 0.07
        return read()

    world.read, recorder = read_late, FakeRecorder()
    turn(controller, world, recorder, lambda step: len(recorder.steps) == 60)
    assert [step.mode for step in recorder.steps[29:32]] == [Mode.TRACK, Mode.HOLD, Mode.TRACK]
    assert "0.080 s ago" in recorder.steps[30].reason


# coming to rest from the last command, whatever ticks and commands do


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
    limits = controller_of(panda_model, paper_skin, at_rate(PROFILES["paper"], rate)).limits
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
