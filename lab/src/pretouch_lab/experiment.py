"""What every experiment is made of: options as cells, trials on an arm that all of them share, tables and a figure."""

import os
import re
import sys
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
from pretouch.sim.paper_scenes import Placement, placement_for
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.randomisation import world_set
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import SceneSpec
from pretouch.text_table import TextTable
from pretouch_lab.options import TrialOptions
from pretouch_lab.run import Play, Row, plays_of
from pretouch_lab.trial import Record, Setup, Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("static", "avoidance", "dynamic", "between", "mounting", "coverage", "two-arms")
"""All experiments, each in a file of `experiments`, in the order of their tables."""
_OF_THE_PAPER = ("off", "hard", "slack", "floor")
"""Restriction modes of the paper's equations; any other makes a profile what it is."""
_NAMES_MODE = re.compile(r":approach(\.rows)?=")
"""How the name of a profile names a mode."""


@dataclass(frozen=True)
class Drawing:
    """An experiment's figure."""

    name: str
    """As `pretouch figure` takes it; a function of `experiments.figures` has the same."""
    text: str
    """What it shows."""
    cells: Callable[[list[Row]], list[Row]]
    """Chooses of cells, or of rows of their trials, those that it shows."""
    beside: tuple[str, ...] = ()
    """Profiles that it shows beside a profile with proximity."""

    def draw(self, traces: list[Trace], units: tuple[str, ...]) -> "Figure":
        """Draw traces, given the names of the skin's units."""
        from pretouch_lab.experiments import figures  # workers that only play trials need no Matplotlib

        figure: Figure = getattr(figures, self.name.replace("-", "_"))(traces, units)
        return figure


@dataclass(frozen=True)
class Context:
    """What all trials of a run share."""

    model: RobotModel
    skin: Skin
    placement: Placement = field(default_factory=Placement)
    """Where the paper's paths and places are for this arm."""
    world: str = ""
    """Set of the domain randomisation of which each trial's seed draws its own, or none."""
    recording: Path | None = None
    """File to record the trial in, if it is to be recorded."""
    plant: PlantParams | None = None
    """How far the arm is from its model; none, and as far as real arms are (`plant_params_of`)."""
    ranging: RangeFinderParams = field(default_factory=RangeFinderParams)
    """How the skin's units err."""

    @property
    def arm(self) -> PlantParams:
        """How far the arm is from its model."""
        return self.plant or plant_params_of(self.model.description)

    def profile(self, cell: Row) -> Profile:
        """Return a cell's profile, with the restriction mode of the cell if it names one."""
        own = profile(cell["profile"])
        return changed(own, modes()[cell["restrictions"]]) if "restrictions" in cell else own

    def setup(self, cell: Row, seed: int, scene: SceneSpec, path: TaskPath, **other: Any) -> Setup:
        """Return what a trial of a cell is made of; `other` are further fields of `Setup`, or other values of them."""
        usual = Setup(self.model, self.skin, self.profile(cell), scene, path, seed)
        shared = {"plant": self.arm, "ranging": self.ranging, "recording": self.recording, "world": self.world}
        return replace(usual, **shared | other)


@dataclass(frozen=True)
class Experiment:
    """Cells to run, how to play a trial of one, and what to make of the rows that come out."""

    name: str
    cells: Callable[[TrialOptions], list[Row]]
    trial: Callable[[Row, int, Context], tuple[Row, Record | None]]
    """Plays the trial of a cell with a seed; returns what is measured, and its course if the figure may want it."""
    tables: Callable[[list[Row]], list[TextTable]]
    """Makes tables of the rows that there are."""
    drawing: Drawing | None = None
    any_arm: bool = False
    """Whether it can be played with another arm than the Panda."""

    def plays(self, options: TrialOptions) -> list[Play]:
        """Return all trials, seed by seed; an ExperimentError if there is none."""
        cells = self.cells(options)
        if not cells:
            raise ExperimentError(
                f"There is nothing to run: {self.name} is about proximity, and none of the profiles"
                f" {', '.join(options.profiles)} has it."
            )
        return plays_of(cells, range(options.first_seed, options.first_seed + options.seeds))


def experiment(name: str) -> Experiment:
    """Return an experiment by its name."""
    if name not in NAMES:
        raise ExperimentError(f"The experiment {name!r} is unknown: choose from {', '.join([*NAMES, 'all'])}.")
    own: Experiment = import_module(f"pretouch_lab.experiments.{name.replace('-', '_')}").EXPERIMENT
    return own


