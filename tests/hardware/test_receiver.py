"""The receiver at a real socket, under a clock set by hand: what it takes in, what it makes of it, what it refuses."""

import math
import socket
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pretouch.errors import HardwareError
from pretouch.hardware.link import LinkParams
from pretouch.hardware.receiver import SkinReceiver
from pretouch.hardware.wire import SAMPLE_LEAST, Flag, Hello, Mac, decode_beacon
from pretouch.types import RangeStatus
from tests.hardware.fake_unit import IDS, KEYS, PLAIN, Bench, FakeUnit


@pytest.fixture
def bench():
    with Bench() as made:
        yield made


@pytest.fixture
def unfiltered(monkeypatch):
    """Without the filter in the kernel, as on other systems: the receiver must throw away all garbage itself."""
    monkeypatch.setattr("pretouch.hardware.receiver.attach_filter", lambda _: False)
    with Bench() as made:
        yield made


def counters(bench):
    return [(unit.accepted, unit.sessions, unit.last_arrival) for unit in bench.receiver.units]


def test_before_any_unit_speaks_all_is_unknown(bench):
    readings = bench.receiver.readings()
    assert np.all(readings.stamp == -np.inf)
    assert np.all(readings.status == RangeStatus.NONE)
    assert [unit.state for unit in bench.receiver.units] == ["never heard"] * 2
    assert bench.receiver.receive() == 0


def test_a_unit_joins_and_its_readings_come_through(bench):
    bench.send(bench.units[0].hello(bench.now))
    assert bench.receiver.units[0].state == "greeting"
    assert bench.receiver.units[0].address is None, "a hello may be a recorded one, from anywhere"
    bench.deliver()
    bench.now += 0.02
    assert bench.send(bench.units[0].sample(bench.now, range_mm=612, range_status=4)) == 1
    readings, unit = bench.receiver.readings(), bench.receiver.units[0]
    assert readings.distance[0] == 0.612
    assert readings.status.tolist() == [4, RangeStatus.NONE]
    assert unit.state == "live"
    assert (unit.firmware, unit.sessions, unit.reboots, unit.accepted) == (0x0102, 1, 0, 1)
    # measured 10 ms before now; the beacon took no time at all, so only the 20 ms of the sample's hold are unsure
    assert bench.now - 0.01 - 0.0201 < readings.stamp[0] <= bench.now - 0.01
    assert unit.offset == pytest.approx(bench.units[0].offset, abs=unit.bound)


def test_no_stamp_is_later_than_the_measurement(bench):
    bench.join()
    rng = np.random.default_rng(1)
    for _ in range(200):
        bench.now += 0.02
        made, age = bench.now, int(rng.integers(0, 30_000))
        datagram = bench.units[0].sample(made, range_age_us=age)
        bench.now += rng.exponential(0.01)
        bench.send(datagram)
        bench.now += rng.exponential(0.003)
        bench.deliver()
        [received] = bench.receiver.take_samples()[-1:]
        assert received.stamp <= made - 1e-6 * age
        assert received.stamp >= made - 1e-6 * age - 2 * received.bound - 1e-5
        assert received.arrival >= made


def test_a_late_reading_never_replaces_a_newer_one(bench):
    bench.join()
    early = bench.units[0].sample(bench.now, range_mm=100)
    bench.now += 0.02
    bench.send(bench.units[0].sample(bench.now, range_mm=200))
    assert bench.send(early) == 1
    assert bench.receiver.readings().distance[0] == 0.2


def test_a_late_reading_of_which_a_better_bound_is_known_does_not_replace_a_newer_one(bench):
    unit = bench.units[0]
    bench.send(unit.hello(bench.now))
    bench.now += 0.08  # the first beacon is long on its way, so that stamps are early
    bench.deliver()
    bench.send(unit.sample(bench.now))
    bench.now += 0.05
    late = unit.sample(bench.now, range_mm=4000)
    bench.now += 0.02
    bench.send(unit.sample(bench.now, range_mm=300))
    while not bench.deliver():
        bench.now += 0.01
        bench.receiver.receive()
    assert bench.send(unit.sample(bench.now, flags=0)) == 1
    assert bench.receiver.units[0].bound < 0.04
    assert bench.send(late) == 1
    assert bench.receiver.readings().distance[0] == 0.3


