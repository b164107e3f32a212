"""All work of the localisation benchmark: streams to record, and skins to replay them with."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pretouch.profiles import profile
from pretouch_lab.benchmarks.localization.contacts import TouchedCell, duration_s, record_touched, touched_cells
from pretouch_lab.benchmarks.localization.judge import PROFILE, WITHOUT, judge_touched
from pretouch_lab.benchmarks.scenario_files import SeedRange
from pretouch_lab.benchmarks.store import Row, Task, open_bench, read_rows, run_tasks
from pretouch_lab.result_key import result_key

NAME = "localization"
_RECORDING_COST, _REPLAY_COST = 0.075, 0.02
"""Processor time of a second of simulation, and of one replayed [s]."""
SKINS = {"nominal": "32 units", "seven": "seven", "misplaced": "32 units, misplaced"}
"""What the kinds of sensing are called."""


@dataclass(frozen=True)
class Bench:
    """What of the localisation benchmark is run."""

    out: Path
    """Folder for everything that is kept."""
    quick: bool = False
    seeds: SeedRange = "published"

    def open(self) -> None:
        """Make the folder or take it up."""
        open_bench(self.out, NAME, {"quick": self.quick, "seeds": self.seeds})

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
                made = result_key(record_touched, judge_touched, profile=profile(PROFILE))
                file = self.out / f"replays-{made}" / f"{cell.name}_{skin.replace(', ', '-').replace(' ', '-')}.json"
                work = partial(judge_touched, cell, skin, self._stream(cell))
                tasks.append(Task(file, work, _REPLAY_COST * duration_s(cell)))
        return tasks

    def every(self) -> list[Task]:
        """Return all work."""
        return [*self.streams(), *self.replays()]

    def _cells(self) -> list[TouchedCell]:
        return touched_cells(self.seeds, self.quick)

    def _stream(self, cell: TouchedCell) -> Path:
        made_by = result_key(record_touched, profile=profile("paper"))
        return self.out / f"streams-{made_by}" / f"{cell.name}.npz"


def run_bench(bench: Bench, progress: Callable[[float], None]) -> list[Row]:
    """Do all that is missing, and return what came out of each replay; a run that was stopped goes on."""
    bench.open()
    replays = bench.replays()
    run_tasks(bench.streams(), bench.out, progress)
    run_tasks(replays, bench.out, progress)
    return read_rows(replays)
