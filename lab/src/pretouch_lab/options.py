"""What commands of the lab are told: which trials, on what they are played, and where their rows go."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from pretouch.calibration.motion.limits import PlanParams
from pretouch.cli.options import Counts, JsonFile, Numbers, Words


@dataclass(frozen=True)
class TrialOptions:
    """Which trials of an experiment."""

    seeds: int = 12
    """Trials of each cell; each seed is another arm with other errors, noise and geometry."""
    first_seed: int = 0
    """The first of them; only seed 0 is recorded and drawn unasked."""
    profiles: Words = ("blind", "paper")
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter. With `all`
    the studies have their own."""
    restrictions: Words = ()
    """off, hard, slack or floor, or several of them; by default off in the static experiment and slack in others."""
    stiffness: Numbers = (25000.0,)
    """Contact stiffness of the static object [N/m], or several, separated by commas."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    arm: str = ""
    """Name of an arm, or the folder of an imported one, for static, avoidance and dynamic; by default the Panda. The
    paper's paths and places are scaled into its reach, and the skin is the arm's own."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, of which each trial's seed
    draws its own; by default the usual ones."""
    record: Literal["first", "all"] = "first"
    """first: record the trials of the first seed of which figures are drawn; all: record every trial."""


@dataclass(frozen=True)
class SweepOptions:
    """What a sweep plays of an experiment, beside the parameters that it varies and fixes."""

    experiment: tyro.conf.Positional[str] = tyro.MISSING
    """static, avoidance or dynamic."""
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


@dataclass(frozen=True)
class Playing:
    """Where trials are played, and where their rows go."""

    out: str = ""
    """Folder for rows, recordings, tables and figures. A run that was stopped goes on where it was, with the same
    options."""
    json: JsonFile = None
    processes: int | None = None
    """Worker processes; by default one for each processor."""
    scheduler: str = ""
    """Address of a dask scheduler, tcp://HOST:PORT, whose workers play instead. They need the same folder --out
    and the same files."""

    def folder(self, name: str) -> Path:
        """Return where the results go: --out, or a folder under runs/."""
        place = Path(self.out or f"runs/{name}")
        return place.absolute() if self.scheduler else place

    def input(self, name: str) -> str:
        """Return a name of an arm, a skin or a world as workers may read it: a scheduler's have another folder."""
        from pretouch.robot.description import ROBOTS
        from pretouch.sim.randomisation import SETS

        whole = self.scheduler and name and name not in (*ROBOTS, *SETS)
        return str(Path(name).absolute()) if whole else name


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
class DetectionOptions(InWorlds):
    """Hold contact detectors against each other: delay against false alarms, what they miss, forces on a board.

    About half an hour on two processors, with --quick two minutes. A run that was stopped goes on with the same --out.
    """


@dataclass(frozen=True)
class AvoidanceOptions(InWorlds):
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
class LocalizationOptions(Published):
    """Hold where contacts are said to be against where they are: links, places, two at once; with skins and without.

    About twenty minutes on two processors, with --quick three. A run that was stopped goes on with the same --out.
    """


@dataclass(frozen=True)
class ShieldOptions(Published):
    """Hold filters between a commander and the arm against each other: what holds whoever commands, and what it costs.

    About ten minutes on two processors, with --quick one. A run that was stopped goes on with the same --out.
    """


@dataclass(frozen=True)
class BothOptions(InWorlds):
    """Run the benchmarks detection and avoidance, and say which goals were reached.

    About 40 minutes on two processors, with --quick three minutes. A run that was stopped goes on with the same --out.
    """


@dataclass(frozen=True)
class RealOptions(Playing):
    """Contact detectors on public recordings of real arms, which you download: false alarms, contacts, delays, links.

    One half of each set's recordings says what load, offsets and friction the arm has, the other is judged; then the
    other way round. docs/explanation/benchmarks.md tells how the folder is laid out.
    """

    sets: tyro.conf.Positional[Path] = field(kw_only=True)
    """Folder of the sets, each by its name, with `arms` as `pretouch robot import` wrote them."""
    detectors: Words = ("fixed", "observer", "paper", "pretouch")
    """Profiles, separated by commas."""


@dataclass(frozen=True)
class CalibrationOptions(Playing):
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
class CycleOptions:
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
