"""What a run is made of: cells, grids, and all of the paper."""

import re
from itertools import product

import pytest

from pretouch_lab.campaign import Request
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.paper.whole import whole_paper
from pretouch_lab.registry import EXPERIMENTS

SENSING = [("paper", "slack"), ("pretouch", "braking")]
CELLS = {
    "avoidance": ([("blind", "off"), *SENSING], ["beside", "inside"]),
    "coverage": (list(product(("paper", "pretouch"), ("own", "suggested", "random"))), ["moving", "standing"]),
    "two-arms": (SENSING, ["blind", "seen", "told"]),
}
"""Of some experiments: profiles with restriction modes, or with skins, and what is varied for each of them."""


@pytest.mark.parametrize("name", CELLS)
def test_cells_are_all_values_for_each_controller_that_the_experiment_is_about(name):
    cells = EXPERIMENTS[name].cells(Grid(("blind", "paper", "pretouch")))
    expected = [(profile, value, mode) for (profile, mode), value in product(*CELLS[name])]
    assert sorted((cell.profile, *cell.where.values()) for cell in cells) == sorted(expected)


def test_files_of_different_cells_differ():
    modes = ("off", "hard", "slack", "floor")
    names = ("blind", "paper", "paper:approach.beta=-10", "paper:approach.beta=10", "paper:window.alpha=0.3")
    grid = Grid(names[:3] + names[4:], modes, (2e3, 25e3))
    cells = [cell for experiment in EXPERIMENTS.values() for cell in experiment.cells(grid)]
    assert len({cell.name for cell in cells}) == len(cells)
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+", cell.name) for cell in cells)
    assert Cell("static", names[2]).name != Cell("static", names[3]).name
    odd = ("paper:approach.slack_weight=1e-3", "paper:approach.slack_weight=1e+3")
    assert Cell("static", odd[0]).name != Cell("static", odd[1]).name


def test_a_grid_gives_each_profile_its_modes():
    grid = Grid(("blind", "paper", "paper:approach.rows=floor"), ("slack", "hard"))
    assert grid.controllers("off") == [
        ("blind", "off"), ("paper", "slack"), ("paper", "hard"), ("paper:approach.rows=floor", "floor"),
    ]  # fmt: skip
    assert Grid(("paper",)).controllers("slack") == [("paper", "slack")]


def test_the_whole_paper_runs_every_experiment_and_no_trial_twice():
    runs = whole_paper(Request(tuple(EXPERIMENTS), seeds=2))
    cells = [(cell.name, seed) for _, request in runs for cell, seed in request.trials()]
    assert len(cells) == len(set(cells))
    assert {cell.experiment for _, request in runs for cell, _ in request.trials()} == set(EXPERIMENTS)
    assert len({name for name, _ in runs}) == len(runs)


def test_the_whole_paper_with_less_is_less():
    asked = Request(tuple(EXPERIMENTS), 1, profiles=("paper",), restrictions=("slack",), stiffness=(2e3,))
    cells = [c for _, request in whole_paper(asked) for c, _ in request.trials() if c.experiment == "static"]
    found = [(c.profile, c.where["restrictions"], c.where["stiffness_n_per_m"]) for c in cells]
    assert found == [("paper", "slack", 2e3)] * 4
