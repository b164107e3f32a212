import pytest
from lab.tests.sweep.made import X, ishigami

from pretouch.errors import ExperimentError
from pretouch_lab.sweep.design import points, sweep_of


def test_a_grid_plays_each_combination_with_the_same_arms():
    sweep = sweep_of("static", {"detect.f_base_n": "7:20:3", "scene.side": "-y,+y"}, {}, design="grid", arms=4)
    found = points(sweep)
    assert len(found) == 3 * 2 * 4
    arms = {}
    for point in found:
        arms.setdefault(tuple(point.values.values()), []).append(point.seed)
    assert list(arms.values()) == [[1000, 1001, 1002, 1003]] * 6


def test_blocks_for_sobol_indices_differ_in_one_column_at_a_time():
    sweep = ishigami(4, arms=8)
    found, wide = points(sweep), len(sweep.columns)
    assert len(found) == 4 * (wide + 2)
    for block in range(4):
        first, *each, last = [[*p.values.values(), p.seed] for p in found[block * (wide + 2) :][: wide + 2]]
        for column, row in enumerate(each):
            assert row == [*first[:column], last[column], *first[column + 1 :]]


def test_the_same_sweep_has_the_same_cells_and_more_samples_begin_with_them():
    few, many = ishigami(4), ishigami(8)
    assert points(few) == points(ishigami(4))
    assert points(many)[: len(points(few))] == points(few)


def test_seeds_for_development_are_none_of_the_published_ones():
    sweep = ishigami(4, arms=8)
    assert min(point.seed for point in points(sweep)) >= 1000
    published = sweep_of("ishigami", X, {}, samples=4, arms=8, seeds="published")
    assert max(point.seed for point in points(published)) <= 999


def test_values_that_go_not_together_are_found_before_anything_is_played():
    sweep = sweep_of("static", {"detect.f_base_n": "6:20", "detect.f_d_n": "0:9"}, {}, samples=16)
    with pytest.raises(ExperimentError, match=r"go not together, detect.f_base_n = .*greater than f_d_n.*Narrow"):
        points(sweep)


def test_a_sweep_that_would_never_end_is_refused():
    sweep = sweep_of("ishigami", {f"scene.x{i}": "0:1:99" for i in (1, 2, 3)}, {}, design="grid")
    with pytest.raises(ExperimentError, match="15524784 cells, more than"):
        points(sweep)
