"""`pretouch sweep`: any parameters of an experiment, with a table, indices and a figure."""

import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from pretouch.cli.options import JsonFile, Words
from pretouch.errors import ExperimentError

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch_lab.sweep.play import Run


@dataclass(frozen=True)
class Sweep:
    """Vary parameters of an experiment, and say which matter: over a grid, or by Sobol indices.

    A run that was stopped goes on with the same command. Needs the extra `sweep`.
    """

    experiment: tyro.conf.Positional[str]
    """static, avoidance, dynamic, free-motion or contacts."""
    vary: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Parameter and range: NAME=LOW:HIGH, NAME=LOW:HIGH:log, or NAME=VALUE,VALUE; for a grid NAME=LOW:HIGH:LEVELS.
    NAME is GROUP.FIELD of the profile, plant.FIELD, plant.kind, plant.world (a set of docs/how-to/sim-to-real.md),
    sensing.FIELD, skin.units or scene.FIELD. Give the option as often as there are parameters."""
    fix: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Parameter that has another value throughout: NAME=VALUE."""
    design: Literal["grid", "sobol"] = "sobol"
    """grid: all combinations. sobol: first-order and total indices."""
    samples: int = 64
    """Base points of Sobol indices, a power of two, each of which is parameters + 2 cells."""
    arms: int = 16
    """Simulated arms; each seed is another one, in another scene."""
    metrics: Words = ()
    """Numbers that table and figure show, separated by commas; by default all. The CSV file has all."""
    profile: str = ""
    """Profile to start from, or PROFILE:GROUP.FIELD=VALUE; by default the experiment's own."""
    seeds: Literal["published", "development"] = "development"
    """Which simulated arms: those of the published tables, or others."""
    processes: int = 0
    """Processes; by default one for each processor."""
    out: str = ""
    """Folder for everything; by default runs/sweep."""
    json: JsonFile = None

    def run(self) -> None:
        """Play what is missing, with table, indices and figure."""
        from pretouch.cli.writing import numbers_to

        with numbers_to(self.json) as write:
            write(sweep(self))


def sweep(command: Sweep) -> dict[str, Any]:
    """Play what is missing, write and show what came out, and return the indices."""
    from pretouch_lab.cli.progress import worked
    from pretouch_lab.engine import run_tasks
    from pretouch_lab.sweep.design import sweep_of
    from pretouch_lab.sweep.play import opened

    if command.processes < 0:
        raise ExperimentError(f"The number of processes is {command.processes}: give 1 or more.")
    defined = sweep_of(
        command.experiment, _pairs("vary", command.vary), _pairs("fix", command.fix), command.profile, command.design,
        command.samples, command.arms, command.seeds,
    )  # fmt: skip
    metrics = command.metrics or tuple(defined.measure.metrics)
    unknown = [name for name in metrics if name not in defined.measure.metrics]
    if unknown:
        known = ", ".join(defined.measure.metrics)
        raise ExperimentError(f"{command.experiment} does not measure {unknown[0]!r}: choose from {known}.")
    out = Path(command.out or "runs/sweep")
    run = opened(defined, out)
    try:
        worked("sweep", run.tasks, lambda progress: run_tasks(run.tasks, out, progress, command.processes or None))
    except BaseException:
        print(f"Stopped: what was played is in {out}; the same command goes on.", file=sys.stderr)
        raise
    for reason, count in Counter(run.failures()).items():
        print(f"{count} cells failed: {reason} The same command tries them again.", file=sys.stderr)
    return _written(run, metrics, out)


def _written(run: "Run", metrics: tuple[str, ...], out: Path) -> dict[str, Any]:
    """Show and write what came out; return the indices."""
    from rich.console import Console

    from pretouch import __version__
    from pretouch.atomic_write import write_json
    from pretouch.cli.tables import show
    from pretouch_lab.engine import failure_said
    from pretouch_lab.sweep.figure import sweep_figure
    from pretouch_lab.sweep.indices import indices, tables
    from pretouch_lab.sweep.play import write_table

    console, found = Console(highlight=False), indices(run)
    numbers = {
        "version": __version__, "experiment": run.sweep.measure.name, "profile": run.sweep.profile,
        "vary": {one.name: one.written for one in run.sweep.vary}, "fixed": run.sweep.fixed, "metrics": found,
    }  # fmt: skip
    show(console, tables(run.sweep, found, metrics))
    name = run.sweep.measure.name
    write_table(run, out / f"{name}.csv")
    with failure_said(out):
        write_json(numbers, out / f"{name}.json")
        sweep_figure(run.sweep, found, metrics).savefig(out / f"{name}.png", dpi=120)
    console.print(f"Written: {out / name}.csv, .json and .png", soft_wrap=True, markup=False)
    return numbers


def _pairs(option: str, texts: tuple[str, ...]) -> dict[str, str]:
    """Read NAME=TEXT, each name once."""
    found: dict[str, str] = {}
    for text in texts:
        name, given, value = text.partition("=")
        if not given:
            raise ExperimentError(
                f"--{option} {text} has no value: write NAME={'LOW:HIGH' if option == 'vary' else 'VALUE'}."
            )
        if name in found:
            raise ExperimentError(f"--{option} names {name} twice: give one range or one list of values.")
        found[name] = value
    return found
