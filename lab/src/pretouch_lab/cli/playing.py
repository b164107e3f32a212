"""Playing from the command line: how far it is, what is kept however it ends, and where tables and figures go."""

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from pretouch.cli.tables import show
from pretouch.cli.writing import STANDARD_OUTPUT, unwritable_said
from pretouch.errors import ExperimentError, PretouchError
from pretouch.text_table import TextTable, markdown
from pretouch_lab.options import Playing
from pretouch_lab.run import ROWS, RUN, Play, Row, Trial, missing, open_run, run, workers

if TYPE_CHECKING:  # most commands draw nothing
    from matplotlib.figure import Figure

TABLES = "tables.md"
DrawnFigure = tuple[str, str, "Figure"]
"""Its name, and what it shows."""


@contextmanager
def bar(name: str, total: int, done: int = 0) -> Iterator[Callable[[], None]]:
    """Show a bar with the time it took and still takes; give what moves it on by a piece of work."""
    from rich import progress

    columns = progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn()
    times = progress.TimeElapsedColumn(), progress.TimeRemainingColumn()
    with progress.Progress(*columns, *times, console=Console(stderr=True)) as shown:
        task = shown.add_task(name, total=total, completed=done)
        yield lambda: shown.advance(task)


def played(name: str, trial: Trial, plays: Sequence[Play], out: Path, how: Playing) -> list[Row]:
    """Play what is missing in a folder, with a bar; say where the rows are if something ends it."""
    left = missing(plays, out)
    if not left:
        return run(trial, plays, out)
    try:
        processes = (os.cpu_count() or 1) if how.processes is None else how.processes
        with workers(min(processes, left), how.scheduler) as pool, bar(name, len(plays), len(plays) - left) as advance:
            return run(trial, plays, out, *pool, done=advance)
    except BaseException as error:
        if not isinstance(error, PretouchError):
            there = f"{len(plays) - missing(plays, out)} of {len(plays)} rows are in {out / ROWS}"
            print(f"Stopped: {there}; the same command with --out {how.out or out} goes on.", file=sys.stderr)
        raise


def begin(how: Playing, out: Path, arguments: Mapping[str, Any]) -> None:
    """Make a folder for rows, or take one up that a run with the same arguments began, unless --json is in its way."""
    check_numbers(how, out)
    open_run(out, arguments)


def check_numbers(how: Playing, out: Path) -> None:
    """Refuse a file for the numbers in the place of one that a run keeps in its folder: none of them ends in .json."""
    if how.json and str(how.json) != STANDARD_OUTPUT:
        place = how.json.resolve()
        if place.is_relative_to(out.resolve()) and (place.suffix != ".json" or place.name == RUN):
            raise ExperimentError(
                f"The file {how.json} is in {out}, where the run keeps its own: give a name that ends in .json, but not"
                f" {RUN}, or another folder."
            )


def report(tables: list[TextTable], figures: list[DrawnFigure], folder: Path, text: str = "") -> None:
    """Show tables, and write them with figures into a folder."""
    console, place = Console(highlight=False), folder / TABLES
    show(console, tables)
    with unwritable_said("file", place):
        for name, _, figure in figures:
            figure.savefig(folder / f"{name}.png", dpi=120)
        pictures = [f"![{words}]({name}.png)\n" for name, words, _ in figures]
        parts = [*([text] if text else []), *(markdown(each, 2) for each in tables), *pictures]
        place.write_text("\n".join(parts), encoding="utf-8")
    console.print(f"Tables and figures: {place}", soft_wrap=True, markup=False)
