"""The shield benchmark: all its work, in which files, and what it came to."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from pretouch.errors import ExperimentError
from pretouch_lab.benchmarks.bench import Bench, Found, said
from pretouch_lab.benchmarks.shield.filters import FILTERS, filters, left_out
from pretouch_lab.benchmarks.shield.results import guarantees, rows_of_cells, tables_of
from pretouch_lab.benchmarks.shield.search import keep_learned, keep_trials
from pretouch_lab.benchmarks.shield.times import keep_times
from pretouch_lab.benchmarks.shield.trial import SCENES
from pretouch_lab.benchmarks.shield.wild import WILD, keep_wild
from pretouch_lab.documents import SHIELD
from pretouch_lab.engine import Task, rows_of
from pretouch_lab.result_key import result_key
from pretouch_lab.rows import Row

_CHUNK = 25
"""Thousands of wild steps, or trials, of a task at most."""
_STEP_COST, _TRIAL_COST, _SLOWER = 4e-4, 0.8, {"cbf": 4.0}
"""Processor time of a wild step and of a trial, about [s], and how many times slower other filters are."""


@dataclass(frozen=True)
class Amount:
    """How much of a filter is played."""

    wild: int
    """Thousands of steps, all wild commanders together."""
    trials: tuple[int, int]
    """Of a scene: with the commanders tracking and at-person."""
    learned: tuple[int, int]
    """Generations, and trials of each, of a search in a scene."""


FULL = {
    "pretouch": Amount(1000, (50, 100), (10, 10)),
    "paper": Amount(100, (6, 14), (5, 8)),
    "cbf": Amount(40, (6, 14), (5, 8)),
    "none": Amount(100, (6, 14), (5, 8)),
}
QUICK = {name: Amount(8 if name == "pretouch" else 4, (1, 1), (2, 2)) for name in FILTERS}
"""A million steps and a thousand trials of `pretouch`; quick: 20 000 steps of all, and some trials of each."""


@dataclass(frozen=True)
class ShieldBench(Bench):
    """The shield benchmark."""

    name: ClassVar[str] = "shield"
    document: ClassVar[str] = SHIELD

    def __post_init__(self) -> None:
        if self.world:
            raise ExperimentError(f"The arms of this benchmark are the usual ones: leave out --world {self.world}.")

    def stages(self) -> list[list[Task]]:
        """Return wild steps and trials; then the times, one after the other, for which the machine is to be free."""
        names = filters()
        played = [task for name in names for task in (*self._wild(name), *self._trials(name))]
        return [played, *([self._timed(name)] for name in names)]

    def found(self) -> Found | None:
        """See `Bench`."""
        rows = rows_of(self.every())
        if not rows:
            return None
        made: Row = {"about": self.about(), "rows": rows_of_cells(rows)}
        text = "\n\n".join([said(made["about"]), guarantees(made["rows"])])
        return Found(made, tables_of(made["rows"]), left_out(), [], text)

    def _amount(self, filter_name: str) -> Amount:
        return (QUICK if self.quick else FULL)[filter_name]

    def _wild(self, name: str) -> list[Task]:
        steps = 1000 * self._amount(name).wild // len(WILD)
        chunks = -(-steps // (1000 * _CHUNK))
        cost = _STEP_COST * _SLOWER.get(name, 1.0) * steps / chunks
        return [
            Task(
                self._file(f"wild_{name}_{commander}_{seed:03d}", name),
                partial(keep_wild, name, commander, seed, steps // chunks), cost,
            )
            for commander in WILD for seed in range(chunks)
        ]  # fmt: skip

    def _trials(self, name: str) -> list[Task]:
        amount, made = self._amount(name), []
        cost = _TRIAL_COST * _SLOWER.get(name, 1.0)
        for scene in SCENES:
            for commander, count in zip(("tracking", "at-person"), amount.trials, strict=True):
                for first in range(0, count, _CHUNK):
                    numbers = first, min(first + _CHUNK, count)
                    file = self._file(f"touch_{name}_{commander}_{scene}_{numbers[0]:03d}-{numbers[1]:03d}", name)
                    work = partial(keep_trials, name, commander, scene, numbers, self.seeds)
                    made.append(Task(file, work, cost * (numbers[1] - first)))
            generations, size = amount.learned
            file = self._file(f"touch_{name}_learned_{scene}_{generations}x{size}", name)
            work = partial(keep_learned, name, scene, generations, size, self.seeds)
            made.append(Task(file, work, cost * generations * size))
        return made

    def _timed(self, name: str) -> Task:
        steps = 2000 if self.quick else 10_000
        return Task(self._file(f"times_{name}_{steps}", name), partial(keep_times, name, steps), 20.0)

    def _file(self, cell: str, filter_name: str) -> Path:
        key = result_key(keep_wild, keep_learned, keep_times, profile=FILTERS[filter_name])
        return self.out / "cells" / f"{cell}_{key}.json"
