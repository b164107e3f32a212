"""The receiver against what is not genuine, and against a genuine unit gone mad."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pretouch.units.session import PENDING_MOST
from pretouch.units.wire import SAMPLE_LEAST, Flag, Hello, Mac, decode_beacon
from tests.units.fake_unit import KEYS, PLAIN, FakeUnit, imu_taken


def counters(bench):
    return [(unit.accepted, unit.sessions, unit.last_arrival) for unit in bench.receiver.units]


@pytest.mark.parametrize(
    "changes",
    [
        {"imu_count": 255},
        {"imu_count": 1},
        {"time_us": 2**64 - 1},
        {"time_us": 0, "range_age_us": 2**32 - 1, "beacon_hold_us": 2**32 - 1, "imu_age_us": 2**32 - 1},
        {"beacon": 2**32 - 1},
        {"range_status": 254, "range_mm": 65535},
    ],
)
def test_a_unit_gone_mad_harms_only_itself(bench, changes):
    bench.join()
    for _ in range(5):
        bench.now += 0.02
        bench.send(bench.units[0].sample(bench.now, **changes), bench.units[1].sample(bench.now))
        bench.deliver()
        imu_taken(bench.receiver)
        readings = bench.receiver.readings()
        assert readings.stamp[0] <= bench.now
        assert bench.now - readings.stamp[1] < 0.1


def flipped(datagram):
    """Give all that differ in one bit."""
    for bit in range(8 * len(datagram)):
        bad = bytearray(datagram)
        bad[bit // 8] ^= 1 << bit % 8
        yield bytes(bad)


def test_each_flipped_bit_of_a_hello_makes_it_worthless(bench):
    hello = bench.units[0].hello(bench.now)
    for bad in flipped(hello):
        bench.send(bad)
    assert bench.answers() == []
    assert bench.receiver.units[0].state == "never heard"
    bench.send(hello)
    assert len(bench.answers()) == 1


def test_each_flipped_bit_of_a_sample_makes_it_worthless(bench):
    bench.join()
    before = counters(bench)
    sample = bench.units[0].sample(bench.now)
    assert not any(bench.send(bad) for bad in flipped(sample))
    assert counters(bench) == before
    assert sum(bench.receiver.rejected.values()) == 8 * len(sample)
    assert bench.send(sample) == 1


def test_each_flipped_bit_of_a_beacon_makes_it_worthless(bench):
    bench.send(bench.units[0].hello(bench.now))
    [beacon] = bench.answers()
    for bad in flipped(beacon):
        assert decode_beacon(bad, bench.units[0].mac, bench.units[0].challenge) is None
    assert bench.units[0].hear(beacon, bench.now)


def test_every_other_length_is_refused(bench):
    bench.join()
    sample, hello = bench.units[0].sample(bench.now), bench.units[0].hello(bench.now)
    flags, zones = int(Flag.RANGE_NEW | Flag.ZONES), bytes([2, 0]) + bytes(5 * 4)
    zoned = bench.units[0].sample(bench.now, flags=flags, zones=zones)
    for whole in (sample, zoned, hello):
        for size in range(len(whole)):
            assert bench.send(whole[:size]) == 0
        for more in (1, 12, 300, 1990, 5000):
            assert bench.send(whole + bytes(more)) == 0
    assert bench.answers() == []
    assert [bench.send(sample), bench.send(zoned)] == [1, 1]


def test_samples_without_any_imu_and_of_the_most_are_taken(bench):
    bench.join()
    for count in (0, 32):
        assert bench.send(bench.units[0].sample(bench.now, imu_count=count, imu=bytes(12 * count))) == 1
    assert len(bench.units[0].sample(bench.now, imu_count=0, imu=b"")) == SAMPLE_LEAST


def test_other_versions_kinds_and_units_are_refused_by_reason(bench):
    bench.join()
    sample = bytearray(bench.units[0].sample(bench.now))
    for place, number in ((0, 0), (2, 2), (3, 2), (3, 7)):
        bad = bytearray(sample)
        bad[place] = number
        bench.send(bytes(bad))
    assert bench.receiver.rejected["format"] == 4
    stranger = FakeUnit(KEYS["unit 5"])
    bench.send(stranger.hello(bench.now))
    assert bench.receiver.rejected["unit"] == 1
    assert bench.answers() == []


def test_the_key_of_one_unit_is_worth_nothing_for_another(bench):
    bench.join()
    unit, other = bench.units
    before = counters(bench)
    bench.send(Hello(3, 0x0102, 1, b"fraudful", 1).encode(other.mac))
    bench.send(replace(PLAIN, unit=3, sequence=99).encode(other.session))
    bench.send(replace(PLAIN, unit=4, sequence=99).encode(unit.session))
    assert counters(bench) == before
    assert bench.receiver.rejected["tag"] == 3
    assert bench.answers() == []


def test_units_may_swap_addresses(bench):
    bench.join()
    bench.run(1.0)
    with bench.new_socket() as elsewhere:
        bench.now += 0.02
        assert bench.send(bench.units[0].sample(bench.now), by=elsewhere) == 1
        assert bench.receiver.units[0].address == elsewhere.getsockname()
        bench.now += 0.6
        bench.send(bench.units[0].sample(bench.now), by=elsewhere)
        [beacon] = bench.answers(elsewhere)
        assert bench.units[0].hear(beacon, bench.now)


def test_a_flood_between_two_calls_keeps_a_call_short_and_loses_nothing_genuine(bench):
    bench.join()
    forged = replace(PLAIN, sequence=10**6).encode(Mac(bytes(32)))
    replayed = bench.units[0].sample(bench.now)
    assert bench.send(replayed) == 1
    accepted, calls = 0, 0
    for _ in range(20):
        bench.now += 0.02
        for datagram in (forged, replayed) * 1000:
            bench.socket.sendto(datagram, bench.receiver.address)
        accepted += bench.send(bench.units[0].sample(bench.now))
        while bench.receiver.behind:
            accepted += bench.receiver.receive()
            calls += 1
    assert accepted == 20
    assert calls >= 20
    assert bench.receiver.rejected["tag"] == bench.receiver.rejected["replayed"] == 20_000
    assert bench.receiver.buffer_bytes > 0


def test_a_flood_takes_no_memory(bench):
    bench.join()
    rng, unit = np.random.default_rng(0), bench.units[0]
    wrong = Mac(bytes(32))
    hellos = [Hello(int(n), 0, 0, rng.bytes(8), 1).encode(wrong) for n in rng.integers(0, 65536, 300)]
    recorded = [Hello(3, 0, 0, rng.bytes(8), 1).encode(unit.mac) for _ in range(300)]
    samples = [replace(PLAIN, unit=int(n), sequence=9).encode(wrong) for n in rng.integers(0, 65536, 300)]
    random = [rng.bytes(int(n)) for n in rng.integers(0, 600, 300)]
    sockets = [bench.new_socket() for _ in range(5)]

    def flood() -> None:
        for k in range(5):
            bench.send(*hellos, *recorded, *samples, *random, by=sockets[k])
            bench.now += 0.1

    flood()
    tracemalloc.start()
    flood()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(20):
        flood()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    for made in sockets:
        made.close()
    assert grown < 20_000
    assert len(bench.receiver._endpoints[0]._link._pending) <= PENDING_MOST
