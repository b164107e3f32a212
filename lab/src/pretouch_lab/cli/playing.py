"""Playing from the command line: how far it is, what is kept however it ends, and where tables and figures go."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from pretouch.cli.tables import show
from pretouch.cli.writing import check_outputs, unwritable_said
from pretouch.errors import PretouchError
from pretouch.text_table import TextTable, markdown
from pretouch_lab.options import Playing
from pretouch_lab.run import ROWS, RUN, Cell, Play, Row, missing, run, workers

if TYPE_CHECKING:  # most commands draw nothing
    from matplotlib.figure import Figure

TABLES = "tables.md"
Advance = Callable[[], None]
"""Called after each of so many pieces of work."""


@contextmanager
def bar(name: str, total: int, done: int = 0) -> Iterator[Advance]:
    """Show a bar with the time it took and still takes."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)) as shown:
        task = shown.add_task(name, total=total, completed=done)
        yield lambda: shown.advance(task)


def played(name: str, trial: Callable[[Cell, int], Row], plays: Sequence[Play], out: Path, how: Playing) -> list[Row]:
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


def check_json(how: Playing, folders: Iterable[Path]) -> None:
    """Refuse a file for the numbers that cannot be written, or in the place of one that a run keeps for itself."""
    if how.json:
        own = [folder / name for folder in folders for name in (ROWS, RUN, TABLES)]
        with unwritable_said("file", how.json):  # a name too long, for one
            check_outputs([("file", how.json)], own, replace=True)


def report(tables: list[TextTable], figures: list[tuple[str, str, "Figure"]], folder: Path, text: str = "") -> None:
    """Show tables, and write them with figures, each with its name and what it shows, into a folder."""
    console, place = Console(highlight=False), folder / TABLES
    show(console, tables)
    with unwritable_said("file", place):
        for name, _, figure in figures:
            figure.savefig(folder / f"{name}.png", dpi=120)
        pictures = [f"![{words}]({name}.png)\n" for name, words, _ in figures]
        parts = [*([text] if text else []), *(markdown(each, 2) for each in tables), *pictures]
        place.write_text("\n".join(parts), encoding="utf-8")
    console.print(f"Tables and figures: {place}", soft_wrap=True, markup=False)
