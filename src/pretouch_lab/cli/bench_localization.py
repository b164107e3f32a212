"""`pretouch bench localization`: where contacts are said to be, with tables and numbers."""

import sys
from dataclasses import dataclass
from pathlib import Path

from pretouch.errors import PretouchError
from pretouch_lab.cli.bench_options import BenchOptions


@dataclass(frozen=True)
class Localization(BenchOptions):
    """Hold where contacts are said to be against where they are: links, places, two at once; with skins and without.

    About twenty minutes on two processors, with --quick three. A run that was stopped goes on with the same --out.
    """

    docs: str = ""
    """Folder of documents (docs) whose results/localization.md is to be made anew; by default none."""
    json: str = ""
    """File for the numbers; by default results.json in the folder."""

    def run(self) -> None:
        """Run it, with tables and numbers."""
        bench_localization(self)


def bench_localization(command: Localization) -> None:
    """Run what is missing, and show and write what came out."""
    from rich.console import Console

    from pretouch.atomic_write import write_json
    from pretouch.cli.tables import show
    from pretouch.cli.writing import check_writable, unwritable_said
    from pretouch_lab.benchmarks.documents import around
    from pretouch_lab.benchmarks.localization.campaign import NAME, Bench, run_bench
    from pretouch_lab.benchmarks.localization.published import DOCUMENT, publish
    from pretouch_lab.benchmarks.localization.results import summary_of, tables_of
    from pretouch_lab.cli.bench_progress import worked

    out, docs = command.folder("bench-localization"), command.documents
    json_file = Path(command.json) if command.json else out / "results.json"
    if docs:
        around(docs / DOCUMENT, NAME)
    bench = Bench(out, command.quick, command.seeds)
    bench.open()
    check_writable("file", json_file)
    try:
        replays = worked(NAME, bench.every(), lambda progress: run_bench(bench, progress))
    except PretouchError:
        raise
    except BaseException:
        print(f"Stopped: the same command with --out {out} goes on.", file=sys.stderr)
        raise
    results = summary_of(bench, replays)
    with unwritable_said("file", json_file):
        write_json(results, json_file)
    console = Console(highlight=False)
    show(console, tables_of(results))
    if docs:
        console.print(f"Written: {publish(results, docs)}", soft_wrap=True, markup=False)
    print(f"Numbers: {json_file}")
