"""`pretouch bench detection`: detectors held against each other, with tables, figures and numbers."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.cli.bench_options import BenchOptions
from pretouch.errors import PretouchError

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch.experiments.bench.detection.campaign import Rows
    from pretouch.experiments.bench.store import Row


@dataclass(frozen=True)
class Detection(BenchOptions):
    """Hold contact detectors against each other: delay against false alarms, what they miss, forces on a board.

    About an hour on two processors, with --quick five minutes. A run that was stopped goes on with the same --out.
    """

    json: str = ""
    """File for the numbers; by default results.json in the folder."""


def bench_detection(command: Detection) -> None:
    """Run what is missing, and show, write and draw what came out."""
    from pretouch.cli.bench_progress import worked
    from pretouch.cli.writing import check_writable, unwritable_said
    from pretouch.experiments.bench.detection.campaign import NAME, Bench, run_bench
    from pretouch.experiments.bench.detection.published import summary_of
    from pretouch.experiments.bench.documents import DOCUMENT, around
    from pretouch.experiments.worlds import sentence
    from pretouch.whole_file import write_json

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
    from pretouch.experiments.bench.detection.published import pictures, publish
    from pretouch.experiments.bench.detection.tables import detection_tables

    console = Console(highlight=False)
    show(console, detection_tables(results))
    console.print(results["resolution"], soft_wrap=True, markup=False)
    for path in publish(results, pictures(results, rows), out, docs):
        console.print(f"Written: {path}", soft_wrap=True, markup=False)
