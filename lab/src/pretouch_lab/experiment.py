"""Parts of an experiment: cells from options, trials on a shared arm, tables and a figure."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from pretouch.composition import changed
from pretouch.control.approach import ApproachRestriction, Restriction
from pretouch.control.path import Path as TaskPath
from pretouch.errors import ExperimentError, SkinError
from pretouch.params import RowKind
from pretouch.profiles import Profile, profile
from pretouch.robot.description import files_digest, robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, skin_file, skin_for
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import SceneSpec
from pretouch.text_table import TextTable
from pretouch_lab.domain_randomisation import world_set
from pretouch_lab.options import TrialOptions
from pretouch_lab.placement import PeoplePlacement, people_placement
from pretouch_lab.run import Play, Row, plays_of
from pretouch_lab.trial import Record, Setup, Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("static", "avoidance", "dynamic", "between")
"""All experiments, each in a file of `experiments`, in the order of their tables."""
_OF_THE_PAPER = ("off", "hard", "slack", "floor")
"""Restriction modes of the paper's equations. A profile with another mode keeps it."""
_NAMES_MODE = re.compile(r":approach(\.rows)?=")
"""Pattern of a profile's name that states a mode."""


@dataclass(frozen=True)
class Drawing:
    """An experiment's figure."""

    name: str
    """Argument of `pretouch figure`, and name of a function of `experiments.figures`."""
    text: str
    """Caption."""
    cells: Callable[[list[Row]], list[Row]]
    """Selects the cells, or the rows of their trials, that the figure shows."""
    beside: tuple[str, ...] = ()
    """Profiles that the figure compares with a profile that senses proximity."""

    def draw(self, traces: list[Trace], units: tuple[str, ...]) -> "Figure":
        """Draw traces, given the names of the skin's units."""
        from pretouch_lab.experiments import figures  # workers that only play trials need no Matplotlib

        figure: Figure = getattr(figures, self.name.replace("-", "_"))(traces, units)
        return figure


@dataclass(frozen=True)
class Context:
    """Arm, skin and simulation parameters that all trials of a run share."""

    model: RobotModel
    skin: Skin
    placement: PeoplePlacement = field(default_factory=PeoplePlacement)
    """Places of the paper's paths and objects, scaled to this arm."""
    world: str = ""
    """Set of the domain randomisation that each trial's seed draws from; empty: none."""
    recording: Path | None = None
    """File for the recording of the trial; None: no recording."""
    plant: PlantParams | None = None
    """Errors of the simulated arm against its model; None: those of `plant_params_of`."""
    ranging: RangeFinderParams = field(default_factory=RangeFinderParams)
    """Errors of the skin's range finders."""

    @property
    def arm(self) -> PlantParams:
        """Errors of the simulated arm against its model."""
        return self.plant or plant_params_of(self.model.description)

    def profile(self, cell: Row) -> Profile:
        """Return a cell's profile; a restriction mode of the cell replaces the profile's."""
        own = profile(cell["profile"])
        return changed(own, modes()[cell["restrictions"]]) if "restrictions" in cell else own

    def setup(self, cell: Row, seed: int, scene: SceneSpec, path: TaskPath, **other: Any) -> Setup:
        """Return the setup of a cell's trial; `other` sets or replaces fields of `Setup`."""
        usual = Setup(self.model, self.skin, self.profile(cell), scene, path, seed)
        shared = {"plant": self.arm, "ranging": self.ranging, "recording": self.recording, "world": self.world}
        return replace(usual, **shared | other)


@dataclass(frozen=True)
class Experiment:
    """An experiment: its cells, its trial, and the tables and figure of its rows."""

    name: str
    cells: Callable[[TrialOptions], list[Row]]
    trial: Callable[[Row, int, Context], tuple[Row, Record | None]]
    """Plays the trial of a cell with a seed; returns the row, and the record that a figure needs."""
    tables: Callable[[list[Row]], list[TextTable]]
    """Writes tables of the rows of all trials."""
    drawing: Drawing | None = None
    any_arm: bool = False
    """True if other arms than the Panda can play it."""

    def plays(self, options: TrialOptions) -> list[Play]:
        """Return all trials, seed by seed."""
        return plays_of(self.cells(options), range(options.first_seed, options.first_seed + options.seeds))


def experiment(name: str) -> Experiment:
    """Return an experiment by its name."""
    if name not in NAMES:
        raise ExperimentError(f"The experiment {name!r} is unknown: choose from {', '.join([*NAMES, 'all'])}.")
    own: Experiment = import_module(f"pretouch_lab.experiments.{name.replace('-', '_')}").EXPERIMENT
    return own


def modes() -> dict[str, dict[str, str]]:
    """Return the changes to a profile for each restriction mode: off, the paper's rows, and other restrictions."""
    rows = {kind: {"approach": ApproachRestriction.name, "approach.rows": kind} for kind in get_args(RowKind)}
    parts = {name: {"approach": name} for name in Restriction.choices() if name != ApproachRestriction.name}
    return {"off": {"approach": "none"}} | rows | parts


