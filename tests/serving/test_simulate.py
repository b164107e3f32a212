import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.errors import HardwareError, ParameterError
from pretouch.hardware.receiver import SkinReceiver
from pretouch.serving import simulate
from pretouch.serving.fleet import FleetParams, simulated_keys
from pretouch.serving.network import network
from pretouch.serving.simulate import SimulateOptions, VisitingHand, run
from pretouch.serving.unit import UnitParams
from pretouch.sim.imu import ImuParams
from pretouch.types import Mode, RangeStatus


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


@pytest.mark.slow
def test_units_send_in_real_time_what_a_receiver_of_the_same_keys_believes(options, receiver, paper_skin):
    said = simulated(
        options(receiver.address), receiver,
        lambda r, said: len(said) >= 2 and all(unit.accepted > 50 for unit in r.units),
    )  # fmt: skip
    readings = receiver.readings()
    assert np.isfinite(readings.stamp).all()
    assert not (readings.status == RangeStatus.NONE).any()
    assert (receiver.readings().stamp <= time.monotonic()).all()
    assert sum(receiver.rejected.values()) == 0
    assert [unit.clock_jumps for unit in receiver.units] == [0] * len(paper_skin)
    assert "7 of 7 units in session" in said[-1]
    assert {batch.unit for batch in receiver.take_imu()} == set(range(7))


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
    nobody = ("127.0.0.1", 9)  # no one listens at the discard port
    run(options(nobody, duration_s=2.1, fleet=FleetParams()), lambda: False, said.append)
    assert 2.0 < time.monotonic() - begin < 30.0
    assert len(said) == 2
    assert all("0 of 7 units in session" in line for line in said)


def test_a_receiver_that_does_not_answer_is_named_once():
    units, said = [SimpleNamespace(in_session=False, silent=False)], []
    fleet = SimpleNamespace(ids=["a"], units=units, sent=0, lost=0, receiver=("desk", 29470))
    clock = SimpleNamespace(now=0.0, left_out=0.0)
    cycle = SimpleNamespace(step=SimpleNamespace(ee_velocity=np.zeros(3), mode=Mode.TRACK))
    printer = simulate._StatusPrinter(fleet, clock, said.append)
    for second in range(1, 20):
        clock.now, units[0].in_session = float(second), 8 <= second < 12
        printer.record(cycle)
    named = [i for i, line in enumerate(said) if line.startswith("No answer from desk:29470: ")]
    assert [i - k for k, i in enumerate(named)] == [3, 14]  # after the lines of so many seconds


def test_a_unit_there_is_not_cannot_be_silenced(options):
    with pytest.raises(HardwareError, match=r"Unknown unit elbow: choose from hand_left"):
        options(("127.0.0.1", 9), silenced=frozenset({"elbow"}))
    with pytest.raises(ParameterError, match=r"SimulateOptions.duration_s"):
        options(("127.0.0.1", 9), duration_s=-1.0)
    with pytest.raises(ParameterError, match=r"SimulateOptions.seed is -1"):
        options(("127.0.0.1", 9), seed=-1)
    with pytest.raises(HardwareError, match=r"The receiver's address is empty"):
        run(options(("", 9)), lambda: True, lambda _: None)
    with pytest.raises(HardwareError, match=r"port is 0"):
        run(options(("127.0.0.1", 0)), lambda: True, lambda _: None)


def test_the_hand_comes_and_goes():
    class Arm:
        link_position = np.array([[0.5, 0.1, 0.4]])

    hand, goal = VisitingHand(0), []
    for at in (4.9, 5.1, 9.9, 10.1, 20.1, 25.1):
        goal.append(hand.goal(at, np.zeros(3), Arm()).position.tolist())
    near, away = [0.8, 0.1, 0.4], [1.2, 0.0, 0.8]
    assert goal == [pytest.approx(place) for place in (away, near, near, away, near, away)]