def test_readings_go_on_when_a_good_bound_drops_out_of_the_window(bench):
    bench.join()
    bench.run(5.0)
    unit, traffic, waiting, stamps = bench.units[0], bench.receiver.units[0], [], []
    for k in range(1500):
        bench.now += 0.01
        if k % 2 == 0:
            bench.send(unit.sample(bench.now))
            stamps.append(traffic.last_reading_stamp)
            assert stamps[-1] <= bench.now - 0.01
        bench.receiver.receive()
        waiting += [(bench.now + 0.15, datagram) for datagram in bench.answers()]
        while waiting and waiting[0][0] <= bench.now:
            unit.hear(waiting.pop(0)[1], bench.now)
    assert traffic.bound > 0.07
    assert np.diff(stamps) == pytest.approx(0.02, abs=1e-4)


def test_silence_lets_readings_grow_old_and_is_named(bench):
    bench.join()
    stamp = bench.receiver.readings().stamp.copy()
    bench.now += 5.0
    bench.receiver.receive()
    assert [unit.state for unit in bench.receiver.units] == ["silent"] * 2
    np.testing.assert_array_equal(bench.receiver.readings().stamp, stamp)


def test_a_unit_greets_until_a_second_after_its_last_hello(bench):
    traffic = bench.receiver.units[0]
    for _ in range(5):
        bench.now += 0.9
        bench.send(bench.units[0].hello(bench.now))
        assert traffic.state == "greeting"
    bench.now += 0.9
    bench.receiver.receive()
    assert traffic.state == "greeting"
    bench.now += 0.2
    bench.receiver.receive()
    assert traffic.state == "silent"
    bench.send(bench.units[0].hello(bench.now))
    assert traffic.state == "greeting"


def test_a_bus_error_renews_no_reading(bench):
    bench.join()
    stamp = bench.receiver.readings().stamp[0]
    bench.now += 0.02
    assert bench.send(bench.units[0].sample(bench.now, flags=int(Flag.RANGE_BUS_ERROR))) == 1
    assert bench.receiver.readings().stamp[0] == stamp
    assert bench.receiver.units[0].sample.flags == Flag.RANGE_BUS_ERROR


def test_beacons_come_four_times_a_second_with_growing_numbers(bench):
    bench.join()
    numbers = []
    for _ in range(100):
        bench.now += 0.02
        bench.send(*[unit.sample(bench.now) for unit in bench.units])
        numbers += [unit.beacon.number for unit in bench.units for d in bench.answers() if unit.hear(d, bench.now)]
    assert numbers[0::1] == sorted(numbers)
    assert 7 <= bench.units[0].beacon.number - 1 <= 8


def test_a_reading_that_repeats_to_the_last_digit_is_stuck_after_a_second(bench):
    bench.join()
    same = {"range_mm": 400}
    for k in range(60):
        bench.now += 0.02
        bench.send(bench.units[0].sample(bench.now, **same))
        assert k == 50 or bench.receiver.units[0].stuck == (k > 50)
    assert bench.receiver.readings().status[0] == RangeStatus.STUCK
    bench.now += 0.02
    bench.send(bench.units[0].sample(bench.now, range_mm=401))
    assert bench.receiver.readings().status[0] == RangeStatus.OK


def test_a_stream_count_that_stands_still_is_stuck(bench):
    bench.join()
    for _ in range(60):
        bench.now += 0.02
        bench.send(bench.units[0].sample(bench.now, range_stream=7))
    assert bench.receiver.readings().status[0] == RangeStatus.STUCK


def test_imu_samples_come_with_instants_and_units(bench):
    bench.join()
    bench.receiver.take_imu()
    bench.now += 0.02
    counts = np.array([[0, 0, 100, 0, 0, 16393], [0, 0, 200, 0, 0, 16393]], dtype="<i2")
    bench.send(bench.units[1].sample(bench.now, imu=counts.tobytes(), imu_index=40))
    [batch] = bench.receiver.take_imu()
    assert (batch.unit, batch.index) == (1, 40)
    np.testing.assert_allclose(batch.acceleration, [[0, 0, 9.8066]] * 2, atol=1e-3)
    np.testing.assert_allclose(batch.angular_velocity[:, 2], np.deg2rad([0.875, 1.75]))
    assert np.diff(batch.stamp) == pytest.approx(0.002)
    assert batch.stamp[-1] <= bench.now - 0.001
    assert bench.receiver.take_imu() == []