def controllers(options: TrialOptions, restrictions: str) -> list[Row]:
    """Return pairs of profile and restriction mode; `restrictions` is the experiment's default mode.

    A profile without proximity has the mode `off`. A profile whose name states a mode keeps it. So does a profile whose
    mode is not one of the paper's equations.
    """
    pairs = []
    for name in options.profiles:
        own = profile(name)
        part = own.approach
        mode = "off" if part is None else part.rows if isinstance(part, ApproachRestriction) else part.name
        fixed = own.perception is None or bool(_NAMES_MODE.search(name)) or mode not in _OF_THE_PAPER
        pairs += [(name, mode) for mode in ((mode,) if fixed else options.restrictions or (restrictions,))]
    return [{"profile": name, "restrictions": mode} for name, mode in dict.fromkeys(pairs)]


def first_sensing(rows: list[Row]) -> list[Row]:
    """Return the first cell or trial whose profile senses proximity, else the first one."""
    return ([row for row in rows if profile(row["profile"]).perception is not None] or rows)[:1]


def check(options: TrialOptions, names: Sequence[str]) -> None:
    """Raise an error of this package for options that the experiments cannot use."""
    others = [name for name in names if not experiment(name).any_arm]
    if options.arm and others:
        choices = ", ".join(name for name in NAMES if experiment(name).any_arm)
        raise ExperimentError(f"The experiment {others[0]!r} is laid out for the Panda: with --arm, choose {choices}.")
    if options.seeds < 1:
        raise ExperimentError(f"The number of seeds is {options.seeds}: give at least 1.")
    if options.first_seed < 0:
        raise ExperimentError(f"The first seed is {options.first_seed}: give 0 or more.")
    for each in options.profiles:
        profile(each)
    if wrong := [mode for mode in options.restrictions if mode not in modes()]:
        raise ExperimentError(f"The restriction mode {wrong[0]!r} is unknown: choose from {', '.join(modes())}.")
    for stiffness in options.stiffness:
        if not 100.0 <= stiffness <= 1e6:
            raise ExperimentError(f"The stiffness is {stiffness:g} N/m: give one from 100 to 1000000 N/m.")
    for what, values in (("profiles", options.profiles), ("stiffnesses", options.stiffness)):
        if not values or len(set(values)) < len(values):
            listed = ", ".join(map(str, values)) or "none"
            raise ExperimentError(f"The {what} are {listed}: name at least one, and each once.")
    if options.world:
        world_set(options.world)
    context_of(options.arm, options.skin, options.world)  # a bad skin is refused before any process starts


@lru_cache
def context_of(arm: str, skin: str, world: str, name: str = "paper") -> Context:
    """Load the context of all trials with the profile of a name, once in each process."""
    model, paper = RobotModel(robot_named(arm or "panda")), profile(name).sight.memory is None
    return Context(model, skin_for(model, skin, paper=paper), people_placement(model), world)


def arguments(name: str, options: TrialOptions) -> Row:
    """Return the options and the digests of their files for `run.open_run`: all that the rows depend on."""
    arm = robot_named(options.arm or "panda")
    files = [Path(options.skin or skin_file(arm, paper=paper)) for paper in (True, False)]
    try:
        digests = {"skin_sha256": sha256(b"".join(file.read_bytes() for file in files)).hexdigest()}
    except OSError as error:
        raise SkinError(f"The skin file {error.filename} cannot be read: {error.strerror}.") from error
    if options.arm:
        digests["arm_sha256"] = files_digest(arm)
    if options.world:
        digests["world_sha256"] = world_set(options.world).digest
    # each row states its seed, so a folder can take more seeds later
    own = {each.name: getattr(options, each.name) for each in fields(TrialOptions) if "seed" not in each.name}
    return {"experiment": name, **own, **digests}


def play(name: str, options: TrialOptions, out: Path, cell: Row, seed: int) -> Row:
    """Play one trial and return its row; record it in a folder where the options ask for that."""
    what, context = experiment(name), context_of(options.arm, options.skin, options.world, cell.get("profile", "paper"))
    place = recording_file(out, cell, seed)
    unfinished = place.with_suffix(".unfinished")
    if options.record == "all" or (seed == 0 and what.drawing):
        place.parent.mkdir(parents=True, exist_ok=True)
        for file in (place, unfinished):  # left by a killed worker, or by a row that was not written whole
            file.unlink(missing_ok=True)
        context = replace(context, recording=unfinished)
    row = what.trial(cell, seed, context)[0] | ({"world": options.world} if options.world else {})
    if unfinished.exists():  # some trials play nothing
        os.replace(unfinished, place)
    return row


def recording_file(out: Path, cell: Row, seed: int) -> Path:
    """Return the file of a trial's recording; a digest separates cells whose file names would be equal."""
    exact = "_".join(f"{value:.12g}" if isinstance(value, float) else str(value) for value in cell.values())
    safe = re.sub(r"[^A-Za-z0-9._+-]", "-", exact)  # + and - tell sides apart
    name = safe if safe == exact else f"{safe}-{sha256(exact.encode()).hexdigest()[:8]}"
    return out / "recordings" / f"{name}_{seed:04d}.mcap"
