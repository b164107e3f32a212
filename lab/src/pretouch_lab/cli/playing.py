"""Trials from the command line: progress, rows that survive an interruption, and files of tables and figures."""

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
"""Name, caption and figure."""


@contextmanager
def bar(name: str, total: int, done: int = 0) -> Iterator[Callable[[], None]]:
    """Show a progress bar with elapsed and remaining time; yield a function that advances it by one."""
    from rich import progress

    columns = progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn()
    times = progress.TimeElapsedColumn(), progress.TimeRemainingColumn()
    with progress.Progress(*columns, *times, console=Console(stderr=True)) as display:
        task = display.add_task(name, total=total, completed=done)
        yield lambda: display.advance(task)


def played(name: str, trial: Trial, plays: Sequence[Play], out: Path, how: Playing) -> list[Row]:
    """Play the trials that a folder lacks, with a progress bar; print the place of the rows on an interruption."""
    left = missing(plays, out)
    if not left:
        return run(trial, plays, out)
    try:
        processes = (os.cpu_count() or 1) if how.processes is None else how.processes
        with workers(min(processes, left)) as pool, bar(name, len(plays), len(plays) - left) as advance:
            return run(trial, plays, out, *pool, done=advance)
    except BaseException as error:
        if not isinstance(error, PretouchError):
            there = f"{len(plays) - missing(plays, out)} of {len(plays)} rows are in {out / ROWS}"
            print(f"Stopped: {there}; the same command with --out {how.out or out} continues.", file=sys.stderr)
        raise


def begin(how: Playing, out: Path, arguments: Mapping[str, Any]) -> None:
    """Create a folder for rows, or continue one of a run with the same arguments, after a check of --json."""
    check_numbers(how, out)
    open_run(out, arguments)


def check_numbers(how: Playing, out: Path) -> None:
    """Raise ExperimentError if --json could overwrite a file of the run: a name in its folder must end in .json."""
    if how.json and str(how.json) != STANDARD_OUTPUT:
        place = how.json.resolve()
        if place.is_relative_to(out.resolve()) and (place.suffix != ".json" or place.name == RUN):
            raise ExperimentError(
                f"The file {how.json} is in {out}, where the run keeps its own: give a name that ends in .json, but not"
                f" {RUN}, or another folder."
            )


def report(tables: list[TextTable], figures: list[DrawnFigure], folder: Path, text: str = "") -> None:
    """Print tables, and write them with figures into a folder."""
    console, place = Console(highlight=False), folder / TABLES
    show(console, tables)
    with unwritable_said("file", place):
        for name, _, figure in figures:
            figure.savefig(folder / f"{name}.png", dpi=120)
        pictures = [f"![{words}]({name}.png)\n" for name, words, _ in figures]
        parts = [*([text] if text else []), *(markdown(each, 2) for each in tables), *pictures]
        place.write_text("\n".join(parts), encoding="utf-8")
    console.print(f"Tables and figures: {place}", soft_wrap=True, markup=False)
