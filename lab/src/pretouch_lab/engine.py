"""One engine for every campaign: tasks that leave one file each, and worker processes that make what is missing.

A file is written whole or not at all, and its name says which parameters made it; `run.json` of its folder says which
version did. A run that was stopped goes on, and takes up nothing of another version or of other parameters.
"""

import json
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any, TypeVar

from pretouch import __version__
from pretouch.atomic_write import write_json
from pretouch.errors import ExperimentError
from pretouch.signals import kept_from_children, leave_to_parent, noted

Row = dict[str, Any]
"""What one task found, as its JSON file holds it."""
Progress = Callable[[float], None]
"""Called with the cost of each task that was done."""
Job = TypeVar("Job")
Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Task:
    """One piece of work, which leaves one file: a row of results (.json), or arrays."""

    file: Path
    work: Callable[[Path], None]
    """Makes the file; runs in another process, so a function of a module or a `partial` of one."""
    cost: float
    """Processor time it takes, about [s], or what else the remaining time is estimated from."""
    turn: int = 0
    """Tasks of a lower turn come first; among those of the same, the longest."""
    about: Row = field(default_factory=dict)
    """What its row holds at least: a file with something else counts as missing."""

    def row(self) -> Row | None:
        """Read its row; None where there is none, or a damaged one."""
        try:
            row = _object(self.file)
        except (OSError, _Damaged):
            return None
        return row if all(row.get(key) == value for key, value in self.about.items()) else None

    @property
    def done(self) -> bool:
        """Whether its file is there, and whole."""
        return self.file.exists() if self.file.suffix != ".json" else self.row() is not None


def missing(tasks: Iterable[Task]) -> list[Task]:
    """Return the tasks that are not done."""
    return [task for task in tasks if not task.done]


def rows_of(tasks: Iterable[Task]) -> list[Row]:
    """Read the rows of all tasks that are done, in their order."""
    return [row for task in tasks if (row := task.row()) is not None]


def run_tasks(tasks: Iterable[Task], out: Path, progress: Progress, processes: int | None = None) -> None:
    """Do what is missing, by default on all processors; however it ends, files of finished tasks stay."""
    left = sorted(missing(tasks), key=lambda task: (task.turn, -task.cost))
    with failure_said(out):
        for folder in {task.file.parent for task in left}:
            folder.mkdir(parents=True, exist_ok=True)
        run_jobs(left, _do, processes, lambda task, _: progress(task.cost))


def _do(task: Task) -> None:
    task.work(task.file)


def run_jobs(
    jobs: Sequence[Job], work: Callable[[Job], Answer], processes: int | None, done: Callable[[Job, Answer], None]
) -> None:
    """Do jobs in worker processes, in their order; `done` is handed each with its answer, as it comes.

    With one process they are done in this one; None: one for each processor. A killed process is a BrokenProcessPool.
    """
    if processes == 1:
        for job in jobs:
            done(job, work(job))
        return
    with _workers(max(1, min(processes or os.cpu_count() or 1, len(jobs)))) as pool:
        with _interrupt_held_back():
            running = {pool.submit(work, job): job for job in jobs}
        for future in as_completed(running):
            done(running[future], future.result())


@contextmanager
def _workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """Have so many worker processes; an exception ends them at once, and what they were to do."""
    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_start)
    try:
        yield pool
    except BaseException:
        for process in active_children():
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown()


@contextmanager
def _interrupt_held_back() -> Iterator[None]:
    """Hold Ctrl-C back while processes start; they inherit that, so that it finds none of them half imported.

    Here it may come by another thread of a library, which this one's mask does not keep from calling the handler.
    """
    with noted(signal.SIGINT), kept_from_children():
        yield


def _start() -> None:
    """Leave a terminal's signals, Ctrl-Z too, to the parent, which ends the workers; do not outlive it if killed."""
    leave_to_parent()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def failure_said(out: Path) -> Iterator[None]:
    """Turn a worker that was killed, or results that could not be written, into an ExperimentError."""
    try:
        yield
    except BrokenProcessPool as error:
        raise ExperimentError(
            "A worker process was killed, for want of memory perhaps: the same command with the same --out goes on."
        ) from error
    except OSError as error:
        raise ExperimentError(
            f"Results could not be written to {out} ({error.strerror or error}): remove the cause, and the same command"
            " with the same --out goes on."
        ) from error


def open_folder(out: Path, about: Mapping[str, Any], digests: Mapping[str, str], parts: Iterable[str] = ()) -> None:
    """Make a folder for results, or take one up that a run with the same choices began.

    Args:
        out: the folder; `run.json` in it says what it holds.
        about: choices by their names, as JSON can hold them.
        digests: of files that the choices only name, by a phrase such as "the skin file has".
        parts: names of folders to make in it.

    Raises:
        ExperimentError: for a folder that cannot be used, or that another version or other choices filled.
    """
    wanted = json.loads(json.dumps({"version": __version__, **about, "sha256": dict(digests)}))
    place = out / "run.json"
    try:
        for folder in (out, *(out / part for part in parts)):
            folder.mkdir(parents=True, exist_ok=True)
        if place.exists():
            _check_same(_object(place), wanted, out)
        else:
            write_json(wanted, place)
    except OSError as error:
        raise ExperimentError(f"The folder {out} cannot be used: {error.strerror}: give another --out.") from error
    except _Damaged as error:
        raise ExperimentError(f"The file {place} is damaged ({error}): give another --out.") from error


def _check_same(found: Row, wanted: Row, out: Path) -> None:
    """Refuse to go on with a run that other choices began."""
    for key, value in wanted.items():
        if key != "sha256" and found.get(key) != value:
            raise ExperimentError(
                f"The folder {out} holds a run with {key} = {found.get(key)!r}, not {value!r}:"
                " give another --out, or the parameters of that run."
            )
    before = found.get("sha256")
    for what, digest in wanted["sha256"].items():
        if not isinstance(before, dict) or before.get(what) != digest:
            raise ExperimentError(f"The folder {out} holds a run, but {what} changed since: give another --out.")


class _Damaged(Exception):
    """A JSON file holds something else than an object."""


def _object(path: Path) -> Row:
    """Read a JSON file that holds an object."""
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # not UTF-8, not JSON, brackets too deep
        raise _Damaged(error) from error
    if not isinstance(value, dict):
        raise _Damaged("it holds no object")
    return value
