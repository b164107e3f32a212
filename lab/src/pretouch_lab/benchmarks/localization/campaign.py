"""All work of the localisation benchmark: streams to record, and skins to replay them with."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from pretouch.errors import ExperimentError
from pretouch_lab.benchmarks.bench import Bench, Found, said
from pretouch_lab.benchmarks.localization.contacts import TouchedCell, duration_s, record_touched, touched_cells
from pretouch_lab.benchmarks.localization.judge import WITHOUT, judge_touched
from pretouch_lab.engine import Task, rows_of
from pretouch_lab.run import Row

_RECORDING_COST, _REPLAY_COST = 0.075, 0.02
"""Processor time of a second of simulation, and of one replayed [s]."""
SKINS = {"nominal": "32 units", "seven": "seven", "misplaced": "32 units, misplaced"}
"""What the kinds of sensing are called."""


@dataclass(frozen=True)
class LocalizationBench(Bench):
    """The localisation benchmark."""

    name: ClassVar[str] = "localization"

    def __post_init__(self) -> None:
        if self.world:
            raise ExperimentError(f"The arm of this benchmark is the usual one: leave out --world {self.world}.")

    def stages(self) -> list[list[Task]]:
        """Return the streams to record, then their replays."""
        return [self.streams(), self.replays()]

    def found(self) -> Found | None:
        """See `Bench`."""
        from pretouch_lab.benchmarks.localization.results import rows_by_body, tables_of

        results: Row = {"about": self.about(), "rows": rows_by_body(rows_of(self.replays()))}
        return Found(results, tables_of(results), "", said(results["about"]))

    def streams(self) -> list[Task]:
        """Return the streams to record."""
        return [
            Task(self._stream(cell), partial(record_touched, cell), _RECORDING_COST * duration_s(cell))
            for cell in self._cells()
        ]

    def replays(self) -> list[Task]:
        """Return the replays of the streams, with their skins and without any."""
        tasks = []
        for cell in self._cells():
            without = WITHOUT if cell.sensing == "nominal" else ()
            for skin in (SKINS[cell.sensing], *without):
                file = self.out / "replays" / f"{cell.name}_{skin.replace(', ', '-').replace(' ', '-')}.json"
                work = partial(judge_touched, cell, skin, self._stream(cell))
                tasks.append(Task(file, work, _REPLAY_COST * duration_s(cell)))
        return tasks

    def _cells(self) -> list[TouchedCell]:
        return touched_cells(self.seeds, self.quick)

    def _stream(self, cell: TouchedCell) -> Path:
        return self.out / "streams" / f"{cell.name}.npz"
