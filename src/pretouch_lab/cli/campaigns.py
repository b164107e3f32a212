"""Running campaigns from the command line: progress, results whatever happens, tables and page."""

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from pretouch.atomic_write import write_json
from pretouch.cli.tables import show
from pretouch.cli.writing import check_writable, unwritable_said
from pretouch.errors import ExperimentError, PretouchError
from pretouch_lab.campaign import (
    Request,
    finished,
    open_folder,
    progress_of,
    run_campaign,
)
from pretouch_lab.registry import summarise, tables
from pretouch_lab.report import write_report


def run_all(parts: list[tuple[Request, Path]], folder: Path, json_file: Path) -> None:
    """Run one or more campaigns; whatever happens, summarise and keep what was finished."""
    for _, out in parts:
        _check_apart(json_file, out)
    for request, out in parts:
        request.context()
        open_folder(request, out)
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
    summary = _keep(parts, json_file)["summary"]
    console = Console(highlight=False)
    show(console, tables(summary))
    console.print(f"Figures and page: {write_report(parts, summary, folder)}", soft_wrap=True, markup=False)
    console.print(f"Numbers: {json_file}", soft_wrap=True, markup=False)


def _keep(parts: list[tuple[Request, Path]], json_file: Path) -> dict[str, Any]:
    """Write all finished trials and their summary, and return them."""
    trials = [row for request, out in parts for row in finished(request, out)]
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
    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:.0f} %")
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        so_far = [progress_of(request, out) for request, out in parts]
        done, total = sum(p.cost_done for p in so_far), sum(p.cost_total for p in so_far)
        task = bar.add_task("", total=total)
        bar.update(task, completed=done)
        left = sum(p.total - p.done for p in so_far)

        def advance(cost: float) -> None:
            nonlocal left
            left -= 1
            bar.update(task, advance=cost, description=f"{', '.join(request.experiments)}; {left} trials left")

        for request, out in parts:
            bar.update(task, description=f"{', '.join(request.experiments)}; {left} trials left")
            run_campaign(request, out, advance)
