"""`pretouch sweep`: vary parameters of an experiment, and write a table, indices and a figure."""

import csv
import sys
from collections import Counter
from dataclasses import dataclass, field
from functools import partial

import tyro

from pretouch.errors import ExperimentError
from pretouch_lab.options import Playing, SweepOptions


@dataclass(frozen=True)
class Sweep(Playing, SweepOptions):
    """Vary parameters of an experiment over a grid, or compute their Sobol indices.

    The same command continues a run that was stopped. It needs the extra `sweep`.
    """

    vary: tyro.conf.UseAppendAction[list[str]] = field(default_factory=list)
    """Parameter and range: NAME=LOW:HIGH, NAME=LOW:HIGH:log, or NAME=VALUE,VALUE; for a grid NAME=LOW:HIGH:LEVELS.
    NAME is GROUP.FIELD of the profile, plant.FIELD, plant.kind, plant.world (a set of docs/how-to/sim-to-real.md),
    sensing.FIELD, skin.units or scene.FIELD. Give the option as often as there are parameters."""
    fix: tyro.conf.UseAppendAction[list[str]] = field(default_factory=list)
    """Parameter with a fixed value in all cells: NAME=VALUE."""

    def run(self) -> None:
        """Play the missing cells, and write tables and figure."""
        from pretouch import __version__
        from pretouch.cli.writing import numbers_to, unwritable_said
        from pretouch_lab.cli.playing import begin, played, report
        from pretouch_lab.domain_randomisation import named_set
        from pretouch_lab.sweep import EXPERIMENTS, SWEEP, results_of, sobol_figure, sweep_of, tables, trial

        vary, fix = _pairs("vary", self.vary), _pairs("fix", self.fix)
        sweep = sweep_of(self, vary, fix)
        metrics = self.metrics or EXPERIMENTS[sweep.experiment].metrics
        if wrong := [name for name in metrics if name not in EXPERIMENTS[sweep.experiment].metrics]:
            names = ", ".join(EXPERIMENTS[sweep.experiment].metrics)
            raise ExperimentError(f"{sweep.experiment} does not measure {wrong[0]!r}: choose from {names}.")
        SWEEP.need("A sweep")
        plays, out = sweep.plays(), self.folder("sweep")
        named = {cell["plant.world"] for cell, _ in plays if "plant.world" in cell}
        worlds = {name: named_set(name).digest for name in sorted(named)}
        with numbers_to(self.json) as write:
            begin(self, out, {"sweep": sweep.experiment, "profile": sweep.profile, "worlds_sha256": worlds})
            rows = played("sweep", partial(trial, sweep.experiment, sweep.profile), plays, out, self)
            for reason, count in Counter(row["failed"] for row in rows if row["failed"]).items():
                again = "Remove their lines from rows.jsonl to try again."
                print(f"{count} cells failed: {reason} {again}", file=sys.stderr)
            results, place = results_of(sweep, rows, metrics), out / f"{sweep.experiment}.csv"
            figures = [(sweep.experiment, "Sobol indices", sobol_figure(results))] if sweep.design == "sobol" else []
            report(tables(sweep, results, metrics), figures, out)
            with unwritable_said("file", place), place.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, rows[0])
                writer.writeheader()
                writer.writerows(rows)
            print(f"Cells: {place}")
            about = {"version": __version__, "experiment": sweep.experiment, "profile": sweep.profile}
            write(about | {"vary": vary, "fixed": fix, "results": results})


def _pairs(option: str, texts: list[str]) -> dict[str, str]:
    """Read NAME=TEXT, each name once."""
    pairs: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name in pairs:
            raise ExperimentError(f"--{option} {text} has no value, or names {name} twice: write NAME=VALUE once.")
        pairs[name] = value
    return pairs
