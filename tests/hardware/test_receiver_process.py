"""What the receiver's process does in each turn, without a process."""

import time

import numpy as np
import pytest

from pretouch.hardware.link import LinkParams
from pretouch.hardware.receiver_process import ReceiverService, SharedOutputs
from pretouch.hardware.wire import Flag
from pretouch.types import RangeStatus
from tests.hardware.fake_unit import IDS, KEYS, Bench


@pytest.fixture
def service():
    outputs = SharedOutputs(IDS, 100)
    made = ReceiverService(tuple(KEYS[id] for id in IDS), ("127.0.0.1", 0), LinkParams(), outputs)
    with Bench() as bench:
        bench.receiver.close()
        bench.receiver = made.receiver
        bench.now = time.monotonic()
        yield made, bench, outputs


def answer(service, bench, *datagrams):
    for datagram in datagrams:
        bench.socket.sendto(datagram, service.receiver.address)
    service.step()
    bench.now = time.monotonic()
    bench.deliver()


def test_samples_come_out_as_they_were_sent(service):
    made, bench, outputs = service
    answer(made, bench, *[unit.hello(bench.now) for unit in bench.units])
    answer(made, bench, *[unit.sample(time.monotonic(), range_mm=432, imu=b"0123456789ab" * 2) for unit in bench.units])
    samples = outputs.take_samples()
    assert [(one.unit, one.sample.unit, one.sample.range_mm) for one in samples] == [(0, 3, 432), (1, 4, 432)]
    assert {one.sample.imu for one in samples} == {b"0123456789ab" * 2}
    assert samples[0].sample == made.receiver.units[0].sample
    table = np.frombuffer(outputs.readings()).reshape(3, -1)
    assert samples[0].stamp == table[0, 0] == made.receiver.units[0].last_reading_stamp
    assert (samples[0].offset, samples[0].bound) == (made.receiver.units[0].offset, made.receiver.units[0].bound)


def test_a_unit_with_zones_that_its_skin_does_not_know_is_named_and_ends_nothing(service):
    made, bench, outputs = service
    answer(made, bench, *[unit.hello(bench.now) for unit in bench.units])
    zones = b"\x08\x00" + bytes(5 * 64)
    flags = Flag.RANGE_NEW | Flag.ZONES
    answer(made, bench, bench.units[0].sample(time.monotonic(), flags=flags, zones=zones, imu_count=32, imu=bytes(384)))
    (received,) = outputs.take_samples()
    assert received.sample.zones == zones
    assert made.receiver.units[0].misfits == 1
    assert np.frombuffer(outputs.readings()).reshape(3, -1)[2, 0] == RangeStatus.NONE
