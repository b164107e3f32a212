"""What every experiment is made of."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.recording.run_record import RunRecord
from pretouch.text_table import TextTable
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.rows import Row
from pretouch_lab.trial import Record

if TYPE_CHECKING:  # workers that only play trials need none of it
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A figure, the stem of its file's name, and what it shows."""

    name: str
    text: str
    figure: "Figure"


def draw(pictures: Iterable[Picture], folder: Path) -> None:
    """Write figures into a folder. Raises OSError."""
    for picture in pictures:
        picture.figure.savefig(folder / f"{picture.name}.png", dpi=120)


@dataclass(frozen=True)
class Sources:
    """What figures are drawn from."""

    summary: Row
    """The experiment's own."""
    trace: Callable[[Cell], RunRecord | None]
    """The course of a cell's trial with the first seed, if it was recorded."""
    units: tuple[str, ...]
    """Names of the skin's units."""


def _nothing(_sources: Sources) -> list[Picture]:
    return []


@dataclass(frozen=True)
class Experiment:
    """Cells to run, how to run a trial of one, and what to make of the rows that come out."""

    name: str
    cells: Callable[[Grid], list[Cell]]
    trial: Callable[[Cell, int, Context], tuple[Row, Record | None]]
    """Runs the trial of a cell with a seed; returns its row, and its course if a figure may want it."""
    cost: Callable[[Cell], float]
    """About how long a trial of a cell takes, in seconds of simulated time: remaining times are estimated from it."""
    summarise: Callable[[list[Row]], Row]
    """Makes a summary of all rows of the experiment, whatever is missing."""
    tables: Callable[[Row], list[TextTable]]
    """Makes tables of the summary."""
    draw: Callable[[Sources], list[Picture]] = _nothing
    """Draws what the sources allow."""
    recorded: bool = True
    """Whether trials of the first seed are recorded unasked: not where they are long and nothing is drawn of them."""
