"""Window of sequence numbers, against a set that remembers everything."""

from hypothesis import given
from hypothesis import strategies as st

from pretouch.units.link import WIDTH, RateLimiter, ReplayWindow


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
