"""What touch sensors of units add to the detection of contacts: the same recorded arms with them and without."""

from itertools import product

from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row
from pretouch_lab.studies.tactile_kinds import BESIDE, COUNT, FREE_S, INNER, NAME, NOWHERE, ON_PATCH, PROFILE, WARM_UP_S
from pretouch_lab.studies.tactile_tables import summarise, tables


def cells(_grid: Grid) -> list[Cell]:
    """Contacts on patches and beside them, by a hand that units see or do not; and free motion with false touches.

    The profile is the experiment's own, for what is compared are its two ways to detect contacts of the same arm.
    """
    wanted = [(place, sight) for place, sight in product((ON_PATCH, BESIDE, INNER), ("seen", "unseen"))]
    return [Cell(NAME, PROFILE, {"place": place, "hand": sight}) for place, sight in (*wanted, (NOWHERE, "none"))]


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, None]:
    """Run one trial; return its row of results. Its course is of no use to a figure."""
    from pretouch_lab.studies.tactile_trial import played  # stands on the benchmark, and that on all experiments

    return played(cell, seed, context)


def _cost(cell: Cell) -> float:
    return WARM_UP_S + (FREE_S if cell.where["place"] == NOWHERE else 3.1 * COUNT)


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables, recorded=False)
