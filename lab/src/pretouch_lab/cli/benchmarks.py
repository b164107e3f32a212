"""`pretouch bench detection`, `avoidance`, `localization`, `shield` and `both`: their docstrings are the help."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from pretouch.cli.options import JsonFile, Words
from pretouch.errors import PretouchError

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch_lab.benchmarks.bench import Bench


@dataclass(frozen=True)
class BenchOptions:
    """Options of the benchmarks that are published."""

    quick: bool = False
    """A small part of it; it says what it cannot tell."""
    seeds: Literal["published", "development"] = "published"
    """Which simulated arms: those of the published tables, or others to develop with."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, of which each trial's seed
    draws its own; by default the arms of the published tables. Results of a world are kept in a folder of its own."""
    out: str = ""
    """Folder for results and tables; by default runs/bench or runs/bench-NAME, with -quick if it is."""

    def folder(self, name: str) -> Path:
        """Where the results go; `name` is that under runs/."""
        from pretouch_lab.domain_randomisation import folder_part

        return Path(self.out or f"runs/{name}{folder_part(self.world)}{'-quick' if self.quick else ''}")


@dataclass(frozen=True)
class Detection(BenchOptions):
    """Hold contact detectors against each other: delay against false alarms, what they miss, forces on a board.

    About an hour on two processors, with --quick five minutes. A run that was stopped goes on with the same --out.
    """

    json: str = ""
    """File for the numbers; by default results.json in the folder. -: also to standard output, and
    text to standard error."""

    def run(self) -> None:
        """Run it, with tables and numbers."""
        from pretouch_lab.benchmarks.detection.campaign import DetectionBench

        run_bench(DetectionBench(self.folder("bench-detection"), self.quick, self.seeds, self.world), self.json)


@dataclass(frozen=True)
class Avoidance(BenchOptions):
    """How near arms come to people and objects, with what forces, and what it costs to keep clear of them.

    About half an hour on two processors, with --quick three minutes. A run that was stopped goes on with the same
    --out.
    """

    json: str = ""
    """File for the numbers, with a row for each baseline and scenario; by default results.json in the folder.
    -: also to standard output, and text to standard error."""
    baselines: Annotated[Words, tyro.conf.arg(aliases=["--contenders"])] = ()
    """Baselines, separated by commas: blind, flacco, flacco-surface, ding, ding-near, paper, paper-off, or any
    profile; by default all, and pretouch with each switch off alone."""
    scenarios: Words = ()
    """Scenarios, separated by commas; by default all."""
    arm: str = "panda"
    """Name of an arm, or the folder of an imported one, in a folder of results of its own: give --out. The scenarios'
    paths and obstacles are scaled and moved into its reach, and the skin is the arm's own."""

    def run(self) -> None:
        """Run it, with tables and numbers."""
        from pretouch.sim.plant_params import assumed_plant
        from pretouch_lab.benchmarks.avoidance.run import AvoidanceBench
        from pretouch_lab.benchmarks.avoidance.setting import PANDA, arm, place

        out, some = self.folder("bench-avoidance"), (self.baselines, self.scenarios)
        bench = AvoidanceBench(out, self.quick, self.seeds, self.world, *some, self.arm)
        if self.arm != PANDA:
            described = arm(self.arm).description
            print(place(self.arm).sentence(described.name), assumed_plant(described), sep="\n")
        run_bench(bench, self.json)


@dataclass(frozen=True)
class Localization(BenchOptions):
    """Hold where contacts are said to be against where they are: links, places, two at once; with skins and without.

    About twenty minutes on two processors, with --quick three. A run that was stopped goes on with the same --out.
    """

    json: str = ""
    """File for the numbers; by default results.json in the folder. -: also to standard output, and
    text to standard error."""

    def run(self) -> None:
        """Run it, with tables and numbers."""
        from pretouch_lab.benchmarks.localization.campaign import LocalizationBench

        out = self.folder("bench-localization")
        run_bench(LocalizationBench(out, self.quick, self.seeds, self.world), self.json)


