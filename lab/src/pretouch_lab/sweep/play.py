"""The cells of a sweep as tasks, and what they came to: a row for each point of the design."""

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np

from pretouch import __version__
from pretouch.atomic_write import atomic_replacement, write_json
from pretouch.errors import PretouchError
from pretouch.extras import Extra
from pretouch.types import FloatArray
from pretouch_lab.engine import Task, failure_said
from pretouch_lab.run import Row
from pretouch_lab.sweep.design import SEED, Point, Sweep, points
from pretouch_lab.sweep.setting import Values, built, world_digest
from pretouch_lab.sweep.streams import measure

SWEEP = Extra("sweep", ("SALib",), "setup", "pretouch-lab")


@dataclass(frozen=True)
class Job:
    """Cells that are played one after the other, because they have a recorded stream in common."""

    task: Task
    numbers: tuple[int, ...]
    """Of the cells' points in the design."""


@dataclass(frozen=True)
class Run:
    """A sweep in a folder."""

    sweep: Sweep
    points: list[Point]
    jobs: list[Job]

    @property
    def tasks(self) -> list[Task]:
        """All work."""
        return [job.task for job in self.jobs]

    def failures(self) -> list[str]:
        """Why jobs failed, one reason each."""
        files = [job.task.file for job in self.jobs if not job.task.done and job.task.file.is_file()]
        return [str(json.loads(file.read_text(encoding="utf-8"))["failed"]) for file in files]

    def values(self) -> dict[str, FloatArray]:
        """Return each number (points,) that is measured, NaN where there is none."""
        found = {name: np.full(len(self.points), np.nan) for name in self.sweep.measure.metrics}
        for job in self.jobs:
            row = job.task.row()
            for number, metrics in zip(job.numbers, row["metrics"] if row else (), strict=row is not None):
                for name, value in metrics.items():
                    found[name][number] = np.nan if value is None else value
        return found


def opened(sweep: Sweep, out: Path) -> Run:
    """Take a sweep up in a folder: what was played there with the same parameters and version is not played again."""
    SWEEP.need("A sweep")
    cells = points(sweep)
    groups: dict[str, list[int]] = {}
    for number, point in enumerate(cells):
        shared = sweep.setting(point).world if sweep.measure.shared else json.dumps([point.values, point.seed])
        groups.setdefault(shared, []).append(number)
    jobs = [Job(_task(sweep, [cells[n] for n in numbers], out), tuple(numbers)) for numbers in groups.values()]
    return Run(sweep, cells, jobs)


def _task(sweep: Sweep, cells: Sequence[Point], out: Path) -> Task:
    """Return the task of cells with a stream in common; its file is named by all that decides it but this program."""
    values = [sweep.fixed | point.values for point in cells]
    parts = [[sorted(v.items()), point.seed, world_digest(v)] for v, point in zip(values, cells, strict=True)]
    whole = json.dumps([__version__, sweep.measure.name, sweep.profile, parts])
    file = out / "cells" / f"{sweep.measure.name}-{sha256(whole.encode()).hexdigest()[:20]}.json"
    settings = [sweep.setting(point) for point in cells]
    cost = sum(map(sweep.measure.cost_s, settings)) + sweep.measure.shared_cost_s(settings[0])
    return Task(
        file,
        partial(
            play_cells, sweep.measure.name, sweep.profile, [(v, p.seed) for v, p in zip(values, cells, strict=True)]
        ),
        cost,
        about={"failed": ""},
    )


def play_cells(experiment: str, profile: str, cells: Sequence[tuple[Values, int]], file: Path) -> None:
    """Play cells that have a stream in common, and write their numbers; or why they failed, whatever it was."""
    what, metrics = measure(experiment), []
    row: Row = {"failed": "", "experiment": experiment, "profile": profile}
    try:
        settings = [built(profile, what.scene, values, seed) for values, seed in cells]
        shared = what.shared(settings[0]) if what.shared else None
        metrics = [what.run(setting, shared) for setting in settings]
    except Exception as error:  # it is written down, and the others go on
        said = str(error) if isinstance(error, PretouchError) else f"{type(error).__name__}: {error}"
        row["failed"] = said or type(error).__name__
    row |= {"cells": [{"values": values, "seed": seed} for values, seed in cells], "metrics": metrics}
    write_json(row, file)


def write_table(run: Run, path: Path) -> None:
    """Write a row for each point as CSV: what is varied, the seed, and each number, empty where there is none."""
    values = run.values()
    with failure_said(path), atomic_replacement(path) as unfinished, open(unfinished, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*(one.name for one in run.sweep.vary), SEED, *values])
        for number, point in enumerate(run.points):
            numbers = (column[number] for column in values.values())
            writer.writerow([*point.values.values(), point.seed, *("" if np.isnan(n) else n for n in numbers)])
