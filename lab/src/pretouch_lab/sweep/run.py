"""A sweep from its definition to a row for each cell; one that was stopped goes on with the same command."""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pretouch.atomic_write import write_json
from pretouch.extras import Extra
from pretouch_lab.engine import failure_said, run_jobs
from pretouch_lab.sweep.cluster import run_on_cluster
from pretouch_lab.sweep.definition import Sweep
from pretouch_lab.sweep.design import Point, points
from pretouch_lab.sweep.store import Damaged, Result, Store
from pretouch_lab.sweep.work import Cell, Job, cell_of, jobs_of, work

SWEEP = Extra("sweep", ("SALib", "distributed", "pyarrow"), "setup", "pretouch-lab")


@dataclass(frozen=True)
class Where:
    """Who plays the cells."""

    processes: int = 0
    """Processes of this computer; 0: one for each processor."""
    scheduler: str = ""
    """Address of a dask.distributed scheduler to use instead."""


@dataclass
class Run:
    """A sweep in a folder, and how far it is."""

    sweep: Sweep
    folder: Path
    """Of this sweep alone."""
    points: list[Point]
    cells: list[Cell]
    """One for each point; points with the same values have the same."""
    results: dict[str, Result] = field(default_factory=dict)
    """What is known, by the cells' keys."""
    notes: list[str] = field(default_factory=list)
    """What a person should know: damaged files, cells that failed before."""

    @property
    def wanted(self) -> list[Cell]:
        """Cells that are still to play: those that failed are tried again."""
        missing = [c for c in self.cells if c.key not in self.results or self.results[c.key].metrics is None]
        return list({cell.key: cell for cell in missing}.values())

    @property
    def jobs(self) -> list[Job]:
        """Those cells as jobs."""
        return jobs_of(self.sweep, self.wanted)

    @property
    def failed(self) -> list[tuple[Cell, Result]]:
        """Cells that failed, each once."""
        once = {cell.key: cell for cell in self.cells}
        return [(once[key], result) for key, result in self.results.items() if result.metrics is None and key in once]

    @property
    def cost_s(self) -> float:
        """Processor time of the whole sweep, about [s]."""
        return sum(job.cost_s for job in jobs_of(self.sweep, list({c.key: c for c in self.cells}.values())))


def opened(sweep: Sweep, out: Path) -> Run:
    """Take a sweep up in a folder, with what was played; a damaged file is reported and its cell played again."""
    SWEEP.need("A sweep")
    chosen = points(sweep)
    run = Run(sweep, out / sweep.name, chosen, [cell_of(sweep, point) for point in chosen])
    store = _store(run)
    for cell in {c.key: c for c in run.cells}.values():
        try:
            known = store.read(cell)
        except Damaged as error:
            run.notes.append(f"The file {store.file(cell.key)} is damaged ({error}): its cell is played again.")
            continue
        if known is not None:
            run.results[cell.key] = known
    if run.failed:
        run.notes.append(f"{len(run.failed)} cells of {sweep.name} failed before and are tried again.")
    with failure_said(run.folder):
        run.folder.mkdir(parents=True, exist_ok=True)
        write_json(sweep.described(), run.folder / "sweep.json")
    return run


def play(run: Run, where: Where, progress: Callable[[float], None]) -> None:
    """Play what is missing; `progress(cost_s)` after each job. However it ends, what was played is kept."""
    store, jobs = _store(run), sorted(run.jobs, key=lambda job: -job.cost_s)
    if not jobs:
        return

    def keep(cell: Cell, result: Result) -> None:
        with failure_said(run.folder):
            store.keep(cell, result)
        run.results[cell.key] = result

    def done(job: Job, answer: object) -> None:
        for cell, result in store.answered(job, answer):
            keep(cell, result)
        progress(job.cost_s)

    def lost(job: Job, reason: str) -> None:
        for cell in job.cells:
            keep(cell, Result(None, reason, 0.0))
        progress(job.cost_s)

    if where.scheduler:
        run_on_cluster(where.scheduler, jobs, done, lost)
    else:
        run_jobs(jobs, lambda job: (work, job.written()), where.processes or os.cpu_count() or 1, done, lost)


def _store(run: Run) -> Store:
    return Store(run.folder / "cells", run.sweep.measure)