@pytest.mark.parametrize("changes", [{"imu_scale": 0x70}, {"imu_rate_hz": 0}])
def test_imu_settings_there_are_not_leave_only_the_imu_out(bench, changes):
    bench.join()
    bench.receiver.take_imu()
    bench.now += 0.02
    assert bench.send(bench.units[0].sample(bench.now, **changes)) == 1
    assert bench.receiver.take_imu() == []


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
        bench.receiver.take_imu()
        readings = bench.receiver.readings()
        assert readings.stamp[0] <= bench.now
        assert bench.now - readings.stamp[1] < 0.1


def test_samples_for_recordings_are_bounded_and_the_rest_is_counted():
    with Bench(params=LinkParams(samples_most=10)) as bench:
        bench.join()
        bench.run(0.2)
        assert bench.receiver.untaken == 12
        taken = bench.receiver.take_samples()
        assert [(one.unit, one.sample.sequence) for one in taken[-2:]] == [(0, 11), (1, 11)]
        assert len(taken) == 10
        assert bench.receiver.take_samples() == []


def test_lost_samples_are_counted_once_they_cannot_come_any_more(bench):
    bench.join()
    skipped = [bench.units[0].sample(bench.now) for _ in range(5)]
    bench.run(1.0)
    assert bench.send(skipped[0]) == 1  # within the window of 64
    assert bench.receiver.units[0].lost == 0
    bench.run(1.0)
    assert bench.receiver.units[0].lost == 4
    assert bench.send(skipped[1]) == 0  # behind it
    assert bench.receiver.units[0].replayed == 1


def test_a_reboot_is_told_from_a_session_that_was_lost(bench):
    bench.join()
    unit, traffic = bench.units[0], bench.receiver.units[0]
    for reboot in (False, True):
        bench.now += 3.0
        if reboot:
            unit.reboot(bench.now)
            bench.now += 1.0
        else:
            unit.leave()
        bench.send(unit.hello(bench.now))
        bench.deliver()
        assert bench.send(unit.sample(bench.now)) == 1
        assert traffic.reboots == int(reboot)
    assert traffic.sessions == 3
    assert bench.now - bench.receiver.readings().stamp[0] < 0.1


def test_a_clock_that_jumps_is_noticed_and_known_again_after_a_beacon(bench):
    bench.join()
    bench.run(2.0)
    for jump in (-3.0, 4.0):
        bench.units[0].offset += jump
        bench.units[0].heard_us -= round(1e6 * jump)
        before = bench.receiver.units[0].clock_jumps
        for _ in range(60):
            bench.run(0.02)
            assert bench.receiver.readings().stamp[0] <= bench.now - 0.01
        assert bench.receiver.units[0].clock_jumps > before
        assert bench.now - bench.receiver.readings().stamp[0] < 0.06
        assert bench.receiver.units[0].offset == pytest.approx(bench.units[0].offset, abs=0.03)


def test_after_a_jump_a_beacon_is_sent_at_once_and_only_its_echo_tells_the_time(bench):
    bench.join()
    bench.run(2.0)
    unit, unheard = bench.units[0], []
    while not unheard:
        bench.run(0.02)
        bench.now += 0.02
        bench.send(unit.sample(bench.now))
        unheard = [b for d in bench.answers() if (b := decode_beacon(d, unit.mac, unit.challenge))]
    unit.offset -= 4.0  # its clock went forward, and the hold it tells holds the jump
    bench.now += 0.02
    bench.send(unit.sample(bench.now))
    assert bench.receiver.units[0].clock_jumps == 1
    bench.answers()
    bench.now += 0.021
    bench.receiver.receive()
    beacons = [decode_beacon(d, unit.mac, unit.challenge) for d in bench.answers()]
    [beacon] = [b for b in beacons if b]
    # an echo of one heard before the jump: its hold would say nonsense
    assert beacon.number > unheard[0].number
    assert bench.send(unit.sample(bench.now, beacon=unheard[0].number, beacon_hold_us=0)) == 1
    assert math.isnan(bench.receiver.units[0].offset)
    unit.beacon, unit.heard_us = beacon, unit.us(bench.now)
    bench.send(unit.sample(bench.now))
    assert bench.receiver.units[0].offset == pytest.approx(unit.offset, abs=0.03)


