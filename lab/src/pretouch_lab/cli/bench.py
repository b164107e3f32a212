"""`pretouch bench`: its docstrings are the help. What each benchmark does stands in `benchmarks`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from pretouch.calibration.motion.limits import PlanParams
from pretouch.cli.options import Counts, JsonFile, Words
from pretouch_lab.options import Playing


def _run(options: Any) -> None:
    """Run a benchmark, and write its numbers if a file is given."""
    from pretouch.cli.writing import numbers_to
    from pretouch_lab.cli import benchmarks  # heavy packages, which the help does without

    with numbers_to(options.json) as write:
        write(getattr(benchmarks, type(options).__name__.lower())(options))


@dataclass(frozen=True)
class Published(Playing):
    """Options of the benchmarks that are published."""

    quick: bool = False
    """A small part of it; it says what it cannot tell."""
    seeds: Literal["published", "development"] = "published"
    """Which simulated arms: those of the published tables, or others to develop with."""


@dataclass(frozen=True)
class InWorlds(Published):
    """Options of those that can be played with other simulated arms and sensors."""

    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, of which each trial's seed
    draws its own; by default the arms of the published tables. Results of a world are kept in a folder of its own."""


@dataclass(frozen=True)
class Detection(InWorlds):
    """Hold contact detectors against each other: delay against false alarms, what they miss, forces on a board.

    About an hour on two processors, with --quick five minutes. A run that was stopped goes on with the same --out.
    """


@dataclass(frozen=True)
class Avoidance(InWorlds):
    """How near arms come to people and objects, with what forces, and what it costs to keep clear of them.

    About ten minutes on two processors, with --quick one. A run that was stopped goes on with the same --out.
    """

    baselines: Annotated[Words, tyro.conf.arg(aliases=["--contenders"])] = ()
    """Baselines, separated by commas: blind, flacco, flacco-surface, ding, ding-near, paper, paper-off, or any
    profile; by default all, and pretouch with each switch off alone."""
    scenarios: Words = ()
    """Scenarios, separated by commas; by default all."""
    arm: str = "panda"
    """Name of an arm, or the folder of an imported one, in a folder of results of its own: give --out. The scenarios'
    paths and obstacles are scaled into its reach, and the skin is the arm's own."""


@dataclass(frozen=True)
class Localization(Published):
    """Hold where contacts are said to be against where they are: links, places, two at once; with skins and without.

    About twenty minutes on two processors, with --quick three. A run that was stopped goes on with the same --out.
    """


@dataclass(frozen=True)
class Shield(Published):
    """Hold filters between a commander and the arm against each other: what holds whoever commands, and what it costs.

    About ten minutes on two processors, with --quick one. A run that was stopped goes on with the same --out.
    """


@dataclass(frozen=True)
class Both(InWorlds):
    """Run the benchmarks detection and avoidance, and say which goals were reached.

    About an hour and a half on two processors, with --quick ten minutes. A run that was stopped goes on with the same
    --out.
    """


@dataclass(frozen=True)
class Real(Playing):
    """Contact detectors on public recordings of real arms, which you download: false alarms, contacts, delays, links.

    One half of each set's recordings says what load, offsets and friction the arm has, the other is judged; then the
    other way round. docs/explanation/benchmarks.md tells how the folder is laid out.
    """

    sets: tyro.conf.Positional[Path] = field(kw_only=True)
    """Folder of the sets, each by its name, with `arms` as `pretouch robot import` wrote them."""
    detectors: Words = ("fixed", "observer", "paper", "pretouch")
    """Profiles, separated by commas."""


@dataclass(frozen=True)
class Calibration(Playing):
    """How far units on random skins are found from where they sit, by `pretouch skin calibrate` in simulation."""

    skins: int = 20
    """How many; each has a unit on each link from the second on."""
    find_links: bool = False
    """Do not tell the calibration which links the units sit on."""
    motion: PlanParams = field(default_factory=PlanParams)
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    seed: int = 0
    """Decides all that is random."""


@dataclass(frozen=True)
class Cycle:
    """How long a control step takes: processor and wall time at a rate, and overruns."""

    points: Counts = (7, 32, 128, 1000)
    """Numbers of sensed points, separated by commas, each shown by a unit 50 times a second."""
    rate: float = 1000.0
    """Cycles a second; everything the profile counts in cycles is brought to it."""
    cycles: int = 20_000
    """Steps measured for each number of points."""
    profile: str = "paper"
    """Profile of the controller, or PROFILE:GROUP.FIELD=VALUE."""
    arm: str = "panda"
    """Name of an arm, or the folder of an imported one."""
    json: JsonFile = None
    priority: int | None = None
    """Real-time priority, 1 to 99 (80 is usual); by default the process keeps its own."""
    cpu: int | None = None
    """Number of the processor to stay on; by default the system decides."""


@dataclass(frozen=True)
class Bench:
    """Measure something: detectors, ways to avoid people, places of contacts, or a step's time."""

    what: (
        Annotated[Detection, tyro.conf.subcommand("detection")]
        | Annotated[Avoidance, tyro.conf.subcommand("avoidance")]
        | Annotated[Localization, tyro.conf.subcommand("localization")]
        | Annotated[Shield, tyro.conf.subcommand("shield")]
        | Annotated[Both, tyro.conf.subcommand("both")]
        | Annotated[Cycle, tyro.conf.subcommand("cycle")]
        | Annotated[Calibration, tyro.conf.subcommand("calibration")]
        | Annotated[Real, tyro.conf.subcommand("real")]
    )

    def run(self) -> None:
        """Run the benchmark."""
        _run(self.what)
