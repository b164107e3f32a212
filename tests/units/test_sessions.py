"""Nothing old ever counts again, and nobody without a key can do more than be in the way."""

from dataclasses import replace

import pytest

from pretouch.units.wire import Hello, Mac, Reset, decode_beacon
from tests.units.fake_unit import KEYS, PLAIN, Bench, FakeUnit


def accepted(bench):
    return bench.receiver.units[0].accepted


def recorded_hellos(count):
    """What was recorded of the unit before this receiver began: genuine, of challenges it no longer uses."""
    unit = FakeUnit(KEYS["unit 3"])
    return [Hello(3, 0x0100, Reset.POWER_ON, b"old %04d" % k, 10**6 + k).encode(unit.mac) for k in range(count)]


def test_a_sample_counts_once(bench):
    bench.join()
    sample = bench.units[0].sample(bench.now)
    assert [bench.send(sample) for _ in range(3)] == [1, 0, 0]
    assert bench.receiver.rejected["replayed"] == bench.receiver.units[0].replayed == 2


@pytest.mark.parametrize("reboot", [False, True])
def test_samples_of_an_earlier_session_or_from_before_a_reboot_never_count_again(bench, reboot):
    bench.join()
    old = [bench.units[0].sample(bench.now) for _ in range(100)]
    bench.send(*old[:50])
    bench.now += 3.0
    if reboot:
        bench.units[0].reboot(bench.now)
    else:
        bench.units[0].leave()
    bench.greet(bench.units[0])
    # while the new session is offered, and once it is live
    assert bench.send(old[60]) == 1  # still the live one's: it was never used
    assert bench.send(bench.units[0].sample(bench.now)) == 1
    assert bench.send(*old) == 0
    assert bench.send(bench.units[0].sample(bench.now)) == 1


def test_samples_for_an_earlier_receiver_never_count_for_another(bench):
    bench.join()
    old = [bench.units[0].sample(bench.now) for _ in range(100)]
    with Bench(drawn=1000) as after:
        assert after.send(*old) == 0
        assert after.receiver.rejected["no session"] == 100
        # the recorded hello of that session brings a beacon, but another nonce
        after.send(bench.units[0].hello(after.now), *old)
        assert accepted(after) == 0


def test_a_sample_held_back_under_an_older_offer_never_takes_over(bench):
    unit = bench.units[0]
    bench.greet(unit)
    hello, held_back = unit.hello(bench.now), [unit.sample(bench.now) for _ in range(3)]
    bench.now += 2.1
    unit.leave()
    bench.greet(unit)
    assert bench.send(unit.sample(bench.now)) == 1
    for k in range(100):
        if k % 20 == 0:
            bench.send(hello)
        bench.now += 0.1
        assert bench.send(unit.sample(bench.now)) == 1
        bench.deliver()
    assert bench.send(*held_back) == 0
    assert bench.receiver.units[0].sessions == 1
    assert bench.send(unit.sample(bench.now)) == 1


def test_a_newer_offer_outlives_an_older_one_that_is_taken_late(bench):
    unit = bench.units[0]
    bench.greet(unit)
    late = unit.sample(bench.now)
    unit.leave()
    bench.greet(unit)
    assert [bench.send(late), bench.send(unit.sample(bench.now))] == [1, 1]
    assert bench.receiver.units[0].sessions == 2


def test_a_recorded_hello_never_ends_a_live_session(bench):
    hello = bench.units[0].hello(bench.now)
    bench.join()
    assert bench.send(hello) == 0
    assert bench.receiver.rejected["old hello"] == 1
    for old in recorded_hellos(50):
        bench.now += 0.1
        bench.send(old)
        assert bench.send(bench.units[0].sample(bench.now)) == 1
        bench.deliver()
    assert bench.receiver.units[0].sessions == 1
    assert bench.receiver.units[0].reset == Reset.POWER_ON
    assert bench.receiver.units[0].firmware == 0x0102


def test_a_unit_joins_once_recorded_hellos_are_no_longer_sent(bench):
    unit, old = bench.units[0], recorded_hellos(50)
    for _ in range(20):
        bench.send(*old)
        bench.now += 0.1
    bench.answers()
    bench.now += 1.0
    bench.greet(unit)
    assert bench.send(unit.sample(bench.now)) == 1


def test_answers_to_hellos_are_limited(bench):
    old = recorded_hellos(500)
    for _ in range(100):
        bench.now += 0.1
        bench.send(*old)
    assert len(bench.answers()) <= 20 * 11
    assert bench.receiver.rejected["too many hellos"] > 49_000


def test_a_unit_that_asks_again_gets_the_same_session_and_a_greater_number(bench):
    unit = bench.units[0]
    bench.send(unit.hello(bench.now))
    [first] = bench.answers()
    bench.now += 0.1
    bench.send(unit.hello(bench.now))
    [second] = bench.answers()
    told = [decode_beacon(d, unit.mac, unit.challenge) for d in (first, second)]
    assert told[0].nonce == told[1].nonce
    assert [beacon.number for beacon in told] == [1, 2]


def test_a_session_is_offered_for_five_seconds(bench):
    unit = bench.units[0]
    bench.greet(unit)
    bench.wait(5.1)
    assert bench.send(unit.sample(bench.now)) == 0
    unit.leave()
    bench.greet(unit)
    bench.wait(4.0)
    assert bench.send(unit.sample(bench.now)) == 1


def test_sequences_go_to_the_end_of_their_field_and_no_further_and_zero_never_counts(bench):
    bench.join()
    unit, last = bench.units[0], 2**32 - 1
    unit.sequence = last - 2
    assert [bench.send(unit.sample(bench.now)) for _ in range(2)] == [1, 1]
    unit.sequence = -1
    assert bench.send(unit.sample(bench.now), unit.sample(bench.now), unit.sample(bench.now)) == 0
    assert bench.receiver.units[0].replayed == 3
    unit.leave()
    bench.greet(unit)
    unit.sequence = -1
    assert [bench.send(unit.sample(bench.now)) for _ in range(2)] == [0, 1]


def test_after_the_receiver_was_away_units_come_back(bench):
    bench.join()
    bench.now += 10.0
    for unit in bench.units:
        unit.leave()
    with Bench(start=bench.now, drawn=500) as after:
        after.units = bench.units
        after.join()
        assert after.run(0.2) == 20


def test_a_unit_joins_through_a_flood_of_samples_forged_in_its_name(bench):
    unit = bench.units[0]
    forged = replace(PLAIN, sequence=1).encode(Mac(bytes(32)))
    bench.greet(unit)
    began = bench.now
    while not accepted(bench):
        bench.now += 0.02
        bench.send(*[forged] * 20, unit.sample(bench.now), *[forged] * 30)  # 2500 a second
        assert bench.now - began < 3.0
