"""`pretouch sweep`: any parameters of an experiment, with a table, indices and a figure."""

import csv
import sys
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from pretouch.cli.options import Words
from pretouch.errors import ExperimentError
from pretouch_lab.options import Playing

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch_lab.sweep.design import Point
    from pretouch_lab.sweep.design import Sweep as Defined


@dataclass(frozen=True)
class Sweep(Playing):
    """Vary parameters of an experiment, and say which matter: over a grid, or by Sobol indices.

    A run that was stopped goes on with the same command. Needs the extra `sweep`.
    """

    experiment: tyro.conf.Positional[str] = tyro.MISSING
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

    def run(self) -> None:
        """Play what is missing, with table, indices and figure."""
        from pretouch.cli.writing import numbers_to

        with numbers_to(self.json) as write:
            write(sweep(self))


def sweep(command: Sweep) -> dict[str, Any]:
    """Play what is missing, write and show what came out, and return the indices."""
    from pretouch_lab.cli.playing import check_json, played
    from pretouch_lab.run import open_run
    from pretouch_lab.sweep.design import SWEEP, groups, points, sweep_of, trial, values_of

    defined = sweep_of(
        command.experiment, _placed(command, "vary", command.vary), _placed(command, "fix", command.fix),
        command.profile, command.design, command.samples, command.arms, command.seeds,
    )  # fmt: skip
    metrics = command.metrics or tuple(defined.measure.metrics)
    unknown = [name for name in metrics if name not in defined.measure.metrics]
    if unknown:
        known = ", ".join(defined.measure.metrics)
        raise ExperimentError(f"{command.experiment} does not measure {unknown[0]!r}: choose from {known}.")
    SWEEP.need("A sweep")
    out, design = command.folder("sweep"), points(defined)
    grouped = groups(defined, design)
    check_json(command, [out])
    open_run(out, {"sweep": command.experiment, "profile": defined.profile})
    play = partial(trial, command.experiment, defined.profile)
    rows = played("sweep", play, [each for _, each in grouped], out, command)
    for reason, count in Counter(row["failed"] for row in rows if row["failed"]).items():
        print(f"{count} cells failed: {reason} Take their lines out of rows.jsonl to try again.", file=sys.stderr)
    values = values_of(defined, len(design), zip(grouped, rows, strict=True))
    return _written(defined, design, values, metrics, out)


def _written(
    sweep: "Defined", design: "list[Point]", values: dict[str, Any], metrics: tuple[str, ...], out: Path
) -> dict[str, Any]:
    """Show and write what came out; return the indices."""
    from pretouch import __version__
    from pretouch.cli.writing import unwritable_said
    from pretouch_lab.cli.playing import report
    from pretouch_lab.sweep.analysis import indices, sweep_figure, tables
    from pretouch_lab.sweep.design import SEED

    found, name = indices(sweep, design, values), sweep.measure.name
    report(tables(sweep, found, metrics), [(name, sweep.measure.text, sweep_figure(sweep, found, metrics))], out)
    place = out / f"{name}.csv"
    with unwritable_said("file", place), place.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*(one.name for one in sweep.vary), SEED, *values])
        for number, point in enumerate(design):
            numbers = (column[number] for column in values.values())
            writer.writerow([*point.values.values(), point.seed, *("" if n != n else n for n in numbers)])
    print(f"Points: {place}")
    return {
        "version": __version__,
        "experiment": name,
        "profile": sweep.profile,
        "vary": {one.name: one.written for one in sweep.vary},
        "fixed": sweep.fixed,
        "metrics": found,
    }


def _placed(command: Sweep, option: str, texts: tuple[str, ...]) -> dict[str, str]:
    """Read NAME=TEXT, with files of worlds as workers may read them."""
    from pretouch_lab.sweep.parameters import USUAL_WORLD, WORLD

    pairs = _pairs(option, texts)
    if WORLD in pairs:
        names = pairs[WORLD].split(",")
        pairs[WORLD] = ",".join(name if name == USUAL_WORLD else command.input(name) for name in names)
    return pairs


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
