"""The command `pretouch`."""

import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from pretouch.errors import ExperimentError, PretouchError

# the rest of the package takes a second to import: only the functions that run something do
if TYPE_CHECKING:
    from pretouch.experiments.campaign import Request

_USAGE, _INTERRUPTED = 2, 130
_TERMINATED = 143


@dataclass(frozen=True)
class Demo:
    """Play a small part of the paper's three experiments, blind and with proximity, and show what came out."""

    seeds: int = 4
    """Trials of each cell of the static experiment; the other two take one."""
    out: str = ""
    """Folder for results, figures and page; by default a new one under runs/."""


@dataclass(frozen=True)
class Reproduce:
    """Run the paper's experiments in full. A run that was stopped goes on where it was, with the same parameters."""

    experiment: tyro.conf.Positional[str] = "all"
    """static (paper IV-A), avoidance (IV-B), dynamic (IV-C) or all."""
    seeds: int = 12
    """Trials of each cell; each seed is another arm with other errors, noise and geometry."""
    profiles: str = "blind,paper"
    """Profiles to compare, separated by commas."""
    restrictions: str = ""
    """off, hard, slack or floor for all experiments; by default off in the static one and slack in the others."""
    orientation: str = ""
    """free or hold: whether the task keeps the hand's orientation; by default the profile's own, hold."""
    stiffness: float = 25_000.0
    """Contact stiffness of the static object [N/m]."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    out: str = ""
    """Folder for results, figures and page; by default runs/reproduce-EXPERIMENT."""
    json: str = ""
    """File for all trials and their summary; by default results.json in the folder."""


Command = Annotated[Demo, tyro.conf.subcommand("demo")] | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]


class _Terminated(BaseException):
    """SIGTERM, turned into an exception so that what is under way can end in order."""


@contextmanager
def _sigterm_raises() -> Iterator[None]:
    def handle(_number: int, _frame: FrameType | None) -> None:
        raise _Terminated

    before = signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code: 2 for bad input, 130 or 143 after Ctrl-C or SIGTERM."""
    errors = Console(stderr=True, soft_wrap=True, highlight=False)
    try:
        with _sigterm_raises():
            command = tyro.cli(Command, prog="pretouch", description="Contact-anticipating robot arms.", args=args)
            if isinstance(command, Demo):
                _demo(command)
            else:
                _reproduce(command)
    except PretouchError as error:
        errors.print(str(error), markup=False)
        return _USAGE
    except KeyboardInterrupt:
        return _INTERRUPTED
    except _Terminated:
        return _TERMINATED
    return 0


def _demo(command: Demo) -> None:
    from pretouch.experiments.campaign import Request

    out = Path(command.out) if command.out else _new_folder("demo")
    few = Request(("avoidance", "dynamic"), seeds=1)
    many = Request(("static",), seeds=command.seeds)
    _run([(many, out / "static"), (few, out / "people")], out, out / "results.json")


def _new_folder(name: str) -> Path:
    return next(path for n in count(1) if not (path := Path("runs") / f"{name}-{n}").exists())


def _reproduce(command: Reproduce) -> None:
    from pretouch.experiments.campaign import EXPERIMENTS, Request

    request = Request(
        experiments=tuple(EXPERIMENTS) if command.experiment == "all" else (command.experiment,),
        seeds=command.seeds,
        profiles=tuple(part.strip() for part in command.profiles.split(",") if part.strip()),
        restrictions=command.restrictions or None,
        orientation=command.orientation or None,
        stiffness=command.stiffness,
        skin=command.skin or None,
    )
    out = Path(command.out or f"runs/reproduce-{command.experiment}")
    _run([(request, out)], out, Path(command.json) if command.json else out / "results.json")


def _run(parts: list[tuple["Request", Path]], folder: Path, json_file: Path) -> None:
    """Run one or more campaigns; whatever happens, summarise and keep what was finished."""
    from pretouch.experiments.campaign import open_folder
    from pretouch.experiments.report import write_report

    for _, out in parts:
        _check_apart(json_file, out)
    for request, out in parts:
        request.context()
        open_folder(request, out)
    _check_writable(json_file)
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
    _show(console, summary)
    console.print(f"Figures and page: {write_report(parts, summary, folder)}", soft_wrap=True, markup=False)
    console.print(f"Numbers: {json_file}", soft_wrap=True, markup=False)


def _keep(parts: list[tuple["Request", Path]], json_file: Path) -> dict[str, Any]:
    """Write all finished trials and their summary, and return them."""
    from pretouch.experiments.campaign import finished, write_json
    from pretouch.experiments.summary import summarise

    trials = [row for request, out in parts for row in finished(request, out)]
    results = {"trials": trials, "summary": summarise(trials)}
    with _unwritable_said(json_file):
        write_json(results, json_file)
    return results


def _check_apart(json_file: Path, out: Path) -> None:
    """Refuse a file for the results in the place of one that the run keeps for itself."""
    wanted = Path(os.path.realpath(json_file))
    for name in ("run.json", "trials", "traces"):
        if wanted.is_relative_to(os.path.realpath(out / name)):
            raise ExperimentError(f"The file {json_file} would take the place of the run's own {name}: give another.")


@contextmanager
def _unwritable_said(json_file: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ExperimentError(f"The file {json_file} cannot be written: {error.strerror}: give another.") from error


def _check_writable(json_file: Path) -> None:
    with _unwritable_said(json_file):
        json_file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=json_file.parent):
            pass
        with suppress(FileNotFoundError):
            os.stat(json_file)  # a name too long, for one
        if json_file.is_dir():
            raise IsADirectoryError(21, "Is a directory")


def _play(parts: list[tuple["Request", Path]]) -> None:
    from pretouch.experiments.campaign import run_campaign

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)) as progress:
        for request, out in parts:
            run_campaign(request, out, _shower(progress, ", ".join(request.experiments)))


def _shower(progress: Progress, name: str) -> Callable[[int, int], None]:
    task = progress.add_task(name, total=None)

    def show(done: int, total: int) -> None:
        progress.update(task, completed=done, total=total)

    return show


def _show(console: Console, summary: dict[str, Any]) -> None:
    from pretouch.experiments.tables import tables

    for table in tables(summary):
        console.print()
        console.print(table.title, style="bold", markup=False)
        drawn = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
        for i, text in enumerate(table.header):
            drawn.add_column(text, justify="left" if i < 2 else "right")
        for row in table.rows:
            drawn.add_row(*row)
        console.print(drawn)
        console.print(table.note, style="dim", markup=False)
    console.print()


if __name__ == "__main__":
    sys.exit(main())
