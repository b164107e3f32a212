"""`pretouch bench avoidance`: ways to keep clear of people and objects, with tables, figures, rows and document."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.cli.words import words
from pretouch_lab.cli.bench_options import BenchOptions

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch_lab.benchmarks.avoidance.run import Request


@dataclass(frozen=True)
class Avoidance(BenchOptions):
    """How near arms come to people and objects, with what forces, and what it costs to keep clear of them.

    About half an hour on two processors, with --quick three minutes. A run that was stopped goes on with the same
    --out.
    """

    json: str = ""
    """File for the numbers, with a row for each contender and scenario; by default results.json in the folder."""
    contenders: str = ""
    """Contenders, separated by commas: blind, flacco, flacco-surface, ding, ding-near, paper, paper-off, or any
    profile; by default all, and pretouch with each switch off alone."""
    scenarios: str = ""
    """Scenarios, separated by commas; by default all."""

    def run(self) -> None:
        """Run it, with tables, figures and numbers."""
        bench_avoidance(self)


def bench_avoidance(command: Avoidance) -> None:
    """Play what is missing and show what came out; what was finished before an interruption is shown and kept too."""
    from pretouch.cli.writing import check_writable
    from pretouch_lab.benchmarks.avoidance.run import NAME, Request, open_run, run
    from pretouch_lab.benchmarks.documents import DOCUMENT, around
    from pretouch_lab.cli.bench_progress import worked
    from pretouch_lab.worlds import sentence

    c = command
    request = Request(words(c.contenders), c.quick, c.seeds, words(c.scenarios), c.world)
    out, docs = c.folder("bench-avoidance"), c.documents
    json_file = Path(c.json) if c.json else out / "results.json"
    if docs:
        around(docs / DOCUMENT, NAME)  # half an hour later would be late
    open_run(request, out)
    if c.world:
        print(sentence(c.world))
    check_writable("file", json_file)
    try:
        worked(NAME, request.tasks(out), lambda progress: run(request, out, progress))
    finally:
        _report(request, out, json_file, docs)


def _report(request: "Request", out: Path, json_file: Path, docs: Path | None) -> None:
    from rich.console import Console

    from pretouch.atomic_write import write_json
    from pretouch.cli.tables import show
    from pretouch.cli.writing import unwritable_said
    from pretouch_lab.benchmarks.avoidance.figures import figures
    from pretouch_lab.benchmarks.avoidance.page import publish
    from pretouch_lab.benchmarks.avoidance.run import rows_of
    from pretouch_lab.benchmarks.avoidance.summary import results, summarise
    from pretouch_lab.benchmarks.avoidance.tables import tables

    rows, asked = rows_of(request, out), len(request.tasks(out))
    if not rows:
        return
    summary = summarise(rows)
    with unwritable_said("file", json_file):
        write_json(results(summary, request.seeds, request.quick, request.world), json_file)
    console = Console(highlight=False)
    show(console, tables(summary))
    with unwritable_said("folder", docs or out):
        places = publish(summary, figures(summary, rows), request.seeds, out, docs)
    trials = [cell["trials"] for cell in summary["cells"]]
    console.print(f"Resolution: {min(trials)} to {max(trials)} trials a cell, {request.seeds} seeds.", markup=False)
    for place in (json_file, *places):
        console.print(f"Written: {place}", soft_wrap=True, markup=False)
    if len(rows) < asked:
        print(f"Stopped: {len(rows)} of {asked} trials are in {out}; the same command goes on.", file=sys.stderr)
