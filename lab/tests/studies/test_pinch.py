"""A limb caught in the crook of the arm, and on the floor, in the closed loop."""

import numpy as np
import pytest

from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.studies import pinch

pytestmark = pytest.mark.slow


def played(model: RobotModel, skin: Skin, place: str, profile: str):
    cell = Cell(pinch.NAME, profile, {"place": place, "speed_m_s": 0.1, "restrictions": "off"})
    return pinch.trial(cell, 1001, Context(model, skin))


@pytest.mark.parametrize("place", pinch.PLACES)
def test_the_arm_says_what_it_caught_opens_and_holds(panda_model: RobotModel, paper_skin: Skin, place: str) -> None:
    row, record = played(panda_model, paper_skin, place, "pretouch")
    assert row["caught"]
    assert row["recognised"]
    assert row["latched"]
    assert row["contacts"] == 1
    assert row["squeezed_s"] < 1.0
    end = record.true_force[record.true_time > record.true_time[-1] - 1.0]
    assert np.linalg.norm(end, axis=1).max() < 1.0  # nothing is squeezed any more


def test_without_the_switch_it_is_a_push(panda_model: RobotModel, paper_skin: Skin) -> None:
    row, _ = played(panda_model, paper_skin, "crook", "pretouch:react.pinch=none")
    assert row["caught"]
    assert not row["recognised"]


def test_cells_and_tables() -> None:
    cells = pinch.cells(Grid(("paper", "pretouch")))
    assert len(cells) == 8
    rows = [
        {**cell.where, "profile": cell.profile, "seed": seed, "caught": True, "recognised": cell.profile == "pretouch",
         "links": False, "latched": False, "peak_20ms_n": 50.0 + seed, "squeezed_s": 0.2, "contacts": 1}
        for cell in cells for seed in range(3)
    ]  # fmt: skip
    (table,) = pinch.tables(pinch.summarise(rows))
    assert len(table.rows) == 8
    assert table.rows[0][:4] == ("crook", "0.1", "paper", "3/3")
