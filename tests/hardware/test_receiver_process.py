"""What the receiver's process does in each turn, without a process."""

import time

import numpy as np
import pytest

from pretouch.hardware.link import LinkParams
from pretouch.hardware.receiver_process import ReceiverService, SharedOutputs, SuspendWatch, suspended
from pretouch.types import RangeStatus
from tests.hardware.fake_unit import IDS, KEYS, Bench


class Machine:
    """One that can be suspended."""

    def __init__(self):
        self.suspended = 5.0

    def __call__(self):
        return self.suspended


def test_a_suspension_is_noticed_once():
    machine = Machine()
    watch = SuspendWatch(machine)
    assert not watch.noticed()
    machine.suspended += 0.03
    assert [watch.noticed(), watch.noticed()] == [True, False]


def test_two_clocks_read_one_after_the_other_are_no_suspension():
    machine = Machine()
    watch = SuspendWatch(machine)
    for late in (0.5, 0.0, 0.019, 0.0):  # between the two readings the process had to wait
        machine.suspended = 5.0 - late
        assert not watch.noticed()
    machine.suspended = 5.03
    assert watch.noticed()


def test_this_machine_tells_how_long_it_was_suspended():
    told = [suspended() for _ in range(100)]
    assert min(told) >= -0.01
    assert max(told) - min(told) < 60.0


@pytest.fixture
def service():
    machine, outputs = Machine(), SharedOutputs(IDS, 100)
    made = ReceiverService(tuple(KEYS[id] for id in IDS), ("127.0.0.1", 0), LinkParams(), outputs, machine)
    with Bench() as bench:
        bench.receiver.close()
        bench.receiver = made.receiver
        bench.now = time.monotonic()
        yield made, bench, outputs, machine


def answer(service, bench, *datagrams):
    for datagram in datagrams:
        bench.socket.sendto(datagram, service.receiver.address)
    service.step()
    bench.now = time.monotonic()
    bench.deliver()


def test_samples_come_out_as_they_were_sent(service):
    made, bench, outputs, _ = service
    answer(made, bench, *[unit.hello(bench.now) for unit in bench.units])
    answer(made, bench, *[unit.sample(time.monotonic(), range_mm=432, imu=b"0123456789ab" * 2) for unit in bench.units])
    samples = outputs.take_samples()
    assert [(one.unit, one.sample.unit, one.sample.range_mm) for one in samples] == [(0, 3, 432), (1, 4, 432)]
    assert {one.sample.imu for one in samples} == {b"0123456789ab" * 2}
    assert samples[0].sample == made.receiver.units[0].sample
    table = np.frombuffer(outputs.readings()).reshape(3, -1)
    assert samples[0].stamp == table[0, 0] == made.receiver.units[0].last_reading_stamp
    assert (samples[0].offset, samples[0].bound) == (made.receiver.units[0].offset, made.receiver.units[0].bound)


def test_after_a_suspension_there_is_no_reading_until_a_unit_is_heard_anew(service):
    made, bench, outputs, machine = service
    answer(made, bench, *[unit.hello(bench.now) for unit in bench.units])
    answer(made, bench, *[unit.sample(time.monotonic()) for unit in bench.units])
    outputs.take_samples()
    machine.suspended += 60.0
    answer(made, bench, *[unit.sample(time.monotonic()) for unit in bench.units])
    table = np.frombuffer(outputs.readings()).reshape(3, -1)
    assert np.all(table[0] == -np.inf)
    assert np.all(table[2] == RangeStatus.NONE)
    assert outputs.take_samples() == [], "their stamps are of a clock that stood still"
