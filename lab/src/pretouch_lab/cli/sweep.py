"""`pretouch sweep`: any parameters of any experiment, with a table, indices and a figure."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from pretouch.errors import ExperimentError

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch_lab.sweep.definition import Sweep as Defined
    from pretouch_lab.sweep.run import Run

_OWN = ("vary", "fix", "design", "metrics", "ranks", "profile", "arms", "name")


@dataclass(frozen=True)
class Sweep:
    """Vary parameters of an experiment, and say which matter: a grid, a Latin hypercube, or Sobol indices.

    A run that was stopped goes on with the same command: each cell leaves one file. Needs the extra `sweep`.
    """

    what: tyro.conf.Positional[str]
    """static, avoidance, dynamic, free-motion or contacts; or `sensitivity`, the sweeps of
    docs/explanation/sensitivity.md; or a TOML file with [[sweep]] tables."""
    vary: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Parameter and range: NAME=LOW:HIGH, NAME=LOW:HIGH:log, or NAME=VALUE,VALUE; for a grid NAME=LOW:HIGH:LEVELS.
    NAME is GROUP.FIELD of the profile, plant.FIELD, plant.kind, plant.world (a set of docs/how-to/sim-to-real.md),
    sensing.FIELD, skin.units or scene.FIELD. Give the option as often as there are parameters."""
    fix: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Parameter that has another value throughout: NAME=VALUE."""
    design: Literal["", "grid", "lhs", "sobol"] = ""
    """grid: all combinations. lhs: a Latin hypercube, with rank correlations. sobol: first-order and total indices. By
    default sobol."""
    samples: int = 0
    """Points of a hypercube; base points of Sobol indices, a power of two, each of which is parameters + 2 cells. By
    default 64; in sweeps from a file no more than this, of arms neither."""
    arms: int = 0
    """Simulated arms; each seed is another one, in another scene. By default 16."""
    metrics: str = ""
    """Numbers that tables and figures show, separated by commas; by default all. The Parquet file has all."""
    ranks: str = ""
    """Numbers whose Sobol indices are to be those of their ranks, separated by commas: where a few are very large."""
    profile: str = ""
    """Profile to start from, or PROFILE:GROUP.FIELD=VALUE; by default the experiment's own."""
    name: str = ""
    """Name of the sweep's folder; by default the experiment's."""
    seeds: Literal["published", "development"] = "development"
    """Which simulated arms: those of the published tables, or others."""
    processes: int = 0
    """Processes of this computer; by default one for each processor."""
    scheduler: str = ""
    """Address of a dask.distributed scheduler, tcp://HOST:PORT, whose workers play the cells. Only one you trust."""
    out: str = ""
    """Folder for everything; by default runs/sweep or runs/sweep-sensitivity."""
    docs: str = ""
    """Folder of documents (docs) whose results/sensitivity.md and images are to be made anew; by default none."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""

    def run(self) -> None:
        """Play what is missing, with tables, indices and figures."""
        from pretouch.cli.writing import numbers_to

        with numbers_to(self.json) as write:
            write(sweep(self))


def sweep(command: Sweep) -> dict[str, Any]:
    """Play what is missing, write and show what came out, and return the indices of each sweep."""
    from rich.console import Console

    from pretouch.cli.tables import show
    from pretouch_lab.documents import SENSITIVITY, around
    from pretouch_lab.sweep.document import publish, tables, written
    from pretouch_lab.sweep.run import opened

    sweeps = defined(command)
    out = Path(command.out or ("runs/sweep-sensitivity" if command.what == "sensitivity" else "runs/sweep"))
    docs = Path(command.docs) if command.docs else None
    if docs:
        for one in sweeps:
            around(docs / SENSITIVITY, one.name)  # an hour later would be late
    runs = [opened(one, out) for one in sweeps]
    for note in (note for run in runs for note in run.notes):
        print(note, file=sys.stderr)
    try:
        _play(runs, command)
    except BaseException:
        for run in runs:
            written(run)
        print(f"Stopped: what was played is kept in {out}; the same command goes on.", file=sys.stderr)
        raise
    console, made = Console(highlight=False), [(run, written(run)) for run in runs]
    for run, about in made:
        show(console, tables(run, about))
    for path in publish(made, out, docs):
        console.print(f"Written: {path}", soft_wrap=True, markup=False)
    for run in runs:
        console.print(f"Numbers: {run.folder / 'results.parquet'} and indices.json", soft_wrap=True, markup=False)
    _say_failures(runs)
    return {run.sweep.name: about for run, about in made}


def defined(command: Sweep) -> "list[Defined]":
    """Return the sweeps a command asks for. Raises an error of this package."""
    from pretouch.cli.words import words
    from pretouch_lab.sweep.definition import SENSITIVITY, Asked, load_sweeps, sensitivity, smaller, sweep_of
    from pretouch_lab.sweep.registry import MEASURES, REMOVED

    if command.processes < 0:
        raise ExperimentError(f"The number of processes is {command.processes}: give 1 or more.")
    if command.samples < 0 or command.arms < 0:
        raise ExperimentError("The numbers of samples and arms have to be positive: leave them out for the defaults.")
    if command.what in MEASURES or command.what in REMOVED:
        given = {key: value for key in ("design", "samples", "arms") if (value := getattr(command, key))}
        asked = Asked(
            command.what, _pairs("vary", command.vary), _pairs("fix", command.fix), command.profile,
            metrics=words(command.metrics), ranks=words(command.ranks), name=command.name, **given,
        )  # fmt: skip
        return [sweep_of(asked, command.seeds)]
    for option in _OWN:
        if getattr(command, option):
            raise ExperimentError(f"--{option} goes with an experiment, not with {command.what}: change a copy of it.")
    named = command.what == SENSITIVITY
    found = sensitivity(command.seeds) if named else load_sweeps(Path(command.what), command.seeds)
    return [smaller(one, command.samples) for one in found] if command.samples else found


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


def _play(runs: "list[Run]", command: Sweep) -> None:
    """Play all sweeps one after the other, with one bar: how far all are, and how long that still takes."""
    import os

    from rich.console import Console

    from pretouch_lab.cli.progress import bar
    from pretouch_lab.sweep.run import Where, play

    console, where = Console(stderr=True), Where(command.processes, command.scheduler)
    total, left = sum(run.cost_s for run in runs), sum(job.cost_s for run in runs for job in run.jobs)
    wanted, count = sum(len(run.wanted) for run in runs), command.processes or os.cpu_count() or 1
    who = f"the cluster {command.scheduler}" if command.scheduler else f"{count} processes"
    console.print(
        f"{wanted} cells to play, about {left / 60:.1f} min of a processor, on {who}.", highlight=False, markup=False
    )
    with bar(console, "sweep", total, total - left) as advance:
        for run in runs:
            advance(0.0, run.sweep.name)
            play(run, where, lambda cost, name=run.sweep.name: advance(cost, name))  # type: ignore[misc]


def _say_failures(runs: "list[Run]") -> None:
    """Say which cells failed, and why."""
    for run in runs:
        reasons: dict[str, int] = {}
        for _, result in run.failed:
            reasons[result.reason] = reasons.get(result.reason, 0) + 1
        for reason, count in reasons.items():
            print(
                f"{count} cells of {run.sweep.name} failed: {reason} The same command tries them again.",
                file=sys.stderr,
            )