def test_an_echo_of_a_beacon_that_is_long_past_tells_nothing(bench):
    bench.join()
    bench.run(20.0)
    session = bench.receiver._stations[0]._session
    assert sorted(session.sent) == list(range(session.number - 63, session.number + 1))
    assert bench.send(bench.units[0].sample(bench.now, beacon=1, beacon_hold_us=0)) == 1
    assert bench.receiver.units[0].clock_jumps == 0


def test_each_beacon_is_taken_as_echoed_once(bench):
    bench.join()
    clock = bench.receiver._stations[0]._clock
    [before] = clock._lows
    # were it taken again, each of these would be another bound
    for k in range(3):
        bench.now += 0.02
        assert bench.send(bench.units[0].sample(bench.now, beacon=1, beacon_hold_us=40_000 + 20_000 * k)) == 1
        assert list(clock._lows) == [before]
    assert clock.jumps == 0


def test_the_first_beacon_of_a_session_is_due_a_period_after_its_answer(bench):
    unit = bench.units[0]
    bench.send(unit.hello(bench.now))
    bench.deliver()
    sent = bench.now
    bench.now += 0.1
    bench.send(unit.sample(bench.now))
    while not bench.answers():
        bench.now += 0.001
        bench.receiver.receive()
    assert bench.now - sent == pytest.approx(0.25, abs=0.03)


def test_beacons_are_sent_during_a_flood_that_fills_a_call():
    with Bench(params=LinkParams(drain_most=2000)) as bench:
        bench.join()
        forged = replace(PLAIN, sequence=10**6).encode(Mac(bytes(32)))
        for _ in range(1500):
            bench.socket.sendto(forged, bench.receiver.address)

        def ticking() -> float:
            bench.now += 0.001
            return bench.now

        bench.receiver._clock = ticking
        bench.receiver.receive()
        assert bench.receiver.taken == 1500
        assert len([d for d in bench.answers() if decode_beacon(d, bench.units[0].mac, bench.units[0].challenge)]) >= 4


def test_the_holder_of_a_key_costs_bounded_memory_and_time(bench):
    bench.join()
    unit, station = bench.units[0], bench.receiver._stations[0]
    began, base, taken = bench.now, unit.us(bench.now), 0
    for k in range(10_000):
        bench.now += 0.001
        taken += bench.send(unit.sample(bench.now, time_us=base, beacon=1 + k % 2, beacon_hold_us=400_000 - k))
    assert taken <= 200 * (bench.now - began) + 201
    assert bench.receiver.rejected["too fast"] == 10_000 - taken
    assert len(station._clock._highs) <= 1024
    assert len(station._clock._lows) <= 1024


def test_twice_the_rate_of_a_unit_is_taken(bench):
    bench.join()
    for _ in range(500):
        bench.now += 0.01
        assert bench.send(bench.units[0].sample(bench.now)) == 1


def test_after_the_hosts_clock_stood_still_nothing_is_known_until_a_beacon_is_echoed(bench):
    bench.join()
    bench.run(1.0)
    traffic, unit = bench.receiver.units[0], bench.units[0]
    bench.receiver.forget_times()
    assert bench.receiver.readings().stamp.tolist() == [-np.inf] * 2
    assert bench.receiver.readings().status.tolist() == [RangeStatus.NONE] * 2
    assert math.isnan(traffic.offset)
    unit.offset -= 60.0  # the unit's clock went on
    assert bench.send(unit.sample(bench.now)) == 1
    assert bench.receiver.readings().stamp[0] == -np.inf
    bench.now += 0.02
    bench.receiver.receive()
    bench.deliver()
    bench.now += 0.02
    bench.send(unit.sample(bench.now))
    assert bench.now - 0.06 < bench.receiver.readings().stamp[0] <= bench.now - 0.01
    assert traffic.clock_jumps == 0


def test_what_was_offered_before_the_hosts_clock_stood_still_tells_no_time_after_it(bench):
    unit = bench.units[0]
    bench.send(unit.hello(bench.now))
    bench.deliver()
    bench.now += 0.02
    late = unit.sample(bench.now)
    unit.offset -= 60.0  # the unit's clock goes on for a minute
    bench.receiver.forget_times()
    assert bench.send(late) == 0
    assert bench.send(unit.sample(bench.now)) == 0
    assert bench.receiver.readings().stamp[0] == -np.inf
    unit.leave()
    bench.send(unit.hello(bench.now))
    bench.deliver()
    assert bench.send(unit.sample(bench.now)) == 1
    assert bench.receiver.readings().stamp[0] <= bench.now - 0.01


