"""Simulated sensor units and a simulated arm, in real time: what comes of them at a receiver and at a controller."""

import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.arms.simulated import skin, threaded
from pretouch.arms.simulated.arm import SimulatedArm
from pretouch.arms.simulated.skin import SimulateOptions, VisitingHand, run
from pretouch.arms.simulated.threaded import ThreadedArm
from pretouch.errors import HardwareError
from pretouch.params import FailureParams
from pretouch.sim.imu import ImuParams
from pretouch.sim.plant import Plant
from pretouch.sim.scene import SceneSpec
from pretouch.types import Mode, RobotState
from pretouch.units.channel import network
from pretouch.units.fleet import FleetParams, simulated_keys
from pretouch.units.receiver import SkinReceiver
from pretouch.units.simulated import UnitParams

NOBODY = ("127.0.0.1", 9)
"""No one listens at the discard port."""


@pytest.fixture
def options(panda_model, paper_skin):
    def made(address: tuple[str, int], **changes) -> SimulateOptions:
        keys = simulated_keys(paper_skin.ids, 0)
        return replace(SimulateOptions(panda_model, paper_skin, keys, *address), **changes)

    return made


@pytest.fixture
def receiver(paper_skin):
    with SkinReceiver(paper_skin.ids, simulated_keys(paper_skin.ids, 0)) as made:
        yield made


def simulated(options: SimulateOptions, receiver: SkinReceiver, until) -> list[str]:
    """Simulate beside a receiver until that knows what it is to know, and return what was said."""
    said, over = [], threading.Event()
    other = threading.Thread(target=run, args=(options, over.is_set, said.append))
    other.start()
    give_up = time.monotonic() + 60
    try:
        while not until(receiver, said) and other.is_alive() and time.monotonic() < give_up:
            receiver.receive(0.02)
    finally:
        over.set()
        other.join()
    assert time.monotonic() < give_up, "it never came to that"
    return said


def test_units_that_are_silent_stuck_or_reboot_are_so_at_the_receiver(options, receiver, paper_skin):
    fleet = FleetParams(network(loss=0.05), UnitParams(boot_s=0.1), ImuParams(), reboot_every_s=2.5)
    silent, stuck = paper_skin.ids[0], paper_skin.ids[1]
    chosen = options(
        receiver.address, fleet=fleet, silenced=frozenset({silent}), stuck=frozenset({stuck}), hand=False, seed=3
    )
    seen_stuck = []

    def enough(r: SkinReceiver, _: list[str]) -> bool:
        seen_stuck.append(r.units[1].stuck)
        return any(seen_stuck) and sum(unit.reboots for unit in r.units) > 3

    said = simulated(chosen, receiver, enough)
    assert receiver.units[0].state == "never heard"
    assert not any(unit.stuck for unit in receiver.units[2:])
    assert all(silent in line for line in said)


@pytest.mark.slow
def test_it_ends_by_itself_in_order_and_says_how_it_went_each_second(options):
    said = []
    begin = time.monotonic()
    run(options(NOBODY, duration_s=2.1, fleet=FleetParams()), lambda: False, said.append)
    assert 2.0 < time.monotonic() - begin < 30.0
    assert len(said) == 2
    assert all("0 of 7 units in session" in line for line in said)


def test_a_receiver_that_does_not_answer_is_named_once():
    units, said = [SimpleNamespace(in_session=False, silent=False)], []
    fleet = SimpleNamespace(ids=["a"], units=units, sent=0, lost=0, receiver=("desk", 29470))
    clock = SimpleNamespace(now=0.0, left_out=0.0)
    cycle = SimpleNamespace(step=SimpleNamespace(ee_velocity=np.zeros(3), mode=Mode.TRACK))
    printer = skin._StatusPrinter(fleet, clock, said.append)
    for second in range(1, 20):
        clock.now, units[0].in_session = float(second), 8 <= second < 12
        printer.record(cycle)
    named = [i for i, line in enumerate(said) if line.startswith("No answer from desk:29470: ")]
    assert [i - k for k, i in enumerate(named)] == [3, 14]  # after the lines of so many seconds


def test_a_unit_there_is_not_cannot_be_silenced(options):
    with pytest.raises(HardwareError, match=r"Unknown unit elbow: choose from hand_left"):
        options(NOBODY, silenced=frozenset({"elbow"}))


def test_the_hand_comes_and_goes():
    hand, arm = VisitingHand(0), SimpleNamespace(link_position=np.array([[0.5, 0.1, 0.4]]))
    goal = [hand.goal(at, np.zeros(3), arm).position.tolist() for at in (4.9, 5.1, 9.9, 10.1, 20.1, 25.1)]
    near, away = [0.8, 0.1, 0.4], [1.2, 0.0, 0.8]
    assert goal == [pytest.approx(place) for place in (away, near, near, away, near, away)]


# The arm by itself: its clock


def test_instants_of_the_simulation_are_told_by_the_machines_clock(panda_model, options):
    with SimulatedArm(options(NOBODY), panda_model.description.q_ready, 0.01) as arm:
        arm.begin()
        for _ in range(5):
            tick = arm.tick()
            assert 0.0 <= time.monotonic() - arm.monotonic(tick) < 1.0
        first = arm.monotonic(tick)
        assert arm.monotonic(tick + 0.25) - first == pytest.approx(0.25)


def test_a_machine_that_is_late_leaves_time_out(panda_model, options):
    with SimulatedArm(options(NOBODY), panda_model.description.q_ready, 0.01) as arm:
        arm.begin()
        begun = arm.tick()
        time.sleep(0.3)
        tick = arm.tick()
        assert arm.clock.left_out > 0.1
        assert tick - begun == pytest.approx(0.01)
        assert arm.monotonic(tick) <= time.monotonic()


# The arm that moves on by itself: what its states are stamped with, and how far the machine is behind


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
def arm(panda_model, options, simulation, monkeypatch):
    monkeypatch.setattr(threaded, "SimulatedArm", lambda *_: simulation)
    with ThreadedArm(options(NOBODY), panda_model.description.q_ready, SceneSpec()) as arm:
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
    panda_model, options, monkeypatch
):
    advance = Plant.advance

    def slowly(plant, duration):
        time.sleep(1.5 * duration)
        advance(plant, duration)

    monkeypatch.setattr(Plant, "advance", slowly)
    with ThreadedArm(options(NOBODY), panda_model.description.q_ready, SceneSpec()) as arm:
        begin, ages = time.monotonic(), []
        while time.monotonic() < begin + 2.0:
            ages.append(-arm.read().stamp + time.monotonic())
            time.sleep(0.01)
        assert arm.left_out > 0.2
    assert len(ages) > 80
    assert np.mean(np.array(ages) < FailureParams().state_timeout_s) > 0.9