def modes() -> dict[str, dict[str, str]]:
    """Return what each restriction mode changes of a profile: none, the rows of the paper's, and other parts."""
    rows = {kind: {"approach": ApproachRestriction.name, "approach.rows": kind} for kind in get_args(RowKind)}
    parts = {name: {"approach": name} for name in Restriction.choices() if name != ApproachRestriction.name}
    return {"off": {"approach": "none"}} | rows | parts


def controllers(options: TrialOptions, restrictions: str) -> list[Row]:
    """Return profiles with restriction modes; `restrictions` is the experiment's own.

    Without proximity the mode is `off`; a profile that is named with a mode keeps it, and so does one whose mode is not
    of the paper's equations.
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
    """Choose one of some cells or trials: the first with proximity, or the first where none has any."""
    return ([row for row in rows if profile(row["profile"]).perception is not None] or rows)[:1]


def check(options: TrialOptions, names: Sequence[str]) -> None:
    """Raise an error of this package for options with which experiments cannot be played."""
    others = [name for name in names if not experiment(name).any_arm]
    if options.arm and others:
        known = ", ".join(name for name in NAMES if experiment(name).any_arm)
        raise ExperimentError(f"The experiment {others[0]!r} is laid out for the Panda: with --arm, choose {known}.")
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
            raise ExperimentError(f"The {what} are {listed}: name each wanted one once.")
    if options.world:
        world_set(options.world)
    context_of(options.arm, options.skin, options.world)  # a bad skin is refused before any process starts


@lru_cache
def context_of(arm: str, skin: str, world: str) -> Context:
    """Load what all trials share, once in each process."""
    model = RobotModel(robot_named(arm or "panda"))
    return Context(model, skin_for(model, skin), placement_for(model), world)


def arguments(name: str, options: TrialOptions) -> Row:
    """Return what rows depend on, for `run.open_run`: the options, and digests of the files that they only name."""
    arm = robot_named(options.arm or "panda")
    file = Path(options.skin or skin_file(arm))
    try:
        digests = {"skin_sha256": sha256(file.read_bytes()).hexdigest()}
    except OSError as error:
        raise SkinError(f"The skin file {file} cannot be read: {error.strerror}.") from error
    if options.arm:
        digests["arm_sha256"] = files_digest(arm)
    if options.world:
        digests["world_sha256"] = world_set(options.world).digest
    # rows say their seeds, so that a folder may be given more of them
    own = {each.name: getattr(options, each.name) for each in fields(TrialOptions) if "seed" not in each.name}
    return {"experiment": name, **own, **digests}


def play(name: str, options: TrialOptions, out: Path, cell: Row, seed: int) -> Row:
    """Play one trial, and record it in a folder if it is to be recorded; return what is measured."""
    what, context = experiment(name), context_of(options.arm, options.skin, options.world)
    place = recording_file(out, cell, seed)
    unfinished = place.with_suffix(".unfinished")
    if options.record == "all" or (seed == 0 and what.drawing):
        place.parent.mkdir(parents=True, exist_ok=True)
        for file in (place, unfinished):  # of a worker that was killed, or whose row was torn
            file.unlink(missing_ok=True)
        context = replace(context, recording=unfinished)
    row = what.trial(cell, seed, context)[0] | ({"world": options.world} if options.world else {})
    if unfinished.exists():  # some trials play nothing
        os.replace(unfinished, place)
    return row


def recording_file(out: Path, cell: Row, seed: int) -> Path:
    """Return where a trial's recording is kept: where two cells' names could become one, a digest tells them apart."""
    exact = "_".join(f"{value:.12g}" if isinstance(value, float) else str(value) for value in cell.values())
    safe = re.sub(r"[^A-Za-z0-9._+-]", "-", exact)  # + and - tell sides apart
    name = safe if safe == exact else f"{safe}-{sha256(exact.encode()).hexdigest()[:8]}"
    return out / "recordings" / f"{name}_{seed:04d}.mcap"


def main(name: str) -> None:
    """Reproduce one experiment from the command line, as `python -m pretouch_lab.experiments.static` does."""
    from pretouch.cli import main as command

    raise SystemExit(command(["reproduce", name, *sys.argv[1:]]))
