import numpy as np
import pytest

from pretouch.traces import mean_over
from pretouch_lab.table import (
    Column,
    dispersion_of,
    grouped,
    peak,
    rate_bounds,
    ratios,
    share_above,
    short,
    spread,
    summary,
    table,
)

ROWS = [
    {"name": "a", "seed": 0, "force": 2.0, "hit": True, "text": "x"},
    {"name": "b", "seed": 0, "force": 4.0, "hit": False, "text": "x"},
    {"name": "a", "seed": 1, "force": None, "hit": False, "text": "x"},
    {"name": "b", "seed": 1, "force": 1.0, "hit": True, "text": "x"},
]


def test_peak_and_spread_by_numbers_of_nothing_and_of_what_did_not_end():
    for values, count, means in (([1.0, 2.0, 6.0, 4.0], 2, [1.5, 4.0, 5.0]), ([1.0, 3.0], 20, [2.0]), ([], 20, [])):
        np.testing.assert_allclose(mean_over(np.array(values), count), means)
    assert (peak(np.zeros(0)), peak(np.array([1.0, 7.0, 2.0]))) == (0.0, 7.0)
    assert spread(float(v) for v in range(11)) == {"median": 5.0, "p10": 1.0, "p90": 9.0, "n": 11}
    assert spread([None]) is None
    assert spread([1.0, 2.0, np.inf]) == {"median": 2.0, "p10": 1.0, "p90": None, "n": 3}
    assert spread([np.inf, None]) == {"median": None, "p10": None, "p90": None, "n": 1}


def test_groups_have_what_their_rows_share_and_what_they_sum_up_to():
    groups = [(key["name"], [row["seed"] for row in group]) for key, group in grouped(ROWS, ["name"])]
    assert groups == [("a", [0, 1]), ("b", [0, 1])]
    first, second = summary(ROWS, ["name", "text"], ["force"], ["hit"])
    force = {"median": 2.0, "p10": 2.0, "p90": 2.0, "n": 1}
    assert first == {"name": "a", "text": "x", "trials": 2, "hit": 1, "force": force}
    assert second["force"]["median"] == 2.5
    assert summary([], ["name"], ["force"]) == []


def test_ratios_are_to_the_twin_with_the_same_seed():
    parts = [row["force_ratio"] for row in ratios(ROWS, {"name": "a"}, ["seed"], ["force"])]
    assert parts == [1.0, 2.0, None, None]
    times = [row["force_ratio"] for row in ratios(ROWS, {"name": "b"}, ["seed"], ["force"], inverse=True)]
    assert times == [2.0, 1.0, None, 1.0]
    assert [row["force_ratio"] for row in ratios(ROWS[:1], {"name": "b"}, ["seed"], ["force"])] == [None]


def test_bounds_by_published_numbers():
    assert share_above(59, 59) == pytest.approx(0.05 ** (1 / 59))
    # of 60 trials with a chance of 0.95 each, 95 % have less than 60
    assert [share_above(n, 60) > 0.95 for n in (59, 60)] == [False, True]
    assert rate_bounds(0, 3.0) == (0.0, pytest.approx(3.689 / 3.0, abs=1e-3))
    assert rate_bounds(10, 1.0) == (pytest.approx(4.795, abs=1e-3), pytest.approx(18.39, abs=1e-2))
    assert rate_bounds(10, 2.0, 2.0) == pytest.approx(rate_bounds(5, 1.0))
    assert (dispersion_of([]), dispersion_of([2, 2, 2]), dispersion_of([0, 6])) == (1.0, 1.0, 6.0)


def test_columns_write_what_they_declare():
    def of(median, p10, p90):
        return {"median": median, "p10": p10, "p90": p90, "n": 1 if median is None else 3}

    row = {"name": "a", "text": "below", "n": 3, "trials": 4, "part": -0.0004, "none": None, "s": of(0.05, 0.04, 0.061)}
    row |= {"large": of(80.0, 70.0, 90.0), "open": of(2.0, 1.0, None), "one": of(None, None, None)}
    columns = {
        "a\nbelow": Column("", "name", second="text"),
        "3/4": Column("", "n", of="trials"),
        "-0.4": Column("", "part", 1, 1e3),
        "0.00": Column("", "part", 2),
        "-": Column("", "none", 1),
        "50": Column("", "s", 0, 1e3),
        "50\n40-61": Column("", "s", 0, 1e3, band=True),
        "80.0\n70-90": Column("", "large", 1, band=True),
        "2.0\n1.0->": Column("", "open", 1, band=True),
        ">": Column("", "one", 1, band=True),
    }
    assert table("Title", [*columns.values()], [row], "Note.").rows == (tuple(columns),)
    assert [short(value) for value in (0.123, 9.96, 123.4)] == ["0.12", "10", "123"]
