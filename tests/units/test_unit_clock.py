"""The true offset lies within the bounds, whatever the network does; after a jump they find it again."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.units.clock import TICK, UnitClock

DRIFT = 50e-6
delays = st.one_of(st.floats(0.0, 0.005), st.floats(0.0, 0.1), st.floats(0.0, 3.0))


class Wire:
    """Beacons every 0.25 s and samples every 20 ms, given to a clock in their order of arrival."""

    def __init__(self, offset, rate, down, up):
        """Unit time = (host time - offset) * rate; delays of beacons (B,) and samples (S,) [s], NaN where lost."""
        self._offset, self._rate = offset, rate
        self.sent = 0.25 * np.arange(len(down))
        self._down = self.sent + down
        made = 0.3 + 0.02 * np.arange(len(up))
        self.order = [(t, a) for a, t in sorted((a, t) for t, a in zip(made, made + up, strict=True) if a == a)]

    def unit(self, time):
        return math.floor(1e6 * (time - self._offset) * self._rate) * 1e-6

    def echo(self, made):
        """Return sending instant and hold of the newest beacon heard before."""
        update = np.flatnonzero(self._down <= made)
        if not len(update):
            return None, 0.0
        number = update[-1]
        return self.sent[number], self.unit(made) - self.unit(self._down[number])


@given(
    st.floats(-1000.0, 1000.0), st.floats(-0.99 * DRIFT, 0.99 * DRIFT),
    st.lists(st.tuples(delays, st.booleans()), min_size=1, max_size=60),
    st.lists(st.tuples(delays, st.booleans(), st.floats(0.0, 0.05)), min_size=1, max_size=200),
    st.sampled_from([0.5, 10.0]),
)  # fmt: skip
def test_the_truth_is_within_the_bounds_and_no_stamp_is_later_and_newer_readings_have_later_stamps(
    offset, drift, down, up, window
):
    ages = [age for _, _, age in up]
    down, up = (np.array([np.nan if lost else delay for delay, lost, *_ in pairs]) for pairs in (down, up))
    wire, clock = Wire(offset, 1.0 + drift, down, up), UnitClock(DRIFT, window)
    newest = -math.inf
    for made, arrival in wire.order:
        sent, hold = wire.echo(made)
        assert clock.update(wire.unit(made), arrival, sent, hold)
        newest = max(newest, made)
        true = newest - wire.unit(newest)
        assert clock.low <= true <= clock.high + 1e-9
        if clock.bounded:
            assert abs(clock.offset - true) <= clock.bound + 1e-9
            for age in (0.0, 0.02, 5.0):
                assert clock.earliest(wire.unit(made) - age) <= made - age * (1 - DRIFT) + 1e-9
        measured = made - ages[round((made - 0.3) / 0.02)]
        instant, last, before = wire.unit(measured), clock.last_reading, clock._last_stamp
        at_least = clock.earliest(instant)
        stamp = clock.stamp(instant)
        assert at_least <= stamp <= measured + 1e-9
        if instant > last:
            assert stamp > before or stamp == -math.inf
        else:
            assert (clock.last_reading, clock._last_stamp) == (last, before)
    assert clock.jumps == 0


@given(st.floats(0.1, 1e5), st.booleans(), st.integers(0, 2**32 - 1))
def test_after_a_jump_it_recovers(jump, forward, seed):
    rng = np.random.default_rng(seed)
    down, up = rng.exponential(0.002, 40), rng.exponential(0.002, 300)
    wire, clock = Wire(0.0, 1.0, down, up), UnitClock(DRIFT, 10.0)
    # the jump comes after 3 s, between a beacon heard and its echo as well as elsewhere
    shift = jump if forward else -jump
    for made, arrival in wire.order:
        sent, hold = wire.echo(made)
        jumped = made > 3.0
        heard_before = sent is not None and made - hold <= 3.0
        mixed = hold + shift if jumped and heard_before else hold
        clock.update(
            wire.unit(made) + (shift if jumped else 0.0), arrival, sent if mixed >= 0 else None, max(mixed, 0.0)
        )
    assert clock.jumps >= 1
    assert clock.bounded
    assert clock.low <= made - (wire.unit(made) + shift) + 1e-9
    assert made - (wire.unit(made) + shift) - 1e-9 <= clock.high
    assert clock.bound < 0.02


def test_nothing_is_known_before_an_echo():
    clock = UnitClock(DRIFT, 10.0)
    assert clock.update(5.0, 100.0, None, 0.0)
    assert not clock.bounded
    assert math.isnan(clock.offset)
    assert clock.earliest(5.0) == -math.inf


def test_a_round_trip_gives_its_half_as_bound():
    clock = UnitClock(DRIFT, 10.0)
    clock.update(5.0, 100.03, 99.99, 0.02)
    assert clock.offset == pytest.approx(95.02, abs=1e-5)
    assert clock.bound == pytest.approx(0.01, abs=1e-5)
    assert clock.earliest(4.9) == pytest.approx(99.91 - 1.0e-6 - TICK - DRIFT * 0.12, abs=1e-6)


def test_jumps_too_small_to_be_seen_make_no_stamp_later_than_it_can_be():
    clock = UnitClock(DRIFT, 10.0)
    for k in range(6000):
        host = 0.02 * k
        made = host + 0.015 * (k // 600)
        assert clock.update(made, host + 0.02, host - 0.02, 0.0)
        assert clock.stamp(made) <= min(made + clock.high, host + 0.02)
    assert clock.jumps == 0


def test_what_a_beacon_told_allows_for_the_resolution_of_the_units_clock():
    clock = UnitClock(DRIFT, 10.0)
    clock.update(5.0, 100.0, 100.0, 0.0)
    assert clock.low == pytest.approx(95.0 - TICK, abs=1e-9)
    assert clock.bounded


@pytest.mark.parametrize(
    ("times", "most"),
    [
        (lambda k: (5.0, 100.0 + 1e-6 * k, 90.0 - 1e-6 * k, 1e-6 * k), 1024),
        # each sample a little later than the one before: every bound is worse than the last, so that all are kept
        (lambda k: (0.02 * k, 0.02 * k + 1e-3 + 1e-5 * k, 0.02 * k - 0.01 - 1e-5 * k, 0.005), 502),
    ],
)
def test_its_memory_is_bounded_however_the_units_clock_goes(times, most):
    clock = UnitClock(DRIFT, 10.0)
    for k in range(5000):
        clock.update(*times(k))
    assert len(clock._lows) <= most
    assert len(clock._highs) <= most


def wifi(rng, count, busy):
    delay = 0.0012 + rng.gamma(2.0, 0.0006, count)
    late = rng.random(count) < busy
    delay[late] += rng.exponential(0.025, late.sum())
    return delay


@pytest.mark.parametrize(
    ("busy", "saving", "most"), [(0.02, 0.0, 0.002), (0.3, 0.0, 0.002), (0.05, 0.1, 0.02)],
    ids=["quiet", "busy access point", "modem sleep on the way down"],
)  # fmt: skip
def test_on_networks_as_they_are_the_offset_is_good_to_milliseconds(busy, saving, most):
    rng = np.random.default_rng(0)
    down = wifi(rng, 480, busy) + rng.uniform(0, saving, 480)
    wire, clock = Wire(12.345, 1 + 20e-6, down, wifi(rng, 5900, busy)), UnitClock(DRIFT, 10.0)
    errors = []
    for made, arrival in wire.order:
        sent, hold = wire.echo(made)
        assert clock.update(wire.unit(made), arrival, sent, hold)
        if made > 10.0:
            errors.append(wire.unit(made) + clock.offset - made)
            assert abs(errors[-1]) <= clock.bound + DRIFT * 0.2
    assert np.percentile(np.abs(errors), 99) < most
