"""Options of the lab's commands: trials, workers that play them, and folders for the rows."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from pretouch.calibration.motion.limits import PlanParams
from pretouch.cli.options import Counts, JsonFile, Numbers, Words


@dataclass(frozen=True)
class TrialOptions:
    """Trials of an experiment."""

    seeds: int = 12
    """Trials of each cell; each seed is another arm with other errors, noise and geometry."""
    first_seed: int = 0
    """First seed. Only trials of seed 0 are recorded and drawn by default."""
    profiles: Words = ("blind", "paper")
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE changes a parameter. With `all` the studies
    have profiles of their own."""
    restrictions: Words = ()
    """off, hard, slack or floor, or several of them; by default off in the static experiment and slack in others."""
    stiffness: Numbers = (25000.0,)
    """Contact stiffness of the static object [N/m], or several, separated by commas."""
    places: Words = ("beside", "inside")
    """Where a person is in the experiment avoidance: beside, inside, the same at the line (beside line, inside line),
    walking, nobody, nobody line, or several of them."""
    skin: str = ""
    """Skin file; by default the paper's seven units, and of profiles such as pretouch the sixteen with zones."""
    arm: str = ""
    """Name of an arm, or the folder of an imported one, for static, avoidance and dynamic; by default the Panda. The
    paper's paths and places are scaled into its reach, and the skin is the arm's own. --skin and --arm take several,
    separated by commas."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file. Each trial's seed draws
    from it; by default the values are fixed."""
    record: Literal["first", "all"] = "first"
    """first: record the trials of seed 0 that figures show; all: record every trial."""


@dataclass(frozen=True)
class SweepOptions:
    """Trials of a sweep, beside the parameters that it varies and fixes."""

    experiment: tyro.conf.Positional[str] = tyro.MISSING
    """static, avoidance or dynamic."""
    design: Literal["grid", "sobol"] = "sobol"
    """grid: all combinations. sobol: first-order and total indices."""
    samples: int = 64
    """Base points of Sobol indices, a power of two. Each makes (number of parameters + 2) cells."""
    arms: int = 16
    """Number of simulated arms. Each seed draws an arm and a scene."""
    metrics: Words = ()
    """Measures in table and figure, separated by commas; by default all. The CSV file has all of them."""
    profile: str = ""
    """Profile to start from, or PROFILE:GROUP.FIELD=VALUE; by default the experiment's own."""
    seeds: Literal["published", "development"] = "development"
    """Simulated arms: those of the published tables, or others."""


@dataclass(frozen=True)
class Playing:
    """Workers that play trials, and the folder for their rows."""

    out: str = ""
    """Folder for rows, recordings, tables and figures. The same options continue a run that was stopped."""
    json: JsonFile = None
    processes: int | None = None
    """Worker processes; by default one for each processor."""

    def folder(self, name: str) -> Path:
        """Return the folder for the results: --out, or one under runs/."""
        return Path(self.out or f"runs/{name}")


@dataclass(frozen=True)
class Published(Playing):
    """Options of the published benchmarks."""

    quick: bool = False
    """Play a small part of the trials. The tables state what that part cannot show."""
    seeds: Literal["published", "development"] = "published"
    """Simulated arms: those of the published tables, or others to develop with."""


@dataclass(frozen=True)
class InWorlds(Published):
    """Options of benchmarks that other simulated arms and sensors can play."""

    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file. Each trial's seed draws
    from it; by default the arms of the published tables. Each world has a folder of its own."""


@dataclass(frozen=True)
class DetectionOptions(InWorlds):
    """Compare contact detectors by delay, false alarms and missed contacts.

    About forty minutes on two processors, with --quick two. The same --out continues a run that was stopped.
    """


@dataclass(frozen=True)
class AvoidanceOptions(InWorlds):
    """Compare controllers by distance to people and objects, contact forces, and time lost on the path.

    About ten minutes on two processors, with --quick one. The same --out continues a run that was stopped.
    """

    baselines: Annotated[Words, tyro.conf.arg(aliases=["--contenders"])] = ()
    """Baselines, separated by commas: blind, flacco, flacco-surface, ding, ding-near, paper, paper-off, or any
    profile; by default all, and pretouch with one switch off at a time."""
    scenarios: Words = ()
    """Scenarios, separated by commas; by default all."""
    arm: str = "panda"
    """Name of an arm, or the folder of an imported one; give --out, as each arm needs a folder of its own. The
    scenarios' paths and obstacles are scaled into its reach, and the skin is the arm's own."""


@dataclass(frozen=True)
class LocalizationOptions(Published):
    """Measure the error of contact localization: link and place, with skins and without.

    About twenty minutes on two processors, with --quick three. The same --out continues a run that was stopped.
    """


@dataclass(frozen=True)
class ShieldOptions(Published):
    """Compare filters between a commander and the arm: which limits hold for any command, and how much they change it.

    About ten minutes on two processors, with --quick one. The same --out continues a run that was stopped.
    """


@dataclass(frozen=True)
class RealOptions(Playing):
    """Compare contact detectors on public recordings of real arms, which you download: false alarms, misses, delays.

    One half of each set's recordings gives the arm's load, offsets and friction, the other half tests the detectors;
    then the halves swap. docs/explanation/benchmarks.md describes the layout of the folder.
    """

    sets: tyro.conf.Positional[Path] = field(kw_only=True)
    """Folder with a folder or file for each set, and `arms` from `pretouch robot import`."""
    detectors: Words = ("fixed", "five-sigma", "learnt", "paper", "pretouch")
    """Profiles, or five-sigma or learnt, which learn from the other half; separated by commas."""


@dataclass(frozen=True)
class CalibrationOptions(Playing):
    """Measure the error of `pretouch skin calibrate` on random skins in simulation."""

    skins: int = 20
    """Number of skins. Each has a unit on each link from the second on."""
    find_links: bool = False
    """Let the calibration find the link of each unit."""
    motion: PlanParams = field(default_factory=PlanParams)
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    seed: int = 0
    """Seed of all random numbers."""


@dataclass(frozen=True)
class CycleOptions:
    """Measure the processor and wall time of a control step at a rate, and count overruns."""

    points: Counts = (7, 32, 128, 1000)
    """Numbers of sensed points, separated by commas. A unit updates each point 50 times a second."""
    rate: float = 1000.0
    """Control rate [Hz]. Numbers of cycles in the profile are scaled to it."""
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
    """Number of the processor to run on; by default the system chooses."""
