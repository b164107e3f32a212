"""Simulated sensor units and a simulated arm, in real time: what comes of them at a receiver and at a controller."""

import threading
import time
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.arms.simulated import arm as arms
from pretouch.arms.simulated.arm import SimulatedArm, ThreadedArm
from pretouch.arms.simulated.skin import VisitingHand, run
from pretouch.control.path import Circle
from pretouch.params import FailureParams
from pretouch.profiles import Profile
from pretouch.sim.plant import Plant
from pretouch.sim.scene import SceneSpec
from pretouch.types import RobotState
from pretouch.units.fleet import Fleet, FleetParams, simulated_keys

NOBODY = ("127.0.0.1", 9)
"""No one listens at the discard port."""


@pytest.fixture
def fleet(paper_skin):
    """The units of the paper's skin, which send to nobody."""
    with closing(Fleet(paper_skin.network, simulated_keys(paper_skin.ids, 0), FleetParams(), 3, NOBODY)) as made:
        yield made


@pytest.mark.slow
def test_it_ends_in_order_and_says_how_it_went_each_second(fleet, panda_model, paper_skin):
    said, begin = [], time.monotonic()
    fleet.set_faults(paper_skin.ids[:1], paper_skin.ids[1:2])
    assert [(unit.silent, unit.stuck) for unit in fleet.units[:3]] == [(True, False), (False, True), (False, False)]
    run(panda_model, paper_skin, fleet, Circle(), Profile(), True, lambda now: now >= 2.1, said.append)
    assert 2.0 < time.monotonic() - begin < 30.0
    assert len(said) == 2
    words = f"0 of 7 units in session; without session: {', '.join(paper_skin.ids)}"
    assert all(words in line for line in said)


def test_the_hand_comes_and_goes():
    hand, arm = VisitingHand(0), SimpleNamespace(link_position=np.array([[0.5, 0.1, 0.4]]))
    goal = [hand.goal(at, np.zeros(3), arm).position.tolist() for at in (4.9, 5.1, 9.9, 10.1, 20.1, 25.1)]
    near, away = [0.8, 0.1, 0.4], [1.2, 0.0, 0.8]
    assert goal == [pytest.approx(place) for place in (away, near, near, away, near, away)]


# The arm by itself: its clock


@pytest.fixture
def begun(panda_model, paper_skin, fleet):
    q = panda_model.description.q_ready
    arm = SimulatedArm(panda_model, q, paper_skin, fleet, SceneSpec(), 0.01)
    arm.begin()
    return arm


def test_instants_of_the_simulation_are_told_by_the_machines_clock(begun):
    for _ in range(5):
        tick = begun.tick()
        assert 0.0 <= time.monotonic() - begun.monotonic(tick) < 1.0
    first = begun.monotonic(tick)
    assert begun.monotonic(tick + 0.25) - first == pytest.approx(0.25)


def test_a_machine_that_is_late_leaves_time_out(begun):
    before = begun.tick()
    time.sleep(0.3)
    tick = begun.tick()
    assert begun.left_out > 0.1
    assert tick - before == pytest.approx(0.01)
    assert begun.monotonic(tick) <= time.monotonic()


# The arm that moves on by itself: what its states are stamped with, and how far the machine is behind


class ScriptedArm:
    """A simulation whose states are stamped so much after their tick [s], and which stands while it is not let go."""

    def __init__(self, q):
        self.q, self.ahead, self.left_out, self.plant = q, 0.0, 0.0, SimpleNamespace()
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


@pytest.fixture
def simulation(panda_model):
    return ScriptedArm(panda_model.description.q_ready)


@pytest.fixture
def arm(panda_model, paper_skin, simulation, monkeypatch):
    monkeypatch.setattr(arms, "SimulatedArm", lambda *_: simulation)
    with ThreadedArm(panda_model, panda_model.description.q_ready, paper_skin, None, SceneSpec()) as arm:
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
    simulation.left_out = 0.3
    simulation.goes_on.set()
    while arm.left_out < 0.3:
        assert time.monotonic() < stood.stamp + 10.0
    assert arm.report() == "This machine is too slow by 0.3 s for the simulation."


def test_a_machine_that_is_always_too_slow_still_hands_out_states_that_a_controller_believes(
    panda_model, paper_skin, fleet, monkeypatch
):
    advance = Plant.advance

    def slowly(plant, duration):
        time.sleep(1.5 * duration)
        advance(plant, duration)

    monkeypatch.setattr(Plant, "advance", slowly)
    with ThreadedArm(panda_model, panda_model.description.q_ready, paper_skin, fleet, SceneSpec()) as arm:
        begin, ages = time.monotonic(), []
        while time.monotonic() < begin + 2.0:
            ages.append(-arm.read().stamp + time.monotonic())
            time.sleep(0.01)
        assert arm.left_out > 0.2
    assert len(ages) > 80
    assert np.mean(np.array(ages) < FailureParams().state_timeout_s) > 0.9
