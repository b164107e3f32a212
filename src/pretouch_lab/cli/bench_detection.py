"""`pretouch bench detection`: detectors held against each other, with tables, figures and numbers."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.errors import PretouchError
from pretouch_lab.cli.bench_options import BenchOptions

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch_lab.benchmarks.detection.campaign import Rows
    from pretouch_lab.benchmarks.store import Row


@dataclass(frozen=True)
class Detection(BenchOptions):
    """Hold contact detectors against each other: delay against false alarms, what they miss, forces on a board.

    About an hour on two processors, with --quick five minutes. A run that was stopped goes on with the same --out.
    """

    json: str = ""
    """File for the numbers; by default results.json in the folder."""

    def run(self) -> None:
        """Run it, with tables, figures and numbers."""
        bench_detection(self)


def bench_detection(command: Detection) -> None:
    """Run what is missing, and show, write and draw what came out."""
    from pretouch.atomic_write import write_json
    from pretouch.cli.writing import check_writable, unwritable_said
    from pretouch_lab.benchmarks.detection.campaign import NAME, Bench, run_bench
    from pretouch_lab.benchmarks.detection.published import summary_of
    from pretouch_lab.benchmarks.documents import DOCUMENT, around
    from pretouch_lab.cli.bench_progress import worked
    from pretouch_lab.worlds import sentence

    out, docs = command.folder("bench-detection"), command.documents
    json_file = Path(command.json) if command.json else out / "results.json"
    if docs:
        around(docs / DOCUMENT, NAME)  # an hour later would be late
    bench = Bench(out, command.quick, command.seeds, command.world)
    bench.open()
    if command.world:
        print(sentence(command.world))
    check_writable("file", json_file)
    try:
        rows = worked(NAME, bench.every(), lambda progress: run_bench(bench, progress))
    except PretouchError:
        raise
    except BaseException:
        print(f"Stopped: the same command with --out {out} goes on.", file=sys.stderr)
        raise
    results = summary_of(bench, rows)
    with unwritable_said("file", json_file):
        write_json(results, json_file)
    _say(results, rows, out, docs)
    print(f"Numbers: {json_file}")


def _say(results: "Row", rows: "Rows", out: Path, docs: Path | None) -> None:
    from rich.console import Console

    from pretouch.cli.tables import show
    from pretouch_lab.benchmarks.detection.published import pictures, publish
    from pretouch_lab.benchmarks.detection.tables import detection_tables

    console = Console(highlight=False)
    show(console, detection_tables(results))
    console.print(results["resolution"], soft_wrap=True, markup=False)
    for path in publish(results, pictures(results, rows), out, docs):
        console.print(f"Written: {path}", soft_wrap=True, markup=False)
