"""Running campaigns from the command line: progress, results whatever happens, tables and figures."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from rich.console import Console

from pretouch.atomic_write import write_json
from pretouch.cli.tables import show
from pretouch.cli.writing import STANDARD_OUTPUT, check_writable, numbers_to, unwritable_said
from pretouch.errors import ExperimentError, PretouchError
from pretouch_lab.campaign import Request
from pretouch_lab.cli.progress import bar
from pretouch_lab.engine import missing, rows_of, run_tasks
from pretouch_lab.registry import summarise, tables
from pretouch_lab.report import write_report


def run_all(parts: list[tuple[Request, Path]], folder: Path, json: str = "") -> None:
    """Run one or more campaigns and show their tables; whatever happens, summarise and keep what was finished.

    `json` is as `results_to` takes it.
    """
    with results_to(json, folder) as (json_file, write):
        write(_run_all(parts, folder, json_file))


@contextmanager
def results_to(json: str, folder: Path) -> Iterator[tuple[Path, Callable[[Any], None]]]:
    """Give the file for the results, results.json in a folder unless --json names one, and what writes them for '-'."""
    printed = json == STANDARD_OUTPUT
    with numbers_to(json if printed else "") as write:
        yield Path(json) if json and not printed else folder / "results.json", write


def _run_all(parts: list[tuple[Request, Path]], folder: Path, json_file: Path) -> dict[str, Any]:
    for _, out in parts:
        _check_apart(json_file, out)
    for request, out in parts:
        request.open(out)
    check_writable("file", json_file)
    try:
        _play(parts)
    except PretouchError:
        with suppress(PretouchError):  # one sentence is enough, and the first is the cause
            _keep(parts, json_file)
        raise
    except BaseException:
        try:
            done = len(_keep(parts, json_file)["trials"])
            said = (
                f"Stopped: the {done} finished trials are in {json_file}; the same command with --out {folder} goes on."
            )
        except PretouchError as error:
            said = str(error)
        print(said, file=sys.stderr)
        raise
    results = _keep(parts, json_file)
    summary = results["summary"]
    console = Console(highlight=False)
    show(console, tables(summary))
    console.print(f"Tables and figures: {write_report(parts, summary, folder)}", soft_wrap=True, markup=False)
    console.print(f"Numbers: {json_file}", soft_wrap=True, markup=False)
    return results


def _keep(parts: list[tuple[Request, Path]], json_file: Path) -> dict[str, Any]:
    """Write all finished trials and their summary, and return them."""
    trials = [row for request, out in parts for row in rows_of(request.tasks(out))]
    results = {"trials": trials, "summary": summarise(trials)}
    with unwritable_said("file", json_file):
        write_json(results, json_file)
    return results


def _check_apart(json_file: Path, out: Path) -> None:
    """Refuse a file for the results in the place of one that the run keeps for itself."""
    wanted = Path(os.path.realpath(json_file))
    for name in ("run.json", "trials", "recordings"):
        if wanted.is_relative_to(os.path.realpath(out / name)):
            raise ExperimentError(f"The file {json_file} would take the place of the run's own {name}: give another.")


def _play(parts: list[tuple[Request, Path]]) -> None:
    tasks = [(request, out, request.tasks(out)) for request, out in parts]
    every = [task for _, _, own in tasks for task in own]
    undone = missing(every)
    left, total = len(undone), sum(task.cost for task in every)
    with bar(Console(stderr=True), "", total, total - sum(task.cost for task in undone)) as advance:
        for request, out, own in tasks:
            names = ", ".join(request.experiments)
            advance(0.0, f"{names}; {left} trials left")

            def progress(cost: float, names: str = names) -> None:
                nonlocal left
                left -= 1
                advance(cost, f"{names}; {left} trials left")

            run_tasks(own, out, progress)
