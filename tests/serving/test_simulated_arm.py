"""A simulated arm in real time: its clock, and a receiver that is not there."""

import time

import pytest

from pretouch.errors import HardwareError
from pretouch.serving.fleet import simulated_keys
from pretouch.serving.simulate import run
from pretouch.serving.simulated_arm import SimulatedArm, SimulateOptions


@pytest.fixture
def options(panda_model, paper_skin):
    def made(address: tuple[str, int]) -> SimulateOptions:
        return SimulateOptions(panda_model, paper_skin, simulated_keys(paper_skin.ids, 0), *address)

    return made


def test_instants_of_the_simulation_are_told_by_the_machines_clock(panda_model, options):
    with SimulatedArm(options(("127.0.0.1", 9)), panda_model.description.q_ready, 0.01) as arm:
        arm.begin()
        for _ in range(5):
            tick = arm.tick()
            assert 0.0 <= time.monotonic() - arm.monotonic(tick) < 1.0
        first = arm.monotonic(tick)
        assert arm.monotonic(tick + 0.25) - first == pytest.approx(0.25)


def test_a_machine_that_is_late_leaves_time_out(panda_model, options):
    with SimulatedArm(options(("127.0.0.1", 9)), panda_model.description.q_ready, 0.01) as arm:
        arm.begin()
        begun = arm.tick()
        time.sleep(0.3)
        tick = arm.tick()
        assert arm.clock.left_out > 0.1
        assert tick - begun == pytest.approx(0.01)
        assert arm.monotonic(tick) <= time.monotonic()


def test_a_receiver_that_cannot_be_found_is_said(panda_model, options):
    with pytest.raises(HardwareError, match="The receiver's address is empty"):
        run(options(("", 9)), lambda: True, print)
