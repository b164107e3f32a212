from functools import cache

import numpy as np
import pytest
from lab.tests.sweep import made
from lab.tests.sweep.made import A, B

from pretouch_lab.sweep.analysis import indices, sobol_indices, sweep_figure, tables
from pretouch_lab.sweep.design import points, sweep_of

PI4 = np.pi**4
V1 = 0.5 * (1 + B * PI4 / 5) ** 2
V2 = A**2 / 8
V13 = B**2 * PI4**2 * (1 / 18 - 1 / 50)
V = V1 + V2 + V13
FIRST, TOTAL = (V1 / V, V2 / V, 0.0), ((V1 + V13) / V, V2 / V, V13 / V)
"""Known in closed form (Ishigami and Homma 1990, Sobol and Levitan 1999)."""


@cache
def values(samples):
    return np.array([made.value(*point.values.values()) for point in points(made.ishigami(samples))])


@pytest.mark.slow
def test_the_indices_of_a_function_in_closed_form():
    found = sobol_indices(made.ishigami(1024), values(1024))
    rows = found["rows"]
    np.testing.assert_allclose([row["first"] for row in rows], FIRST, atol=0.03)
    np.testing.assert_allclose([row["total"] for row in rows], TOTAL, atol=0.03)
    for row, first, total in zip(rows, FIRST, TOTAL, strict=True):
        assert abs(row["first"] - first) < 2 * row["first_95"]
        assert abs(row["total"] - total) < 2 * row["total_95"]
        assert 0.0 < row["total_95"] < 0.12


@pytest.mark.slow
def test_intervals_shrink_with_more_samples():
    few, many = (sobol_indices(made.ishigami(n), values(n))["rows"] for n in (64, 1024))
    assert all(a["total_95"] > 2 * b["total_95"] for a, b in zip(few, many, strict=True))


def test_a_block_with_a_missing_value_is_left_out_whole_and_told():
    some = values(512).copy()
    some[[3, 4, 100]] = np.nan
    found = sobol_indices(made.ishigami(512), some)
    assert (found["points"], found["of"]) == (510, 512)
    for row, total in zip(found["rows"], TOTAL, strict=True):
        assert abs(row["total"] - total) < 2 * row["total_95"]


@pytest.mark.parametrize("value", [np.nan, 3.0])
def test_what_does_not_vary_or_is_nowhere_has_no_indices(value):
    sweep = made.ishigami(8)
    assert sobol_indices(sweep, np.full(len(points(sweep)), value))["rows"] == []


def test_the_course_over_a_grid():
    sweep = sweep_of("ishigami", {"scene.x2": made.PI}, {}, design="grid", arms=3)
    rows = indices(sweep, points(sweep), made.played(sweep)[1])["value"]["rows"]
    levels = np.linspace(-np.pi, np.pi, 5)
    assert [row["level"] for row in rows] == pytest.approx(levels)
    assert [row["median"] for row in rows] == pytest.approx([made.value(0.0, x, 0.0) for x in levels], abs=1e-4)
    assert {row["n"] for row in rows} == {3}


def test_a_grid_has_a_table_for_each_parameter_and_a_figure():
    sweep = made.ishigami(design="grid", arms=2)
    found = indices(sweep, points(sweep), made.played(sweep)[1])
    shown = tables(sweep, found, ("value",))
    assert [(table.header[0], len(table.rows)) for table in shown] == [(f"scene.x{i}", 5) for i in (1, 2, 3)]
    assert len(sweep_figure(sweep, found, ("value",)).axes) == 3
