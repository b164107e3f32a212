"""What a process is given for real time, that it is taken back, and how a loop in it begins and ends."""

import ctypes
import gc
import os
import re
import signal
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from pretouch import realtime
from pretouch.controller import Controller
from pretouch.errors import ParameterError
from pretouch.loop import Cycle, MonotonicClock
from pretouch.profiles import PROFILES, at_rate
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, RobotState
from tests.following_arm import controller_of
from tests.test_loop import World

FAST = at_rate(PROFILES["paper"], 1000.0)


@pytest.fixture(autouse=True)
def collector() -> Iterator[None]:
    gc.enable()
    yield
    assert gc.isenabled()


@pytest.fixture
def nothing_frozen() -> Iterator[None]:
    """Undo what `tests.conftest` freezes for as long as a test looks at that."""
    gc.unfreeze()
    yield
    gc.freeze()


@pytest.fixture
def controller(panda_model: RobotModel, paper_skin: Skin) -> Controller:
    return controller_of(panda_model, paper_skin, FAST)


@pytest.mark.usefixtures("nothing_frozen")
@pytest.mark.parametrize("ends", [None, RuntimeError("lost")])
def test_nothing_is_collected_meanwhile_however_it_ends(ends: Exception | None):
    with suppress(RuntimeError), realtime.real_time() as missing:
        assert missing == ()
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 1000
        if ends:
            raise ends
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


@pytest.mark.usefixtures("nothing_frozen")
def test_a_collector_somebody_switched_off_and_froze_stays_so():
    gc.disable()
    gc.freeze()
    try:
        with realtime.real_time():
            pass
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 0
    finally:
        gc.enable()


NOT_ALLOWED, INVALID = PermissionError(1, "Operation not permitted"), OSError(22, "Invalid argument")
CPU = min(os.sched_getaffinity(0))


def fails(monkeypatch: pytest.MonkeyPatch, function: str, error: OSError) -> None:
    def refuse(*_args: object) -> None:
        raise error

    monkeypatch.setattr(os, function, refuse)


@pytest.mark.parametrize(
    ("function", "error", "wish", "words"),
    [
        ("scheduler", NOT_ALLOWED, {"priority": 80}, "Real-time priority 80 was refused.*rtprio 99.*limits.conf.*CAP_"),
        ("scheduler", INVALID, {"priority": 1}, r"Real-time priority 1 is not available here \(Invalid argument\)"),
        ("affinity", INVALID, {"cpu": CPU}, rf"Staying on processor {CPU} was refused \(Invalid argument\)"),
    ],
)
def test_what_is_refused_is_one_sentence_and_the_run_goes_on(monkeypatch, function, error, wish, words):
    fails(monkeypatch, f"sched_set{function}", error)
    with realtime.real_time(**wish) as missing:
        assert not gc.isenabled()
    (said,) = missing
    assert re.match(words, said)


@pytest.mark.parametrize("ends", [None, RuntimeError("lost")])
def test_a_priority_is_set_and_taken_back(monkeypatch: pytest.MonkeyPatch, ends: Exception | None):
    calls = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda *call: calls.append(call))
    before = os.sched_getscheduler(0)
    with suppress(RuntimeError), realtime.real_time(priority=80) as missing:
        assert missing == ()
        assert [(who, policy, param.sched_priority) for who, policy, param in calls] == [(0, os.SCHED_FIFO, 80)]
        if ends:
            raise ends
    assert [(who, policy) for who, policy, _ in calls[1:]] == [(0, before)]


def test_the_process_stays_on_a_processor_meanwhile():
    before = os.sched_getaffinity(0)
    with realtime.real_time(cpu=max(before)) as missing:
        assert os.sched_getaffinity(0) == {max(before)}
    assert missing == ()
    assert os.sched_getaffinity(0) == before


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        ({"priority": 0}, "The real-time priority is 0: give 1 to 99."),
        ({"priority": 100}, "The real-time priority is 100: give 1 to 99."),
        ({"cpu": -1}, "Processor -1 is not available to this process: choose from "),
        ({"cpu": 100_000}, "Processor 100000 is not available to this process: choose from "),
    ],
)
def test_wishes_that_cannot_be_name_the_range(wish: dict[str, int], words: str):
    with pytest.raises(ParameterError, match=words), realtime.real_time(**wish):
        pytest.fail("nothing is to be run")
    assert gc.isenabled()


def test_timers_are_sharp_meanwhile():
    prctl = ctypes.CDLL(None).prctl
    first = prctl(30, 0, 0, 0, 0)
    prctl(29, 40_000, 0, 0, 0)
    with realtime.real_time():
        assert prctl(30, 0, 0, 0, 0) == 1
    assert prctl(30, 0, 0, 0, 0) == 40_000
    prctl(29, first, 0, 0, 0)


class Arm(World):
    """A robot at rest and a recorder, beside a skin that is heard no more."""

    def __init__(self, controller: Controller) -> None:
        super().__init__(controller.model, len(controller.skin))
        self.steps: list[ControlStep] = []
        self.collecting: list[bool] = []

    def record(self, cycle: Cycle) -> None:
        self.steps.append(cycle.step)
        self.collecting.append(gc.isenabled())


def test_the_runner_prepares_tells_and_reports(controller: Controller, monkeypatch: pytest.MonkeyPatch):
    fails(monkeypatch, "sched_setaffinity", INVALID)
    clock, told, arm = MonotonicClock(0.001), [], Arm(controller)
    options = realtime.RealTimeOptions(cpu=CPU, tell=told.append)
    realtime.run(controller, arm, arm.skin(), clock, arm, lambda step: len(arm.steps) == 20, options)
    assert len(told) == 1
    assert arm.collecting == [False] * 20
    assert clock.timing().cycles == 20


def test_the_loop_begins_with_a_state_that_is_newer_than_the_preparations(controller: Controller, monkeypatch):
    collected: list[float] = []
    looks: list[float] = []
    firsts: list[RobotState] = []
    monkeypatch.setattr(gc, "collect", lambda: collected.append(time.monotonic()))
    arm = Arm(controller)

    def read() -> RobotState:
        """The state of before until the fourth look after the collection, which kept who receives it waiting."""
        looks.extend(collected)
        arm.now = time.monotonic() if len(looks) > 3 else 0.0
        return Arm.read(arm)

    monkeypatch.setattr(arm, "read", read)
    monkeypatch.setattr(arm, "record", lambda cycle: firsts.append(cycle.inputs.robot))
    realtime.run(controller, arm, arm.skin(), MonotonicClock(0.001), arm, lambda step: True)
    assert len(collected) == 1
    assert firsts[0].stamp >= collected[0]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_ends_processes_ends_the_loop_in_order(controller: Controller, number: int):
    before = signal.signal(number, signal.SIG_DFL)
    arm, clock = Arm(controller), MonotonicClock(0.001)

    def done(_step: ControlStep) -> bool:
        if len(arm.steps) == 5:
            signal.raise_signal(number)
        return False

    try:
        with pytest.raises(SystemExit) as ended:
            realtime.run(controller, arm, arm.skin(), clock, arm, done)
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)
    assert ended.value.code == 128 + number
    assert clock.timing().cycles >= 5
    assert gc.isenabled()


def test_a_clock_of_another_period_is_refused(controller: Controller):
    clock = MonotonicClock(0.01)
    arm = Arm(controller)
    with pytest.raises(ParameterError, match=r"period of 0\.01 s, the controller 0\.001 s: make them the same"):
        realtime.run(controller, arm, arm.skin(), clock, arm, lambda step: True)
    assert arm.steps == []
