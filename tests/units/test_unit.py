"""A range finder that repeats itself is noticed; sequence numbers are held against a set that remembers all."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.units.session import WIDTH, RateLimiter, ReplayWindow
from pretouch.units.unit import StuckDetector
from pretouch.units.wire import Flag
from tests.units.fake_unit import PLAIN, Bench

REPORTED = ("range_mm", "range_sigma", "range_signal", "range_ambient", "range_spads")


def reading(number, **changes):
    """One whose stream goes on and whose values stay."""
    return replace(PLAIN, **{"range_stream": number % 256, **changes})


@pytest.mark.parametrize("name", REPORTED)
def test_one_value_that_changes_is_enough_not_to_be_stuck(name):
    detector = StuckDetector(1.0)
    assert not any(detector.update(reading(k, **{name: 100 + k}), 0.02 * k) for k in range(200))


@pytest.mark.parametrize("streams", [True, False])
def test_nine_readings_alike_may_be_chance(streams):
    detector = StuckDetector(1.0)
    stuck = [detector.update(reading(7 if streams else k, range_mm=k if streams else 5), 1.0 * k) for k in range(12)]
    assert stuck.index(True) == 9


def test_what_is_no_new_reading_changes_nothing():
    detector = StuckDetector(1.0)
    for k in range(60):
        detector.update(reading(k), 0.02 * k)
    assert detector.update(reading(60, range_mm=3, flags=int(Flag.RANGE_LATE)), 1.2)


def test_after_the_stream_is_forgotten_values_alike_still_are():
    detector = StuckDetector(1.0)
    for k in range(60):
        detector.update(reading(7), 0.02 * k)
    detector.forget_stream()
    assert detector.update(reading(7), 1.2)
    detector.forget_stream()
    assert not detector.update(reading(7, range_mm=1), 1.22)


@pytest.fixture
def stuck_bench():
    with Bench() as bench:
        bench.join()
        say(bench, 70)
        assert bench.receiver.units[0].stuck
        yield bench


def say(bench, count, **more):
    """Let the first unit repeat one reading; return how many of them passed for good ones."""
    good = 0
    for _ in range(count):
        bench.now += 0.02
        changes = {"range_mm": 4000, "range_stream": 7, **more}
        assert bench.send(bench.units[0].sample(bench.now, **changes)) == 1
        bench.deliver()
        good += bench.receiver.readings().status[0] == 0
    return good


@pytest.mark.parametrize("reboot", [False, True])
def test_a_stuck_unit_is_stuck_in_its_next_session_too(stuck_bench, reboot):
    unit = stuck_bench.units[0]
    if reboot:
        stuck_bench.now += 0.5
        unit.reboot(stuck_bench.now)
        stuck_bench.now += 0.5
    else:
        unit.leave()
    stuck_bench.greet(unit)
    assert say(stuck_bench, 80) == 0
    assert stuck_bench.receiver.units[0].reboots == reboot


def test_a_stream_that_begins_anew_with_a_reboot_is_not_stuck(stuck_bench):
    unit = stuck_bench.units[0]
    unit.reboot(stuck_bench.now)
    stuck_bench.now += 0.5
    stuck_bench.greet(unit)
    assert say(stuck_bench, 1, range_mm=700) == 1


def test_a_late_reading_does_not_unstick_a_unit():
    with Bench() as bench:
        bench.join()
        say(bench, 10)
        late = bench.units[0].sample(bench.now - 0.005, range_mm=400)
        say(bench, 60)
        assert bench.send(late) == 1
        assert say(bench, 5) == 0


@given(st.lists(st.one_of(st.integers(0, 300), st.integers(2**32 - 200, 2**32 - 1)), max_size=300))
def test_a_window_admits_what_is_new_and_not_too_old(sequences):
    window, seen = ReplayWindow(), set()
    for sequence in sequences:
        newest = max(seen, default=0)
        wanted = sequence >= 1 and sequence not in seen and sequence > newest - WIDTH
        assert window.admits(sequence) == wanted
        if wanted:
            window.take(sequence)
            seen.add(sequence)
        assert window.newest == max(seen, default=0)


@given(st.lists(st.integers(1, 500), max_size=300))
def test_lost_and_missing_are_what_never_came(sequences):
    window, seen, lost = ReplayWindow(), set(), 0
    for sequence in sequences:
        if window.admits(sequence):
            lost += window.take(sequence)
            seen.add(sequence)
    gone = set(range(1, window.newest + 1)) - seen
    assert lost == sum(sequence <= window.newest - WIDTH for sequence in gone)
    assert lost + window.missing() == len(gone)


@given(st.lists(st.floats(0.0, 0.5), max_size=200))
def test_an_allowance_is_so_many_a_second_and_as_many_at_once(gaps):
    allowance, left, now = RateLimiter(20.0), 20.0, 100.0
    for gap in gaps:
        now += gap
        left = min(20.0, left + 20.0 * gap)
        spent = allowance.spend(now)
        assert spent == (left >= 1.0) or abs(left - 1.0) < 1e-6
        left -= spent
