"""The shield benchmark: all its work, in which files, and what it came to."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from pretouch.atomic_write import write_json
from pretouch.errors import ExperimentError
from pretouch_lab.benchmarks.bench import Bench, Found, said
from pretouch_lab.benchmarks.scenario_files import SeedRange
from pretouch_lab.benchmarks.shield.results import guarantees, rows_of_cells, tables_of
from pretouch_lab.benchmarks.shield.trial import FILTERS, SCENES, TouchCell, tried
from pretouch_lab.engine import Task, rows_of
from pretouch_lab.run import Row

_CHUNK = 25
"""Trials of a task at most."""
_TRIAL_COST = 0.8
"""Processor time of a trial, about [s]."""
_COMMANDERS = "tracking", "at-person"
_TRIALS = {"pretouch": (50, 100), "paper": (6, 14), "none": (6, 14)}
"""Trials of a scene, with each commander; quick: one."""


@dataclass(frozen=True)
class ShieldBench(Bench):
    """The shield benchmark."""

    name: ClassVar[str] = "shield"

    def __post_init__(self) -> None:
        if self.world:
            raise ExperimentError(f"The arms of this benchmark are the usual ones: leave out --world {self.world}.")

    def stages(self) -> list[list[Task]]:
        """Return all trials."""
        return [[task for name in FILTERS for task in self._trials(name)]]

    def found(self) -> Found | None:
        """See `Bench`."""
        rows = rows_of(self.every())
        if not rows:
            return None
        made: Row = {"about": self.about(), "rows": rows_of_cells(rows)}
        text = "\n\n".join([said(made["about"]), guarantees()])
        return Found(made, tables_of(made["rows"]), "", text)

    def _trials(self, name: str) -> list[Task]:
        tasks = []
        for scene in SCENES:
            for commander, count in zip(_COMMANDERS, (1, 1) if self.quick else _TRIALS[name], strict=True):
                for first in range(0, count, _CHUNK):
                    numbers = first, min(first + _CHUNK, count)
                    file = self.out / "cells" / f"{name}_{commander}_{scene}_{numbers[0]:03d}-{numbers[1]:03d}.json"
                    work = partial(keep_trials, name, commander, scene, numbers, self.seeds)
                    tasks.append(Task(file, work, _TRIAL_COST * (numbers[1] - first)))
        return tasks


def keep_trials(
    filter_name: str, commander: str, scene: str, numbers: tuple[int, int], seeds: SeedRange, file: Path
) -> None:
    """Play the trials of some seeds, by their numbers from and to, and write them to a file."""
    rows = [tried(TouchCell(filter_name, commander, scene, number, seeds)) for number in range(*numbers)]
    write_json({"filter": filter_name, "commander": commander, "trials": rows}, file)
