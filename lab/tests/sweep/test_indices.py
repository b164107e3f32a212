from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from lab.tests.sweep import made
from lab.tests.sweep.made import A, B

from pretouch_lab.sweep.design import points
from pretouch_lab.sweep.indices import indices, sobol_indices
from pretouch_lab.sweep.run import Run
from pretouch_lab.sweep.store import Result
from pretouch_lab.sweep.work import Cell

PI4 = np.pi**4
V1 = 0.5 * (1 + B * PI4 / 5) ** 2
V2 = A**2 / 8
V13 = B**2 * PI4**2 * (1 / 18 - 1 / 50)
V = V1 + V2 + V13
FIRST, TOTAL = (V1 / V, V2 / V, 0.0), ((V1 + V13) / V, V2 / V, V13 / V)
"""Known in closed form (Ishigami and Homma 1990, Sobol and Levitan 1999)."""


@cache
def evaluated(samples):
    return tuple(made.value(*point.values.values()) for point in points(made.ishigami(samples)))


def values_of(sweep):
    return np.array(evaluated(sweep.samples))


def played(sweep, tmp_path):
    """A run whose cells were all played."""
    chosen = points(sweep)
    cells = [Cell(str(i), point.values, point.seed, 0.0) for i, point in enumerate(chosen)]
    run = Run(sweep, tmp_path, chosen, cells)
    for cell in cells:
        run.results[cell.key] = Result({"value": made.value(*cell.values.values())}, "", 0.01)
    return run


@pytest.mark.slow
def test_the_indices_of_a_function_in_closed_form():
    found = sobol_indices(made.ishigami(1024), values_of(made.ishigami(1024)))
    rows = found["rows"]
    np.testing.assert_allclose([row["first"] for row in rows], FIRST, atol=0.03)
    np.testing.assert_allclose([row["total"] for row in rows], TOTAL, atol=0.03)
    for row, first, total in zip(rows, FIRST, TOTAL, strict=True):
        assert abs(row["first"] - first) < 2 * row["first_95"]
        assert abs(row["total"] - total) < 2 * row["total_95"]
        assert 0.0 < row["total_95"] < 0.12


@pytest.mark.slow
def test_intervals_shrink_with_more_samples():
    few, many = (sobol_indices(made.ishigami(n), values_of(made.ishigami(n)))["rows"] for n in (64, 1024))
    assert all(a["total_95"] > 2 * b["total_95"] for a, b in zip(few, many, strict=True))


def test_a_block_with_a_missing_value_is_left_out_whole_and_told():
    sweep = made.ishigami(512)
    values = values_of(sweep)
    values[[3, 4, 100]] = np.nan
    found = sobol_indices(sweep, values)
    assert (found["blocks"], found["of"]) == (510, 512)
    for row, total in zip(found["rows"], TOTAL, strict=True):
        assert abs(row["total"] - total) < 2 * row["total_95"]


@pytest.mark.parametrize("value", [np.nan, 3.0])
def test_what_does_not_vary_or_is_nowhere_has_no_indices(value):
    sweep = made.ishigami(8)
    assert sobol_indices(sweep, np.full(len(points(sweep)), value))["rows"] == []


def test_rank_correlations_of_a_hypercube(tmp_path):
    sweep = made.ishigami(512, design="lhs")
    rows = indices(played(sweep, tmp_path))["value"]["rows"]
    assert rows[0]["low"] > 0.3  # f grows with x1 from -pi/2 to pi/2, and with x3^4 times it
    for row in rows[1:]:
        assert row["low"] < 0.0 < row["high"]


def test_the_course_over_a_grid(tmp_path):
    sweep = replace(made.ishigami(design="grid"), vary=made.ishigami().vary[1:2], fixed={}, arms=3)
    run = Run(sweep, tmp_path, points(sweep), [])
    run.cells = [Cell(str(i), p.values, p.seed, 0.0) for i, p in enumerate(run.points)]
    for cell in run.cells:
        run.results[cell.key] = Result({"value": cell.values["scene.x2"] + cell.seed - 1001}, "", 0.01)
    rows = indices(run)["value"]["rows"]
    assert [row["level"] for row in rows] == pytest.approx(np.linspace(-np.pi, np.pi, 5))
    assert [row["median"] for row in rows] == pytest.approx([row["level"] for row in rows], abs=1e-4)
    assert {row["n"] for row in rows} == {3}


def test_indices_of_ranks_are_those_of_any_rising_function_of_the_numbers():
    """One number that is a thousand times the others would else be all of the variance."""
    sweep, rng = made.ishigami(64), np.random.default_rng(1007)
    values = rng.uniform(1.0, 2.0, len(points(sweep)))
    ranked, bent = sobol_indices(sweep, values, True), sobol_indices(sweep, np.exp(values**5), True)
    assert ranked["rows"] == bent["rows"]
    assert sobol_indices(sweep, values)["rows"] != sobol_indices(sweep, np.exp(values**5))["rows"]
