"""Plays trials in any executor: a cell and a seed give a row, and a later run continues the file of rows.

A folder holds `run.json` (version, commit, arguments) and `rows.jsonl`, one row a line. A trial whose row is in the
folder is not played again. A folder of another version or of other arguments is refused.
"""

import fcntl
import json
import os
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent import futures
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from itertools import islice
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import IO, Any

from pretouch import __version__
from pretouch.atomic_write import write_json
from pretouch.cli.writing import plain
from pretouch.errors import ExperimentError
from pretouch.signals import kept_from_children, leave_to_parent, noted

ROWS, RUN = "rows.jsonl", "run.json"

Row = dict[str, Any]
"""Result of one play or of several: plain values by name."""
Cell = Row
"""Parameters of a play, without its seed. All cells of a run have the same names."""
Play = tuple[Cell, int]
"""A cell and a seed."""
Trial = Callable[[Cell, int], Row]
"""Returns the row of a cell and a seed. Workers need a function of a module, or a `partial` of one."""


def plays_of(cells: Iterable[Cell], seeds: Iterable[int]) -> list[Play]:
    """Return all cells with each seed, seed by seed, so that a stopped run has rows of every cell."""
    every = list(cells)
    return [(cell, seed) for seed in seeds for cell in every]


def run(
    trial: Trial,
    plays: Sequence[Play],
    out: Path,
    executor: Executor | None = None,
    at_once: int = os.cpu_count() or 1,
    done: Callable[[], None] = lambda: None,
) -> list[Row]:
    """Play the trials whose rows the folder lacks, and return the rows of all plays, in their order.

    Args:
        trial: plays a cell with a seed.
        plays: cells with their seeds, in the order of their start. Equal plays are played once.
        out: the folder. Its `rows.jsonl` has the rows of finished plays, even if the run fails.
        executor: plays the trials; None: this process, one trial at a time.
        at_once: number of plays that the executor has at a time.
        done: called after each play.

    Raises:
        ExperimentError: if a worker was killed, if rows cannot be read or written, or if a trial returns values that
            JSON cannot hold.
    """
    with _rows_in(out, plays) as (file, rows):
        left = {key: play for play in plays if (key := _key(*play)) not in rows}
        for cell, seed, measured in _played(trial, list(left.values()), executor, at_once):
            line = _line(cell, seed, measured)
            with _kept_in(out):
                file.write(line.encode() + b"\n")
                file.flush()
            rows[_key(cell, seed)] = json.loads(line)
            done()
    return [rows[_key(*play)] for play in plays]


def missing(plays: Sequence[Play], out: Path) -> int:
    """Count the plays without a row in the folder."""
    with _rows_in(out, plays) as (_, rows):
        return sum(_key(*play) not in rows for play in plays)


def _key(cell: Cell, seed: int) -> str:
    return json.dumps([cell, seed], sort_keys=True)


