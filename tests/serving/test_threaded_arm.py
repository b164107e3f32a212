"""A simulated arm that moves on by itself: what its states are stamped with, and how far the machine is behind."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.params import FailureParams
from pretouch.serving import threaded_arm
from pretouch.serving.fleet import simulated_keys
from pretouch.serving.simulated_arm import SimulateOptions
from pretouch.serving.threaded_arm import ThreadedArm
from pretouch.sim.plant import Plant
from pretouch.sim.scene import SceneSpec
from pretouch.types import RobotState


class ScriptedArm:
    """A simulation whose states are stamped so much after their tick [s], and which stands while it is not let go."""

    def __init__(self, q):
        self.q, self.ahead, self.clock, self.plant = q, 0.0, SimpleNamespace(left_out=0.0), SimpleNamespace()
        self.plant.mj_data = SimpleNamespace(xfrc_applied=np.zeros((20, 6)))
        self.plant.before_each_step = lambda call: None
        self.goes_on, self.stands = threading.Event(), threading.Event()
        self.goes_on.set()

    def begin(self):
        pass

    def command(self, qd):
        pass

    def tick(self):
        if not self.goes_on.is_set():
            self.stands.set()
            self.goes_on.wait()
        self.now = time.monotonic()

    def read(self):
        still = np.zeros(7)
        return RobotState(self.now, self.q, still, self.q, still, still, np.zeros(6))

    def monotonic(self, instant):
        return instant + self.ahead

    def __exit__(self, *_):
        pass


@pytest.fixture
def simulation(panda_model):
    return ScriptedArm(panda_model.description.q_ready)


@pytest.fixture
def arm(panda_model, paper_skin, simulation, monkeypatch):
    monkeypatch.setattr(threaded_arm, "SimulatedArm", lambda *_: simulation)
    options = SimulateOptions(panda_model, paper_skin, simulated_keys(paper_skin.ids, 0), "127.0.0.1", 9)
    with ThreadedArm(options, panda_model.description.q_ready, SceneSpec()) as arm:
        yield arm
        simulation.goes_on.set()


def test_no_state_is_stamped_after_now(arm, simulation):
    simulation.ahead = 0.05
    begin = time.monotonic()
    while time.monotonic() < begin + 0.1:
        assert arm.read().stamp <= time.monotonic()


def test_a_simulation_that_stands_still_falls_behind_until_it_goes_on(arm, simulation):
    assert arm.left_out < 0.1
    simulation.goes_on.clear()
    assert simulation.stands.wait(10.0)
    stood = arm.read()
    while arm.left_out < 0.1:
        assert time.monotonic() < stood.stamp + 10.0
    assert stood.stamp < arm.read().stamp < time.monotonic() - 0.02
    assert arm.measured().stamp <= stood.stamp  # what was measured keeps its time
    simulation.clock.left_out = 0.3
    simulation.goes_on.set()
    while arm.left_out < 0.3:
        assert time.monotonic() < stood.stamp + 10.0
    assert arm.report() == "This machine is too slow by 0.3 s for the simulation."


def test_a_machine_that_is_always_too_slow_still_hands_out_states_that_a_controller_believes(
    panda_model, paper_skin, monkeypatch
):
    advance = Plant.advance

    def slowly(plant, duration):
        time.sleep(1.5 * duration)
        advance(plant, duration)

    monkeypatch.setattr(Plant, "advance", slowly)
    options = SimulateOptions(panda_model, paper_skin, simulated_keys(paper_skin.ids, 0), "127.0.0.1", 9)
    with ThreadedArm(options, panda_model.description.q_ready, SceneSpec()) as arm:
        begin, ages = time.monotonic(), []
        while time.monotonic() < begin + 2.0:
            ages.append(-arm.read().stamp + time.monotonic())
            time.sleep(0.01)
        assert arm.left_out > 0.2
    assert len(ages) > 80
    assert np.mean(np.array(ages) < FailureParams().state_timeout_s) > 0.9
