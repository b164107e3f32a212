"""What commands of the lab are told: which trials, on what they are played, and where their rows go."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from pretouch.cli.options import JsonFile, Numbers, Words


@dataclass(frozen=True)
class Options:
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
