from itertools import pairwise

import numpy as np
import pytest

from pretouch.reporting.figures.marks import envelope, stretches


def test_a_short_course_stays_as_it_is():
    time, values = np.arange(10.0), np.arange(10.0)
    assert envelope(time, values, 5)[1] is values


def test_every_peak_of_a_long_course_is_kept():
    values = np.sin(np.arange(10_000) / 3.0)
    values[1234], values[8765] = 50.0, -60.0
    time, thin = envelope(np.arange(10_000.0), values, 100)
    assert len(thin) == 200
    assert np.all(np.diff(time) >= 0)
    assert (thin.max(), thin.min()) == (50.0, -60.0)
    assert time[thin == 50.0] == [1234.0]


@pytest.mark.parametrize("length", [201, 999, 1000, 1001])
def test_each_stretch_keeps_its_least_and_greatest(length):
    values = np.random.default_rng(length).standard_normal(length)
    edges = np.linspace(0, length, 101).astype(int)
    expected = [v for a, b in pairwise(edges) for v in (min(values[a:b]), max(values[a:b]))]
    assert sorted(envelope(np.arange(float(length)), values, 100)[1]) == sorted(expected)


def test_a_gap_stays_a_gap():
    values = np.ones(1000)
    values[400:500] = np.nan
    time, thin = envelope(np.arange(1000.0), values, 50)
    assert np.all(np.isnan(thin[(time >= 400) & (time < 500)]))
    assert np.all(thin[(time < 400) | (time >= 500)] == 1.0)


def test_stretches_too_close_to_tell_on_paper_are_one():
    time = np.arange(1000.0)
    flags = (time >= 100) & (time < 200) | (time >= 201) & (time < 300) | (time >= 600)
    assert stretches(time, flags, 100) == [(100.0, 300.0), (600.0, 999.0)]
    assert stretches(np.zeros(0), np.zeros(0, bool)) == []
