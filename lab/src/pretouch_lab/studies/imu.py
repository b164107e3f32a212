"""What the units' accelerometers add: delay, contacts missed, false alarms and the touched link, with and without."""

from pretouch.contact.sequential_test import SequentialTest
from pretouch.profiles import profile
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row
from pretouch_lab.studies.impacts.judged import judged
from pretouch_lab.studies.impacts.tables import summarise, tables

NAME = "imu"
WAYS = {
    "usual": (0.02, 0.3),
    "calm": (0.02, 0.1),
    "shaken": (0.02, 0.5),
    "at once": (0.0025, 0.3),
}
"""Time between a unit's datagrams [s] and vibration of its accelerometer [m/s^2]; the first as units send them."""
FREE_S = 120.0
"""Free motion that is listened to for false alarms [s], warm-up included."""


def cells(grid: Grid) -> list[Cell]:
    """A cell for each way of the samples, of each profile with the sequential test, or of `pretouch`."""
    tested = [name for name in grid.profiles if isinstance(profile(name).detect, SequentialTest)]
    return [Cell(NAME, name, {"way": way}) for name in tested or ["pretouch"] for way in WAYS]


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, None]:
    """Run one trial; return its row of results. Its course is of no use to a figure."""
    row = cell.row(seed)
    return row | judged(context.profile(cell), seed, WAYS[str(cell.where["way"])], FREE_S), None


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: 2 * FREE_S, summarise, tables, recorded=False)
