"""A warm-up goes through all that a loop may come to, so that nothing is left to compile or to collect there."""

import gc
import subprocess
import sys

import numpy as np
import pytest

from pretouch import realtime
from pretouch.cli.warm_up import compile_stages
from pretouch.compiled import FIRST_START
from pretouch.controller import Controller
from pretouch.profiles import at_rate, profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Inputs, Mode, RobotState
from tests.following_arm import controller_of


@pytest.fixture
def robot(panda_model: RobotModel) -> RobotState:
    q, rest = panda_model.description.q_ready, np.zeros(7)
    return RobotState(0.0, q, rest, q, rest, rest, np.zeros(6))


def recorded(controller: Controller, monkeypatch: pytest.MonkeyPatch) -> list[ControlStep]:
    steps: list[ControlStep] = []
    turn = controller.step

    def step(state: object, inputs: Inputs) -> object:
        steps.append((result := turn(state, inputs))[0])
        return result

    monkeypatch.setattr(controller, "step", step)
    return steps


@pytest.mark.parametrize(
    ("name", "rate"), [("paper", 1000.0), ("blind", 100.0), ("paper:approach.rows=hard", 100.0), ("pretouch", 1000.0)]
)
def test_a_warm_up_sees_every_mode(panda_model, paper_skin, robot: RobotState, monkeypatch, name: str, rate: float):
    controller = controller_of(panda_model, paper_skin, at_rate(profile(name), rate))
    steps = recorded(controller, monkeypatch)
    realtime.warm_up(controller, robot)
    assert {step.mode for step in steps} == set(Mode)
    assert any(len(step.touched.link) for step in steps) == (name == "pretouch"), "where it is touched"
    if name == "paper":
        seen = {(step.mode, len(step.restricted) > 0) for step in steps}
        assert seen >= {(Mode.TRACK, True), (Mode.TRACK, False), (Mode.REACT, True), (Mode.REACT, False)}


def test_the_process_beside_does_not_say_again_that_it_compiles(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(FIRST_START, "logged", False)
    monkeypatch.setattr(gc, "disable", lambda: None)
    compile_stages()
    assert FIRST_START.logged


def test_steps_leave_nothing_for_the_collector(panda_model: RobotModel, paper_skin: Skin, robot: RobotState):
    controller = controller_of(panda_model, paper_skin, at_rate(profile("paper"), 1000.0))
    realtime.warm_up(controller, robot)
    with realtime.real_time():
        realtime.warm_up(controller, robot)
        # a cycle of objects in each of a thousand steps would be thousands
        assert gc.collect() < 100


PROBE = """
import sys
import numpy as np
from pretouch import realtime
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.profiles import at_rate, profile
from pretouch.perception.scene_filter import no_fixtures
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.types import Inputs, Mode, RangeReadings, RobotState
def loaded():
    found = {}
    for module in [m for name, m in sys.modules.items() if name.startswith("pretouch")]:
        for name, value in vars(module).items():
            if hasattr(value, "signatures"):
                found[module.__name__, name] = len(value.signatures)
    return found

model = RobotModel(panda())
controller = Controller(model, paper_skin(model), no_fixtures(), Circle(), at_rate(profile("paper"), 1000.0))
q, qd, now, units = model.description.q_ready, np.zeros(7), 0.0, len(controller.skin)
def robot(push=0.0):
    return RobotState(now, q, qd, q, qd, np.zeros(7), np.array([push, 0, 0, 0, 0, 0]))
if sys.argv[1] == "warm":
    realtime.warm_up(controller, robot())
before, state, modes = loaded(), controller.init(robot()), set()
for i in range(1500):
    now += 0.001
    status = np.full(units, 0 if 1100 < i < 1300 else 2)
    seen = RangeReadings(np.full(units, now), np.linspace(0.05, 0.6, units), status)
    step, state = controller.step(state, Inputs(now, robot(5000.0 if i == 1400 else 0.0), seen))
    q, qd = q + step.command * 0.001, step.command
    modes.add(step.mode)
assert modes == set(Mode), modes
new = {name: count for name, count in loaded().items() if count != before.get(name, 0)}
sys.exit(f"compiled in the loop: {new}" if new else 0)
"""


@pytest.mark.parametrize("how", ["warm", "cold"])
def test_nothing_is_compiled_after_a_warm_up(how: str):
    done = subprocess.run([sys.executable, "-c", PROBE, how], capture_output=True, text=True)
    assert done.returncode == (0 if how == "warm" else 1), done.stderr
    if how == "cold":
        assert done.stderr.startswith("compiled in the loop")
