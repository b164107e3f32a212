"""The study of pushes against a board: its cells, numbers and table."""

from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.types import Mode
from pretouch_lab.cell import Grid
from pretouch_lab.studies import clamp

WHERE = {"held_s": 3.0, "stiffness_n_per_m": 25_000.0, "restrictions": "off"}


def record(mode: Mode, reason: str):
    return SimpleNamespace(steps=[SimpleNamespace(mode=mode, reason=reason)])


def test_each_length_of_push_meets_each_controller():
    cells = clamp.cells(Grid(("paper", "pretouch"), (), (2_000.0, 25_000.0)))
    assert len(cells) == 8
    modes = {(c.profile, c.where["restrictions"]) for c in cells}
    assert modes == {("paper", "off"), ("pretouch", "braking")}, "pretouch keeps its own"


def test_numbers_of_a_trial_by_hand():
    force = np.zeros(5000)
    force[1000:1100] = 40.0
    force[1050] = 90.0
    row = clamp.results(force, record(Mode.HOLD, "free it, then resume."))
    assert row["board_peak_20ms_n"] == pytest.approx(40.0 + 50.0 / 20)
    assert row["board_mean_n"] == pytest.approx(40.5)
    assert (row["board_s"], row["leaning"], row["latched"]) == (0.1, False, True)
    force[-800:] = 30.0
    assert clamp.results(force, record(Mode.TRACK, "Moving as asked."))["leaning"]


def test_an_arm_that_never_came_to_the_board_is_in_the_table():
    rows = [
        {"experiment": "clamp", **WHERE, "profile": "paper", "seed": seed}
        | clamp.results(np.zeros(5000), record(Mode.TRACK, ""))
        for seed in range(2)
    ]
    (table,) = clamp.tables(clamp.summarise(rows))
    assert table.rows[0][:4] == ("3", "25", "paper", "0/2")
    assert len(table.rows[0]) == len(table.header)