def _line(cell: Row, seed: int, measured: Row) -> str:
    """Return a row as a line of JSON; numbers that are not finite become null."""
    own = cell | {"seed": seed}
    if other := [name for name in own if name in measured and measured[name] != own[name]]:
        raise ExperimentError(
            f"The trial of {cell} with seed {seed} returns {other[0]!r}, a name of its cell: rename that measure."
        )
    try:
        return json.dumps(plain(own | measured), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ExperimentError(f"The row of {cell} with seed {seed} cannot be JSON: {error}.") from error


@contextmanager
def _kept_in(out: Path) -> Iterator[None]:
    """Name the folder in the error where rows cannot be read or written."""
    try:
        yield
    except OSError as error:
        raise ExperimentError(
            f"Rows could not be kept in {out} ({error.strerror or error}): remove the cause and run the same command"
            " with the same --out to go on, or give another --out."
        ) from error


@contextmanager
def _rows_in(out: Path, plays: Sequence[Play]) -> Iterator[tuple[IO[bytes], dict[str, Row]]]:
    """Open a folder's rows to read and append; the lock keeps other runs out.

    A last line that a killed process left incomplete is removed.
    """
    place, names = out / ROWS, tuple(plays[0][0]) if plays else ()
    with _kept_in(out):
        out.mkdir(parents=True, exist_ok=True)
        file = place.open("a+b")
    try:
        with _kept_in(out):
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise ExperimentError(f"Another run writes to {place}: let it end, or give another --out.") from None
            file.seek(0)
            *lines, torn = file.read().split(b"\n")
            file.truncate(file.tell() - len(torn))
        yield file, dict(_read(number, line, names, place) for number, line in enumerate(lines, 1))
    finally:
        with _kept_in(out):
            file.close()


def _read(number: int, line: bytes, names: tuple[str, ...], place: Path) -> tuple[str, Row]:
    try:
        row = json.loads(line)
        return _key({name: row[name] for name in names}, row["seed"]), row
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ExperimentError(
            f"Line {number} of {place} is damaged ({error!r}): take the line out, or give another --out."
        ) from error


def _played(
    trial: Trial, plays: list[Play], executor: Executor | None, at_once: int
) -> Iterator[tuple[Cell, int, Row]]:
    """Yield each play with its result, in the order in which the plays end."""
    if executor is None:
        for cell, seed in plays:
            yield cell, seed, trial(cell, seed)
        return
    waiting = iter(plays)
    running: dict[Future[Row], Play] = {}
    try:
        with noted(signal.SIGINT), kept_from_children():  # so that Ctrl-C finds no process half imported
            running = {executor.submit(trial, *play): play for play in islice(waiting, at_once)}
        while running:
            for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                measured = future.result()
                cell, seed = running.pop(future)
                yield cell, seed, measured
                running |= {executor.submit(trial, *play): play for play in islice(waiting, 1)}
    except futures.BrokenExecutor as error:
        played = " or ".join(f"{cell} with seed {seed}" for cell, seed in running.values())
        raise ExperimentError(
            f"A worker process was killed, perhaps for lack of memory, while it played {played}. All finished plays are"
            " kept: run the same command with the same --out to go on."
        ) from error
    finally:
        for future in running:
            future.cancel()


@contextmanager
def workers(processes: int | None = None) -> Iterator[tuple[Executor | None, int]]:
    """Yield an executor and the number of plays it takes at once: `run(..., *workers)`.

    Args:
        processes: worker processes of this machine; None: one for each processor; 1: this process itself.
    """
    if processes is not None and processes < 1:
        raise ExperimentError(f"The number of processes is {processes}: give 1 or more.")
    count = processes or os.cpu_count() or 1
    if count == 1:
        yield None, 1
        return
    pool = futures.ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_start)
    try:
        yield pool, count
    except BaseException:
        for process in active_children():
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown()


def _start() -> None:
    """Leave the terminal's signals to the parent, which ends the workers; end with the parent if it is killed."""
    leave_to_parent()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def open_run(out: Path, arguments: Mapping[str, Any]) -> None:
    """Create a folder for rows, or continue one of a run with the same arguments.

    Raises ExperimentError for a folder that cannot be used, and for one of other arguments, another version or another
    commit of this package.
    """
    own = json.loads(json.dumps({"version": __version__, "commit": commit(), **arguments}))
    place = out / RUN
    try:
        with _kept_in(out):
            out.mkdir(parents=True, exist_ok=True)
            if not place.exists():
                write_json(own, place)
            before = dict(json.loads(place.read_text(encoding="utf-8")))
    except (ValueError, TypeError, RecursionError) as error:
        raise ExperimentError(f"The file {place} is damaged ({error}): give another --out.") from error
    other = [
        f"{name} = {before.get(name)!r}, not {own.get(name)!r}"
        for name in dict.fromkeys([*before, *own])
        if before.get(name) != own.get(name)
    ]
    if other:
        raise ExperimentError(
            f"The folder {out} holds a run with {'; '.join(other)}: give another --out, or the arguments of that run."
        )


def commit() -> str | None:
    """Return the commit of the clone that tracks this package; None if the package is not in a clone."""
    git, file = shutil.which("git"), Path(__file__)
    if git is None or not any((parent / ".git").exists() for parent in file.parents):
        return None
    tracked, head = ("ls-files", "--error-unmatch", file.name), ("rev-parse", "HEAD")
    for arguments in (tracked, head):
        answer = subprocess.run([git, *arguments], cwd=file.parent, capture_output=True, text=True, check=False)  # noqa: S603
        if answer.returncode:
            return None
    return answer.stdout.strip()
