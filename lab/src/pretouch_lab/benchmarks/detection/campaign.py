"""All work of the detection benchmark: streams to record, detectors to replay on them."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import ClassVar

from pretouch_lab.baselines.detection import BASELINES, Baseline, ablated
from pretouch_lab.benchmarks.bench import Bench, Found, said
from pretouch_lab.benchmarks.detection.contacts import ContactCell, contact_cells, record_contacts
from pretouch_lab.benchmarks.detection.free import FreeCell, free_cells, record_free, warm_up_s
from pretouch_lab.benchmarks.detection.hard import HardCell, hard_cells, record_hard
from pretouch_lab.benchmarks.detection.judge import judge_contacts, judge_free
from pretouch_lab.benchmarks.detection.results import (
    Rows,
    ablation_rows,
    contact_rows,
    curves,
    free_rows,
    hard_rows,
    resolution,
)
from pretouch_lab.benchmarks.detection.tables import detection_tables
from pretouch_lab.benchmarks.scenario_files import scenario
from pretouch_lab.engine import Task, rows_of
from pretouch_lab.run import Row

_CONTACT_S = 3.5
"""Time a contact takes with the gap after it, about [s]."""
_RECORDING_COST = {"free": 0.085, "contacts": 0.11}
_REPLAY_COST = {"thresholds": 0.003, "fixed": 0.007, "sequential": 0.012}
"""Processor time of a second of simulation, and of one replayed by a detector's method [s]."""
ABLATED_ARMS = 2
"""Arms of each path and neighbour in free motion that ablations are given."""


@dataclass(frozen=True)
class DetectionBench(Bench):
    """The detection benchmark."""

    name: ClassVar[str] = "detection"

    def stages(self) -> list[list[Task]]:
        """Return the streams to record, then what is made of them."""
        return [self.streams(), [*self.free(), *self.contacts(), *self.hard()]]

    def rows(self) -> Rows:
        """Return the rows of what is done."""
        return Rows(rows_of(self.free()), rows_of(self.contacts()), rows_of(self.hard()))

    def found(self) -> Found | None:
        """See `Bench`."""
        rows = self.rows()
        results: Row = {
            "about": self.about(),
            "resolution": resolution(rows),
            "rows": [
                *free_rows(rows, BASELINES), *contact_rows(rows, BASELINES), *hard_rows(rows, BASELINES),
                *ablation_rows(rows),
            ],
            "curves": curves(rows, BASELINES),
        }  # fmt: skip
        text = f"{said(results['about'])} {results['resolution']}"
        return Found(results, detection_tables(results), results["resolution"], text)

    def streams(self) -> list[Task]:
        """Return the streams to record."""
        free = [
            Task(self._stream(cell), partial(record_free, cell), _RECORDING_COST["free"] * _free_s(cell))
            for cell in self._free()
        ]
        touched = [
            Task(self._stream(cell), partial(record_contacts, cell), _RECORDING_COST["contacts"] * _contacts_s(cell))
            for cell in self._contacts()
        ]
        hard = [
            Task(
                self._stream(cell), partial(record_hard, cell, self.quick), _RECORDING_COST["contacts"] * _free_s(cell)
            )
            for cell in self._hard()
        ]
        return free + touched + hard

    def free(self) -> list[Task]:
        """Return the replays on streams of free motion."""
        return [
            Task(
                self._row("free", cell.name, baseline),
                partial(judge_free, cell, baseline, self._stream(cell)),
                _replay_cost(baseline) * _free_s(cell),
            )
            for cell in self._free()
            for baseline in self._replayed(cell)
        ]

    def contacts(self) -> list[Task]:
        """Return the replays on streams with contacts."""
        return [
            Task(
                self._row("contacts", cell.name, baseline),
                partial(judge_contacts, cell, baseline, self._stream(cell)),
                _replay_cost(baseline) * _contacts_s(cell),
            )
            for cell in self._contacts()
            for baseline in self._replayed(cell)
        ]

    def hard(self) -> list[Task]:
        """Return the replays on streams of arms as unkind as real ones."""
        judges = {cell: judge_contacts if cell.near == "touched" else judge_free for cell in self._hard()}
        return [
            Task(
                self._row("hard", cell.name, baseline),
                partial(judge, cell, baseline, self._stream(cell)),
                _replay_cost(baseline) * _free_s(cell),
            )
            for cell, judge in judges.items()
            for baseline in BASELINES
        ]

    def _replayed(self, cell: FreeCell | ContactCell) -> tuple[Baseline, ...]:
        """Return the detectors that are given a cell's stream: ablations only what the goals are about."""
        wanted = cell.kind == "nominal" and cell.speed_m_s == scenario("contacts")["goal"]["speed_m_s"]
        if isinstance(cell, FreeCell):
            same = [c for c in self._free() if (c.kind, c.path, c.speed_m_s, c.near) == _where(cell)]
            wanted = wanted and cell in same[:ABLATED_ARMS]
        else:
            wanted = wanted and cell.sensing == "nominal"
        return (*BASELINES, *ablated()) if wanted else BASELINES

    def _free(self) -> list[FreeCell]:
        return [replace(cell, world=self.world) for cell in free_cells(self.seeds, self.quick)]

    def _contacts(self) -> list[ContactCell]:
        return [replace(cell, world=self.world) for cell in contact_cells(self.seeds, self.quick)]

    def _hard(self) -> list[HardCell]:
        # they have a world of their own: with another they are left out
        return [] if self.world else hard_cells(self.seeds, self.quick)

    def _stream(self, cell: FreeCell | ContactCell | HardCell) -> Path:
        family = {FreeCell: "free", ContactCell: "contacts", HardCell: "hard"}[type(cell)]
        return self.out / "streams" / f"{family}_{cell.name}.npz"

    def _row(self, family: str, cell: str, baseline: Baseline) -> Path:
        return self.out / family / baseline.name.replace(" ", "-") / f"{cell}.json"


def _free_s(cell: FreeCell | HardCell) -> float:
    return warm_up_s() + cell.counted_s


def _contacts_s(cell: ContactCell) -> float:
    return warm_up_s() + _CONTACT_S * cell.count


def _replay_cost(baseline: Baseline) -> float:
    return _REPLAY_COST[baseline.profile.detect.name]


def _where(cell: FreeCell) -> tuple[str, str, float, str]:
    return cell.kind, cell.path, cell.speed_m_s, cell.near
