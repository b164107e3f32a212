"""What every benchmark is made of: choices, stages of tasks in a folder, and rows."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import ClassVar

from pretouch import __version__
from pretouch.text_table import TextTable, markdown
from pretouch_lab.benchmarks.scenario_files import SeedRange, checksums
from pretouch_lab.domain_randomisation import digest_of
from pretouch_lab.engine import Progress, Task, open_folder, run_tasks
from pretouch_lab.run import Row

EMPTY: Row = dict.fromkeys(
    (
        "contender", "scenario", "seen", "false_alarms_per_hour", "median_delay_s", "p95_delay_s", "missed", "contacts",
        "peak_estimate_n", "true_peak_20ms_n", "first_contact_s", "cycle_time_s",
    )
)  # fmt: skip
"""A row of a benchmark's JSON file, of which nothing is known."""


@dataclass(frozen=True)
class Found:
    """What a run came to: for its JSON file, the terminal, and `tables.md`."""

    json: Row
    tables: list[TextTable]
    resolution: str
    """What its numbers can tell, in a sentence."""
    text: str
    """What stands above the tables in the file."""

    def page(self) -> str:
        """Return text and tables as Markdown."""
        return "\n\n".join([self.text, *map(markdown, self.tables)]) + "\n"


@dataclass(frozen=True)
class Bench(ABC):
    """What of a benchmark is run, and where."""

    name: ClassVar[str]

    out: Path
    """Folder for everything that is kept."""
    quick: bool = False
    seeds: SeedRange = "published"
    world: str = ""
    """Set of the domain randomisation of which each seed draws its own, or none: the arms of the published tables."""

    @abstractmethod
    def stages(self) -> list[list[Task]]:
        """Return all work: what a stage needs was made by those before it."""

    @abstractmethod
    def found(self) -> Found | None:
        """Return what all tasks that are done came to, None if none is."""

    def choices(self) -> Row:
        """Return what all runs that share a folder have in common."""
        return {"quick": self.quick, "seeds": self.seeds, "world": self.world}

    def open(self) -> None:
        """Make the folder, or take it up where a run with the same choices began it."""
        scenarios = sha256(repr(sorted(checksums().items())).encode()).hexdigest()
        digests = {"the scenario files have": scenarios} | digest_of(self.world)
        open_folder(self.out, {"bench": self.name, **self.choices()}, digests)

    def every(self) -> list[Task]:
        """Return all work in one list."""
        return [task for stage in self.stages() for task in stage]

    def run(self, progress: Progress, processes: int | None = None) -> None:
        """Do all that is missing; however it ends, what is finished stays in the folder."""
        self.open()
        for stage in self.stages():
            run_tasks(stage, self.out, progress, processes)

    def about(self) -> Row:
        """Return what the JSON file of its results says of the run."""
        world = {"world": self.world} if self.world else {}
        return {"bench": self.name, "version": __version__, "quick": self.quick, "seeds": self.seeds, **world}


def said(about: Row) -> str:
    """Say which version and seeds the numbers are of."""
    return f"Version {about['version']}, {about['seeds']} seeds, {'quick' if about['quick'] else 'full'} run."
