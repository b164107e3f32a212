"""`pretouch bench detection`, `avoidance`, `localization`, `shield` and `both`: their docstrings are the help."""

from dataclasses import dataclass, fields
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from pretouch.cli.options import Words
from pretouch.errors import ExperimentError
from pretouch_lab.options import Playing


@dataclass(frozen=True)
class BenchOptions(Playing):
    """Options of the benchmarks that are published."""

    quick: bool = False
    """A small part of it; it says what it cannot tell."""
    seeds: Literal["published", "development"] = "published"
    """Which simulated arms: those of the published tables, or others to develop with."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, of which each trial's seed
    draws its own; by default the arms of the published tables. Results of a world are kept in a folder of its own."""

    def folder(self, name: str) -> Path:
        """Return where the results go."""
        from pretouch_lab.domain_randomisation import folder_part

        return super().folder(f"{name}{folder_part(self.world)}{'-quick' if self.quick else ''}")

    def about(self, name: str) -> dict[str, Any]:
        """Return what the numbers say of the run."""
        from pretouch import __version__

        world = {"world": self.world} if self.world else {}
        return {"bench": name, "version": __version__, "quick": self.quick, "seeds": self.seeds, **world}

    def below(self, kind: "type[BenchOptions]", folder: Path) -> Any:
        """Return the options of another benchmark, whose results go below a folder."""
        shared = {each.name: getattr(self, each.name) for each in fields(BenchOptions)}
        return kind(**shared | {"out": str(folder), "json": None})

    def run(self) -> None:
        """Play what is missing, and show and write what came out."""
        from pretouch.cli.writing import numbers_to

        with numbers_to(self.json) as write:
            write(self.results())

    def results(self) -> dict[str, Any]:
        """Play what is missing, show tables, write them, and return the numbers."""
        raise NotImplementedError


def begin(options: BenchOptions, name: str, out: Path, **more: Any) -> None:
    """Make a folder for a benchmark's results, or take up one that a run with the same options began."""
    from pretouch.sim.randomisation import world_set
    from pretouch_lab.bench.scenes import checksums
    from pretouch_lab.cli.playing import check_json
    from pretouch_lab.domain_randomisation import sentence
    from pretouch_lab.run import open_run

    world = {"world_sha256": world_set(options.world).digest} if options.world else {}
    scenarios = sha256(repr(sorted(checksums().items())).encode()).hexdigest()
    check_json(options, [out, out / "streams"])
    shared = {"bench": name, "seeds": options.seeds, "world": options.world, "scenarios_sha256": scenarios}
    open_run(out, shared | world | more)
    if options.world:
        print(sentence(options.world))


def _finish(out: Path, about: dict[str, Any], tables: list[Any], text: str, **numbers: Any) -> dict[str, Any]:
    """Show tables and write them with a text; return the numbers."""
    from pretouch_lab.cli.playing import report

    kind = "quick" if about["quick"] else "full"
    report(tables, [], out, f"Version {about['version']}, {about['seeds']} seeds, {kind} run. {text}\n")
    return {"about": about, **numbers, "tables": tables}


@dataclass(frozen=True)
class Detection(BenchOptions):
    """Hold contact detectors against each other: delay against false alarms, what they miss, forces on a board.

    About an hour on two processors, with --quick five minutes. A run that was stopped goes on with the same --out.
    """

    def results(self) -> dict[str, Any]:
        """See `BenchOptions`."""
        from pretouch_lab.bench import detection
        from pretouch_lab.bench.detection_results import results
        from pretouch_lab.bench.detection_tables import tables
        from pretouch_lab.cli.playing import played

        out = self.folder("bench-detection")
        begin(self, "detection", out, quick=self.quick)
        which = self.seeds, self.quick, self.input(self.world)
        rows = played("detection", partial(detection.trial, *which), detection.plays(detection.arms(*which)), out, self)
        numbers = results(detection.rows_of(rows))
        return _finish(out, self.about("detection"), tables(numbers), numbers["resolution"], **numbers)


