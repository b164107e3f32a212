"""`pretouch bench real`: the detectors on public recordings of real arms."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from pretouch.cli.options import JsonFile, Words


@dataclass(frozen=True)
class Real:
    """Contact detectors on public recordings of real arms, which you download: false alarms, contacts, delays, links.

    One half of each set's recordings says what load, offsets and friction the arm has, the other is judged; then the
    other way round. docs/explanation/benchmarks.md tells how the folder is laid out.
    """

    folder: tyro.conf.Positional[Path]
    """Of the sets, each by its name, with `arms` as `pretouch robot import` wrote them."""
    detectors: Words = ()
    """Profiles, separated by commas; by default fixed, observer, paper and pretouch."""
    json: JsonFile = None

    def run(self) -> None:
        """Play what is there, with tables and rows."""
        bench_real(self)


def bench_real(command: Real) -> None:
    """Play each detector on each set in processes, show tables, and write the rows."""
    from rich.console import Console

    from pretouch.cli.tables import show
    from pretouch.cli.writing import numbers_to
    from pretouch.profiles import profile
    from pretouch_lab.benchmarks.real.bench import DETECTORS, Work, play, tables_of
    from pretouch_lab.benchmarks.real.sets import sets_in
    from pretouch_lab.cli.progress import bar
    from pretouch_lab.engine import run_jobs

    detectors = command.detectors or DETECTORS
    for name in detectors:
        profile(name)  # an hour later would be late
    sets, missing = sets_in(command.folder)
    works = [Work(command.folder, each.name, name) for each in sets for name in detectors]
    rows: dict[Work, Any] = {}
    with numbers_to(command.json) as write:
        for sentence in missing:
            print(sentence, file=sys.stderr)
        with bar(Console(stderr=True), "recordings", len(works)) as advance:

            def done(work: Work, found: Any) -> None:
                rows[work] = found
                advance(1, "recordings")

            run_jobs(works, play, None, done)
        found = [row for work in works for row in rows[work]]
        show(Console(highlight=False), tables_of(found))
        write({"sets": {each.name: each.source for each in sets}, "left_out": missing, "rows": found})