def test_with_somebody_to_deliver_to_nothing_is_kept():
    given = []
    with Bench(deliver=lambda received, datagram: given.append((received, bytes(datagram)))) as bench:
        bench.join()
        sample = bench.units[0].sample(bench.now)
        bench.send(sample)
        assert [received.unit for received, _ in given] == [0, 1, 0]
        assert given[-1][1] == sample
        assert bench.receiver.take_samples() == bench.receiver.take_imu() == []


def test_each_flipped_bit_of_a_hello_makes_it_worthless(unfiltered):
    hello = unfiltered.units[0].hello(unfiltered.now)
    for bit in range(8 * len(hello)):
        bad = bytearray(hello)
        bad[bit // 8] ^= 1 << bit % 8
        unfiltered.send(bytes(bad))
    assert unfiltered.answers() == []
    assert unfiltered.receiver.units[0].state == "never heard"
    unfiltered.send(hello)
    assert len(unfiltered.answers()) == 1


def test_each_flipped_bit_of_a_sample_makes_it_worthless(unfiltered):
    unfiltered.join()
    before = counters(unfiltered)
    sample = unfiltered.units[0].sample(unfiltered.now)
    for bit in range(8 * len(sample)):
        bad = bytearray(sample)
        bad[bit // 8] ^= 1 << bit % 8
        assert unfiltered.send(bytes(bad)) == 0
    assert counters(unfiltered) == before
    assert sum(unfiltered.receiver.rejected.values()) == 8 * len(sample)
    assert unfiltered.send(sample) == 1


def test_each_flipped_bit_of_a_beacon_makes_it_worthless(bench):
    bench.send(bench.units[0].hello(bench.now))
    [beacon] = bench.answers()
    for bit in range(8 * len(beacon)):
        bad = bytearray(beacon)
        bad[bit // 8] ^= 1 << bit % 8
        assert decode_beacon(bytes(bad), bench.units[0].mac, bench.units[0].challenge) is None
    assert bench.units[0].hear(beacon, bench.now)


@pytest.mark.parametrize("filtered", [False, True])
def test_every_other_length_is_refused(filtered, monkeypatch):
    if not filtered:
        monkeypatch.setattr("pretouch.hardware.receiver.attach_filter", lambda _: False)
    with Bench() as bench:
        bench.join()
        sample, hello = bench.units[0].sample(bench.now), bench.units[0].hello(bench.now)
        for whole in (sample, hello):
            for size in range(len(whole)):
                assert bench.send(whole[:size]) == 0
            for more in (1, 12, 300, 1990, 5000):
                assert bench.send(whole + bytes(more)) == 0
        assert bench.answers() == []
        assert bench.send(sample) == 1


def test_samples_without_any_imu_and_of_the_most_are_taken(bench):
    bench.join()
    for count in (0, 32):
        assert bench.send(bench.units[0].sample(bench.now, imu_count=count, imu=bytes(12 * count))) == 1
    assert len(bench.units[0].sample(bench.now, imu_count=0, imu=b"")) == SAMPLE_LEAST


def test_other_versions_kinds_and_units_are_refused_by_reason(unfiltered):
    unfiltered.join()
    sample = bytearray(unfiltered.units[0].sample(unfiltered.now))
    for place, number in ((0, 0), (2, 2), (3, 2), (3, 7)):
        bad = bytearray(sample)
        bad[place] = number
        unfiltered.send(bytes(bad))
    assert unfiltered.receiver.rejected["format"] == 4
    stranger = FakeUnit(KEYS["unit 5"])
    unfiltered.send(stranger.hello(unfiltered.now))
    assert unfiltered.receiver.rejected["unit"] == 1
    assert unfiltered.answers() == []


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


def test_a_beacon_that_finds_nobody_disturbs_nothing(bench):
    with bench.new_socket() as gone:
        bench.send(bench.units[0].hello(bench.now), by=gone)
        bench.units[0].hear(bench.answers(gone)[0], bench.now)
        bench.send(bench.units[0].sample(bench.now), by=gone)
    for _ in range(200):
        bench.now += 0.02
        assert bench.receiver.receive() == 0
    bench.join()


def test_an_address_nothing_can_be_sent_to_is_counted(bench, monkeypatch):
    bench.join()
    station = bench.receiver._stations[0]
    station.address = ("255.255.255.255", 9)  # needs a permission the socket has not
    bench.now += 1.0
    bench.receiver.receive()
    assert bench.receiver.unsent == 1


def test_a_taken_port_is_named(bench):
    port = bench.receiver.address[1]
    with pytest.raises(HardwareError, match=f"Port {port} of 127.0.0.1 is taken"):
        SkinReceiver(IDS, KEYS, port=port)


@pytest.mark.parametrize(("host", "port"), [("no.such.host.invalid", 0), ("127.0.0.1", 70000), ("192.0.2.1", 0)])
def test_an_address_that_cannot_be_had_is_an_error_of_ours(host, port):
    with pytest.raises(HardwareError, match=host):
        SkinReceiver(IDS, KEYS, host, port)


def test_units_need_a_key_and_a_name_of_their_own():
    with pytest.raises(HardwareError, match="no key for unit 9"):
        SkinReceiver(("unit 3", "unit 9"), KEYS)
    with pytest.raises(HardwareError, match="stands twice"):
        SkinReceiver(("unit 3", "unit 3"), KEYS)


def test_a_closed_receiver_says_so(bench):
    bench.receiver.close()
    bench.receiver.close()
    with pytest.raises(HardwareError, match="closed"):
        bench.receiver.receive()
    bench.receiver.readings()


def test_two_receivers_do_not_share_sessions(bench):
    bench.join()
    sample = bench.units[0].sample(bench.now)
    with Bench(drawn=1000) as other:
        other.join()
        assert other.send(sample) == 0
    assert bench.send(sample) == 1


def test_waiting_ends_with_the_first_datagram_or_in_time(bench):
    assert bench.receiver.receive(0.05) == 0
    bench.socket.sendto(bench.units[0].hello(bench.now), bench.receiver.address)
    assert bench.receiver.receive(30.0) == 0
    assert len(bench.deliver()) == 1


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


def test_a_flood_takes_no_memory(unfiltered):
    unfiltered.join()
    rng, unit = np.random.default_rng(0), unfiltered.units[0]
    wrong = Mac(bytes(32))
    hellos = [Hello(int(n), 0, 0, rng.bytes(8), 1).encode(wrong) for n in rng.integers(0, 65536, 300)]
    recorded = [Hello(3, 0, 0, rng.bytes(8), 1).encode(unit.mac) for _ in range(300)]
    samples = [replace(PLAIN, unit=int(n), sequence=9).encode(wrong) for n in rng.integers(0, 65536, 300)]
    random = [rng.bytes(int(n)) for n in rng.integers(0, 600, 300)]
    sockets = [unfiltered.new_socket() for _ in range(5)]

    def flood() -> None:
        for k in range(5):
            unfiltered.send(*hellos, *recorded, *samples, *random, by=sockets[k])
            unfiltered.now += 0.1

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
    assert unfiltered.receiver._stations[0]._link.pending <= LinkParams().pending_most


def test_a_socket_pulled_away_is_an_error_of_ours(bench):
    socket.socket(fileno=bench.receiver._socket.detach()).close()
    with pytest.raises(HardwareError, match="closed"):
        bench.receiver.receive()


def test_counters_are_plain_numbers(bench):
    bench.join()
    unit = bench.receiver.units[0]
    for name in ("accepted", "lost", "replayed", "hellos", "sessions", "reboots", "clock_jumps"):
        assert type(getattr(unit, name)) is int, name
    for name in ("last_arrival", "last_reading_stamp", "offset", "bound", "latency", "latency_worst"):
        assert type(getattr(unit, name)) is float, name
        assert math.isfinite(getattr(unit, name))


def test_latency_is_told_with_its_mean_and_its_worst(bench):
    bench.join()
    for k in range(100):
        bench.now += 0.02
        sample = bench.units[0].sample(bench.now)
        bench.now += 0.3 if k == 20 else 0.005
        bench.send(sample)
        bench.deliver()
        if k == 25:
            assert 0.3 <= bench.receiver.units[0].latency_worst < 0.31
    unit = bench.receiver.units[0]
    assert 0.005 <= unit.latency <= 0.005 + 2 * unit.bound + 1e-4
    assert unit.latency_worst < 0.02