@dataclass(frozen=True)
class Shield(BenchOptions):
    """Hold filters between a commander and the arm against each other: what holds whoever commands, and what it costs.

    Wild commanders, and such as drive at a person on purpose. About twenty-five minutes on two processors, with
    --quick two. A run that was stopped goes on with the same --out.
    """

    json: str = ""
    """File for the numbers, with a row for each filter and commander; by default results.json in the folder.
    -: also to standard output, and text to standard error."""

    def run(self) -> None:
        """Run it, with tables and numbers."""
        from pretouch_lab.benchmarks.shield.run import ShieldBench

        run_bench(ShieldBench(self.folder("bench-shield"), self.quick, self.seeds, self.world), self.json)


@dataclass(frozen=True)
class Both(BenchOptions):
    """Run the benchmarks detection and avoidance, and say which goals were reached.

    About an hour and a half on two processors, with --quick ten minutes. A run that was stopped goes on with the same
    --out.
    """

    json: JsonFile = None

    def run(self) -> None:
        """Run both, with tables and numbers."""
        from pretouch.cli.writing import numbers_to

        with numbers_to(self.json) as write:
            write(run_both(self))


def run_bench(bench: "Bench", json: str) -> None:
    """Run what is missing of a benchmark, and show and write what came out."""
    bench.open()
    with results_to(json, bench.out) as (json_file, write):
        _play(bench, json_file)
        write(_report(bench, json_file))


@contextmanager
def results_to(json: str, folder: Path) -> Iterator[tuple[Path, Callable[[Any], None]]]:
    """Give the file for the results, results.json in a folder unless --json names one, and what writes them for '-'."""
    from pretouch.cli.writing import STANDARD_OUTPUT, numbers_to

    printed = json == STANDARD_OUTPUT
    with numbers_to(json if printed else "") as write:
        yield Path(json) if json and not printed else folder / "results.json", write


def _play(bench: "Bench", json_file: Path) -> None:
    from pretouch.cli.writing import check_writable
    from pretouch_lab.cli.progress import worked
    from pretouch_lab.domain_randomisation import sentence
    from pretouch_lab.engine import missing

    if bench.world:
        print(sentence(bench.world))
    check_writable("file", json_file)
    tasks = bench.every()
    try:
        worked(bench.name, tasks, bench.run)
    except BaseException as error:
        if not isinstance(error, PretouchError):
            done = f"{len(tasks) - len(missing(tasks))} of {len(tasks)} pieces of work are there"
            print(f"Stopped: {done}; the same command with --out {bench.out} goes on.", file=sys.stderr)
        raise


def _report(bench: "Bench", json_file: Path) -> Any:
    """Show and write what was found, and return its numbers; None where there are none yet."""
    from rich.console import Console

    from pretouch.atomic_write import write_json
    from pretouch.cli.tables import show
    from pretouch.cli.writing import unwritable_said

    found, tables_file = bench.found(), bench.out / "tables.md"
    if found is None:
        return None
    with unwritable_said("file", json_file):
        write_json(found.json, json_file)
    with unwritable_said("file", tables_file):
        tables_file.write_text(found.page(), encoding="utf-8")
    console = Console(highlight=False)
    show(console, found.tables)
    if found.resolution:
        console.print(found.resolution, soft_wrap=True, markup=False)
    for place in (json_file, tables_file):
        console.print(f"Written: {place}", soft_wrap=True, markup=False)
    return found.json


def run_both(command: Both) -> dict[str, Any]:
    """Run what is missing of both, show what came out of them together, and return the numbers."""
    import json

    from rich.console import Console

    from pretouch.cli.tables import show
    from pretouch.cli.writing import unwritable_said
    from pretouch.text_table import markdown
    from pretouch_lab.benchmarks.front import front_table
    from pretouch_lab.benchmarks.goals import goal_table

    out = command.folder("bench")
    given = {"quick": command.quick, "seeds": command.seeds, "world": command.world}
    Detection(out=str(out / "detection"), **given).run()  # type: ignore[arg-type]  # of both the same
    Avoidance(out=str(out / "avoidance"), **given).run()  # type: ignore[arg-type]
    detection, avoidance = (
        json.loads((out / name / "results.json").read_text(encoding="utf-8")) for name in ("detection", "avoidance")
    )
    made = [goal_table(detection, avoidance), front_table(detection, avoidance)]
    show(Console(highlight=False), made)
    tables_file = out / "tables.md"
    with unwritable_said("file", tables_file):
        tables_file.write_text("\n\n".join(map(markdown, made)) + "\n", encoding="utf-8")
    print(f"Written: {tables_file}")
    return {"detection": detection, "avoidance": avoidance}
