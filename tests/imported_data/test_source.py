"""Samples in time: sorted, without doubles, held, and in between."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pretouch.imported_data.source import Series, in_order, interpolated, newest

TIMES = st.lists(st.integers(0, 30), min_size=1, max_size=20)


def series(times):
    return Series(np.array(times, dtype=np.int64), np.arange(len(times), dtype=np.float64)[:, None])


@given(TIMES)
def test_each_instant_keeps_the_sample_that_came_last(times):
    found, notes = in_order(series(times), "Force")
    last = {time: float(i) for i, time in enumerate(times)}
    assert found.time.tolist() == sorted(last)
    assert found.values[:, 0].tolist() == [last[time] for time in sorted(last)]
    assert bool(notes) == (times != sorted(last))


@given(TIMES, st.lists(st.integers(-5, 40), max_size=10))
def test_the_newest_sample_is_the_last_that_is_not_later(times, ticks):
    known = sorted(set(times))
    found = newest(np.array(known), np.array(ticks, dtype=np.int64))
    assert found.tolist() == [sum(time <= tick for time in known) - 1 for tick in ticks]


@given(TIMES, st.lists(st.integers(-5, 40), max_size=10), st.integers(1, 10))
def test_between_samples_that_are_near_values_are_linear_and_elsewhere_unknown(times, ticks, longest):
    known = sorted(set(times))
    values = np.sin(np.array(known, dtype=np.float64))
    found = interpolated(
        Series(np.array(known), values[:, None]), np.array(ticks, dtype=np.int64), longest_s=longest / 1e9
    )
    for tick, value in zip(ticks, found[:, 0], strict=True):
        before, after = [t for t in known if t <= tick], [t for t in known if t > tick]
        if not before or (after[0] - before[-1] if after else tick - before[-1]) > longest:
            assert np.isnan(value)
        else:
            np.testing.assert_allclose(value, np.interp(tick, known, values), atol=1e-12)
