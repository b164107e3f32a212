"""Where a benchmark keeps what it made: one file for each piece of work, whole or not there, so that a run goes on."""

import json
import os
from collections.abc import Callable, Iterable
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pretouch import __version__
from pretouch.atomic_write import atomic_replacement, write_json
from pretouch.errors import ExperimentError
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.scenario_files import checksums
from pretouch_lab.results_file import failure_said
from pretouch_lab.workers import interrupt_held_back, workers

Row = dict[str, Any]

EMPTY: Row = dict.fromkeys(
    (
        "contender", "scenario", "seen", "false_alarms_per_hour", "median_delay_s", "p95_delay_s", "missed", "contacts",
        "peak_estimate_n", "true_peak_20ms_n", "first_contact_s", "cycle_time_s",
    )
)  # fmt: skip
"""A row of a benchmark's JSON file, of which nothing is known."""


@dataclass(frozen=True)
class Task:
    """One piece of work, which leaves one file."""

    file: Path
    work: Callable[[Path], None]
    """Makes the file; to be had in another process, so a function of a module or a `partial` of one."""
    cost: float
    """Processor time it takes, about [s]."""


def open_bench(out: Path, name: str, choices: dict[str, Any]) -> None:
    """Make a folder for a benchmark's results, or take one up that a run with the same choices began.

    Raises ExperimentError for a folder that cannot be used, or that another version, scenario or choice filled.
    """
    wanted = {"bench": name, "version": __version__, "scenarios": checksums(), **choices}
    about = out / "run.json"
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not about.exists():
            write_json(wanted, about)
            return
        found = json.loads(about.read_text(encoding="utf-8"))
    except OSError as error:
        raise ExperimentError(f"The folder {out} cannot be used: {error.strerror}: give another --out.") from error
    except ValueError as error:
        raise ExperimentError(f"The file {about} is damaged ({error}): give another --out.") from error
    for key, value in wanted.items():
        if not isinstance(found, dict) or found.get(key) != value:
            raise ExperimentError(f"The folder {out} holds a run with another {key}: give another --out.")


def expected(tasks: list[Task], processes: int | None = None) -> str:
    """Say how long tasks take, whose costs are in seconds of a processor, and how much of that is left."""
    count = processes or os.cpu_count() or 1
    total, left = (sum(task.cost for task in some) / count / 60 for some in (tasks, missing(tasks)))
    return f"about {total:.0f} min on {count} processor{'s' if count > 1 else ''}, {left:.0f} of them left"


def missing(tasks: Iterable[Task]) -> list[Task]:
    """Return the tasks whose file is not there."""
    return [task for task in tasks if not task.file.exists()]


def run_tasks(tasks: list[Task], out: Path, progress: Callable[[float], None], processes: int | None = None) -> None:
    """Do what is missing, the longest first, on all processors; `progress(cost)` after each.

    However it ends, files of finished tasks stay.
    """
    left = sorted(missing(tasks), key=lambda task: -task.cost)
    if not left:
        return
    with failure_said(out):
        for folder in {task.file.parent for task in left}:
            folder.mkdir(parents=True, exist_ok=True)
        if processes == 1:
            for task in left:
                task.work(task.file)
                progress(task.cost)
            return
        with workers(min(len(left), processes or os.cpu_count() or 1)) as pool:
            with interrupt_held_back():
                futures = {pool.submit(task.work, task.file): task.cost for task in left}
            for future in as_completed(futures):
                future.result()
                progress(futures[future])


def write_arrays(arrays: dict[str, FloatArray], path: Path) -> None:
    """Write arrays to an .npz file, whole or not at all."""
    with atomic_replacement(path) as unfinished, unfinished.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]  # names of arrays, not `allow_pickle`


def read_rows(tasks: Iterable[Task]) -> list[Row]:
    """Read the JSON objects that tasks left, in their order; a damaged one is an ExperimentError."""
    rows = []
    for task in tasks:
        try:
            rows.append(json.loads(task.file.read_text(encoding="utf-8")))
        except ValueError as error:
            raise ExperimentError(f"The file {task.file} is damaged ({error}): delete it and run again.") from error
    return rows
