"""`pretouch bench`; `benchmarks` runs each benchmark, and `options` has the options and their help."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from pretouch_lab import options


@dataclass(frozen=True)
class Bench:
    """Run a benchmark: detectors, avoidance of people, places of contacts, or the time of a step."""

    what: (
        Annotated[options.DetectionOptions, tyro.conf.subcommand("detection")]
        | Annotated[options.AvoidanceOptions, tyro.conf.subcommand("avoidance")]
        | Annotated[options.LocalizationOptions, tyro.conf.subcommand("localization")]
        | Annotated[options.ShieldOptions, tyro.conf.subcommand("shield")]
        | Annotated[options.CycleOptions, tyro.conf.subcommand("cycle")]
        | Annotated[options.CalibrationOptions, tyro.conf.subcommand("calibration")]
        | Annotated[options.RealOptions, tyro.conf.subcommand("real")]
    )

    def run(self) -> None:
        """Run the benchmark, and write its numbers to --json."""
        from pretouch.cli.writing import numbers_to
        from pretouch_lab.cli import benchmarks  # heavy packages, which the help does not need

        with numbers_to(self.what.json) as write:
            write(getattr(benchmarks, type(self.what).__name__.removesuffix("Options").lower())(self.what))