@dataclass(frozen=True)
class Avoidance(BenchOptions):
    """How near arms come to people and objects, with what forces, and what it costs to keep clear of them.

    About half an hour on two processors, with --quick three minutes. A run that was stopped goes on with the same
    --out.
    """

    baselines: Annotated[Words, tyro.conf.arg(aliases=["--contenders"])] = ()
    """Baselines, separated by commas: blind, flacco, flacco-surface, ding, ding-near, paper, paper-off, or any
    profile; by default all, and pretouch with each switch off alone."""
    scenarios: Words = ()
    """Scenarios, separated by commas; by default all."""
    arm: str = "panda"
    """Name of an arm, or the folder of an imported one, in a folder of results of its own: give --out. The scenarios'
    paths and obstacles are scaled into its reach, and the skin is the arm's own."""

    def results(self) -> dict[str, Any]:
        """See `BenchOptions`."""
        from pretouch.robot.description import files_digest
        from pretouch.sim.plant_params import assumed_plant
        from pretouch_lab.bench import avoidance
        from pretouch_lab.bench.avoidance import tables
        from pretouch_lab.bench.avoidance_scenes import PANDA, arm, place
        from pretouch_lab.cli.playing import played

        plays = avoidance.plays(self.seeds, self.quick, self.baselines, self.scenarios)
        out, other = self.folder("bench-avoidance"), {}
        if self.arm != PANDA:
            described = arm(self.arm).description
            other = {"arm": self.arm, "arm_sha256": files_digest(described)}
            print(place(self.arm).sentence(described.name), assumed_plant(described), sep="\n")
        begin(self, "avoidance", out, **other)  # a quick run shares its trials with a full one
        rows = played(
            "avoidance", partial(avoidance.trial, self.input(self.world), self.input(self.arm)), plays, out, self
        )
        summary = avoidance.summarise(rows)
        cells = summary.pop("cells")
        counts = [cell["trials"] for cell in cells]
        text = f"{min(counts)} to {max(counts)} trials of each contender in each scenario."
        shown = tables({"cells": cells, **summary})
        return _finish(out, self.about("avoidance"), shown, text, rows=cells, **summary)


@dataclass(frozen=True)
class Localization(BenchOptions):
    """Hold where contacts are said to be against where they are: links, places, two at once; with skins and without.

    About twenty minutes on two processors, with --quick three. A run that was stopped goes on with the same --out.
    """

    def results(self) -> dict[str, Any]:
        """See `BenchOptions`."""
        from pretouch_lab.bench import localization
        from pretouch_lab.cli.playing import played

        if self.world:
            raise ExperimentError(f"The arm of this benchmark is the usual one: leave out --world {self.world}.")
        out = self.folder("bench-localization")
        begin(self, "localization", out)
        streams = localization.stream_plays(self.seeds, self.quick)
        played("recording streams", partial(localization.record_stream, out), streams, out / "streams", self)
        rows = played("replaying them", partial(localization.trial, out), localization.plays(streams), out, self)
        found = localization.results(rows)
        return _finish(out, self.about("localization"), localization.tables(found), "", rows=found)


@dataclass(frozen=True)
class Shield(BenchOptions):
    """Hold filters between a commander and the arm against each other: what holds whoever commands, and what it costs.

    About ten minutes on two processors, with --quick one. A run that was stopped goes on with the same --out.
    """

    def results(self) -> dict[str, Any]:
        """See `BenchOptions`."""
        from pretouch_lab.bench import shield
        from pretouch_lab.cli.playing import played

        if self.world:
            raise ExperimentError(f"The arms of this benchmark are the usual ones: leave out --world {self.world}.")
        out = self.folder("bench-shield")
        begin(self, "shield", out)
        found = shield.results(played("shield", shield.trial, shield.plays(self.seeds, self.quick), out, self))
        return _finish(out, self.about("shield"), shield.tables(found), "", rows=found)


@dataclass(frozen=True)
class Both(BenchOptions):
    """Run the benchmarks detection and avoidance, and say which goals were reached.

    About an hour and a half on two processors, with --quick ten minutes. A run that was stopped goes on with the same
    --out.
    """

    def results(self) -> dict[str, Any]:
        """See `BenchOptions`."""
        from pretouch_lab.bench.goals import front_table, goal_table
        from pretouch_lab.cli.playing import check_json, report

        out = self.folder("bench")
        check_json(self, [out, *(out / name for name in ("detection", "avoidance"))])
        detection = self.below(Detection, out / "detection").results()
        avoidance = self.below(Avoidance, out / "avoidance").results()
        report([goal_table(detection, avoidance), front_table(detection, avoidance)], [], out)
        return {"detection": detection, "avoidance": avoidance}
