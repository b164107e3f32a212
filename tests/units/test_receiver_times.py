"""The receiver and time: beacons, clocks that jump or stand, reboots, losses."""

import math
from dataclasses import replace

import pytest

from pretouch.units.wire import Mac, decode_beacon
from tests.units.fake_unit import PLAIN, Bench


def test_beacons_come_four_times_a_second_with_growing_numbers(bench):
    bench.join()
    numbers = []
    for _ in range(100):
        bench.now += 0.02
        bench.send(*[unit.sample(bench.now) for unit in bench.units])
        numbers += [unit.beacon.number for unit in bench.units for d in bench.answers() if unit.hear(d, bench.now)]
    assert numbers[0::1] == sorted(numbers)
    assert 7 <= bench.units[0].beacon.number - 1 <= 8


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
        bench.greet(unit)
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
    bench.wait(0.021)
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
    session = bench.receiver._endpoints[0]._session
    assert sorted(session.sent) == list(range(session.number - 63, session.number + 1))
    assert bench.send(bench.units[0].sample(bench.now, beacon=1, beacon_hold_us=0)) == 1
    assert bench.receiver.units[0].clock_jumps == 0


def test_each_beacon_is_taken_as_echoed_once(bench):
    bench.join()
    clock = bench.receiver._endpoints[0]._clock
    [before] = clock._lows
    # were it taken again, each of these would be another bound
    for k in range(3):
        bench.now += 0.02
        assert bench.send(bench.units[0].sample(bench.now, beacon=1, beacon_hold_us=40_000 + 20_000 * k)) == 1
        assert list(clock._lows) == [before]
    assert clock.jumps == 0


def test_the_first_beacon_of_a_session_is_due_a_period_after_its_answer(bench):
    unit = bench.units[0]
    bench.greet(unit)
    sent = bench.now
    bench.now += 0.1
    bench.send(unit.sample(bench.now))
    while not bench.answers():
        bench.wait(0.001)
    assert bench.now - sent == pytest.approx(0.25, abs=0.03)


def test_beacons_are_sent_during_a_flood_that_fills_a_call(monkeypatch):
    monkeypatch.setattr("pretouch.units.receiver.DRAIN_MOST", 2000)
    with Bench() as bench:
        bench.join()
        forged = replace(PLAIN, sequence=10**6).encode(Mac(bytes(32)))
        for _ in range(1500):
            bench.socket.sendto(forged, bench.receiver.address)

        def ticking() -> float:
            bench.now += 0.001
            return bench.now

        bench.receiver._clock = ticking
        bench.receiver.receive()
        assert bench.receiver.received == 1500
        assert len([d for d in bench.answers() if decode_beacon(d, bench.units[0].mac, bench.units[0].challenge)]) >= 4
