"""A simulated arm that makes a calibration motion in real time, while its units tell a receiver of it."""

import threading
import time

import numpy as np
import pytest
from tests.calibrated_arm import swinging

from pretouch.errors import HardwareError
from pretouch.hardware.receiver import SkinReceiver
from pretouch.serving.simulate import run_motion
from pretouch.serving.simulated_arm import SimulatedArm, SimulateOptions
from pretouch.serving.wire_skin import made_keys


@pytest.fixture
def options(panda_model, paper_skin):
    def made(address: tuple[str, int]) -> SimulateOptions:
        return SimulateOptions(panda_model, paper_skin, made_keys(paper_skin.ids, 0), *address)

    return made


@pytest.mark.slow
def test_once_all_units_are_heard_the_arm_makes_its_motion_and_each_state_is_kept(panda_model, paper_skin, options):
    plan, states, said, over = swinging(panda_model, 3.0), [], [], threading.Event()
    with SkinReceiver(paper_skin.ids, made_keys(paper_skin.ids, 0)) as receiver:
        arguments = (options(receiver.address), plan, states.append, over.is_set, said.append)
        other = threading.Thread(target=run_motion, args=arguments)
        begun = time.monotonic()
        other.start()
        give_up = begun + 60
        while other.is_alive() and time.monotonic() < give_up:
            receiver.receive(0.02)
        over.set()
        other.join()
        received = receiver.take_imu()
    assert said[-1] == "The motion of 3 s is over."
    stamp, q = (np.array([getattr(state, name) for state in states]) for name in ("stamp", "q"))
    assert (np.diff(stamp) > 0).all()
    assert begun < stamp[0] < stamp[-1] < time.monotonic()
    assert stamp[-1] - stamp[0] == pytest.approx(3.0 + 3.0 + 0.5, abs=0.2)
    assert np.ptp(q, axis=0) == pytest.approx(np.ptp(plan.sampled(100).q, axis=0), rel=0.05, abs=0.003)
    assert np.abs(q[-1] - plan.end).max() < 0.01
    moves = stamp[np.abs(q - q[0]).max(axis=1) > 0.01]
    at = np.concatenate([batch.stamp for batch in received if batch.unit == 0])
    turning = np.concatenate([batch.angular_velocity for batch in received if batch.unit == 0])
    standing, moving = at < moves[0] - 0.2, (at > moves[0]) & (at < moves[-1])
    assert np.ptp(turning[moving], axis=0).max() > 10 * np.ptp(turning[standing], axis=0).max()


def test_it_waits_where_nobody_listens_until_it_is_told_to_end(panda_model, options):
    kept, end = [], time.monotonic() + 1.0
    run_motion(options(("127.0.0.1", 9)), swinging(panda_model), kept.append, lambda: time.monotonic() > end, print)
    assert kept == []


def test_instants_of_the_simulation_are_told_by_the_machines_clock(panda_model, options):
    with SimulatedArm(options(("127.0.0.1", 9)), panda_model.description.q_ready, 0.01) as arm:
        arm.begin()
        for _ in range(5):
            tick = arm.tick()
            assert 0.0 <= time.monotonic() - arm.monotonic(tick) < 1.0
        first = arm.monotonic(tick)
        assert arm.monotonic(tick + 0.25) - first == pytest.approx(0.25)


def test_a_machine_that_is_late_leaves_time_out_or_makes_up_for_it(panda_model, options):
    for late, left_out in ((0.1, True), (5.0, False)):
        arm = SimulatedArm(options(("127.0.0.1", 9)), panda_model.description.q_ready, 0.01, late=late)
        with arm:
            arm.begin()
            begun = arm.tick()
            time.sleep(0.3)
            tick = arm.tick()
            assert (arm.clock.left_out > 0.1) == left_out
            assert tick - begun == pytest.approx(0.01)
            assert arm.monotonic(tick) <= time.monotonic()


def test_a_receiver_that_cannot_be_found_is_said(panda_model, options):
    with pytest.raises(HardwareError, match="The receiver's address is empty"):
        run_motion(options(("", 9)), swinging(panda_model), print, lambda: True, print)
