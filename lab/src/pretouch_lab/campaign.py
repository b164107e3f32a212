"""The trials of experiments as tasks: which of them a request asks for, and how a worker plays one."""

import os
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Literal, get_args

from pretouch.atomic_write import write_json
from pretouch.errors import ExperimentError, SkinError
from pretouch.profiles import profile
from pretouch.robot.description import files_digest, robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import skin_file, skin_for
from pretouch.sim.paper_scenes import placement_for
from pretouch.sim.randomisation import world_set
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.domain_randomisation import digest_of
from pretouch_lab.engine import Task, open_folder
from pretouch_lab.registry import EXPERIMENTS
from pretouch_lab.restrictions import modes

Recorded = Literal["first", "all"]
"""Trials to record: those of the first seed of which figures are drawn, or all."""


_FOR_ANY_ARM = ("static", "avoidance", "dynamic")


@dataclass(frozen=True)
class Request:
    """What to run. Raises an error of this package for anything that cannot be done."""

    experiments: tuple[str, ...]
    seeds: int
    profiles: tuple[str, ...] = ("blind", "paper")
    restrictions: tuple[str, ...] = ()
    """Restriction modes; none: each experiment's own."""
    stiffness: tuple[float, ...] = (25_000.0,)
    """Contact stiffnesses of static objects [N/m]."""
    skin: str | None = None
    """Skin file, or None for the seven units of the paper's experiment."""
    record: str = "first"
    """Trials to record, `Recorded`."""
    arm: str | None = None
    """Name of an arm, or the folder of an imported one; None for the Panda."""
    first_seed: int = 0
    world: str | None = None
    """Set of the domain randomisation (`sim.randomisation`) of which each trial's seed draws its own, or None for the
    usual arm."""

    def __post_init__(self) -> None:
        for name in self.experiments:
            if name not in EXPERIMENTS:
                known = ", ".join([*EXPERIMENTS, "all"])
                raise ExperimentError(f"The experiment {name!r} is unknown: choose from {known}.")
        others = [name for name in self.experiments if name not in _FOR_ANY_ARM]
        if self.arm is not None and others:
            raise ExperimentError(
                f"The experiment {others[0]!r} is laid out for the Panda: with --arm, choose {', '.join(_FOR_ANY_ARM)}."
            )
        if self.seeds < 1:
            raise ExperimentError(f"The number of seeds is {self.seeds}: give at least 1.")
        if self.first_seed < 0:
            raise ExperimentError(f"The first seed is {self.first_seed}: give 0 or more.")
        if not self.profiles or len(set(self.profiles)) < len(self.profiles):
            raise ExperimentError(f"The profiles are {','.join(self.profiles) or 'none'}: name each wanted one once.")
        for name in self.profiles:
            profile(name)
        for mode in self.restrictions:
            _check_choice("restriction mode", mode, tuple(modes()))
        _check_choice("choice of trials to record", self.record, get_args(Recorded))
        for stiffness in self.stiffness:
            if not 100.0 <= stiffness <= 1e6:
                raise ExperimentError(f"The stiffness is {stiffness:g} N/m: give one from 100 to 1000000 N/m.")
        if not self.stiffness or len(set(self.stiffness)) < len(self.stiffness):
            listed = ", ".join(f"{k:g}" for k in self.stiffness) or "none"
            raise ExperimentError(f"The stiffnesses are {listed} N/m: name each wanted one once.")
        if self.world:
            world_set(self.world)
        if not self.trials():
            raise ExperimentError(
                f"There is nothing to run: {', '.join(self.experiments)} is about proximity, and none of the profiles"
                f" {', '.join(self.profiles)} has it."
            )

    def context(self) -> Context:
        """Load what all trials share."""
        model = RobotModel(robot_named(self.arm or "panda"))
        skin = skin_for(model, self.skin or "")
        return Context(model, skin, placement_for(model), self.world or "")

    def trials(self) -> list[tuple[Cell, int]]:
        """Every trial once, seed by seed, so that a stopped run has some of each cell."""
        grid = Grid(self.profiles, self.restrictions, self.stiffness)
        cells = [cell for name in self.experiments for cell in EXPERIMENTS[name].cells(grid)]
        return [(cell, seed) for seed in range(self.first_seed, self.first_seed + self.seeds) for cell in cells]

    def tasks(self, out: Path) -> list[Task]:
        """Return the trials as tasks that keep their rows in a folder; their cost is simulated time [s]."""
        return [
            Task(
                trial_file(out, cell, seed), partial(play_trial, self, out, cell, seed),
                EXPERIMENTS[cell.experiment].cost(cell), seed,
                cell.row(seed),
            )
            for cell, seed in self.trials()
        ]  # fmt: skip

    def open(self, out: Path) -> None:
        """Make a folder for the results, or take up one that a run with the same parameters began."""
        self.context()  # a bad skin is refused here, before any process starts
        open_folder(out, asdict(self), _fingerprints(self), ("trials", "recordings"))


def _check_choice(what: str, choice: str, allowed: tuple[str, ...]) -> None:
    if choice not in allowed:
        raise ExperimentError(f"The {what} {choice!r} is unknown: choose from {', '.join(allowed)}.")


def _fingerprints(request: Request) -> dict[str, str]:
    """Digests of what a request only names: the files of skin, arm and world."""
    arm = robot_named(request.arm or "panda")
    path = Path(request.skin or skin_file(arm))
    try:
        digests = {"the skin file has": sha256(path.read_bytes()).hexdigest()}
    except OSError as error:
        raise SkinError(f"The skin file {path} cannot be read: {error.strerror}.") from error
    digests |= digest_of(request.world or "")
    if request.arm:
        digests["the arm's files have"] = files_digest(arm)
    return digests


def trial_file(out: Path, cell: Cell, seed: int) -> Path:
    """Return where a trial's row of results is kept."""
    return out / "trials" / f"{cell.name}_{seed:04d}.json"


def recording_file(out: Path, cell: Cell, seed: int) -> Path:
    """Return where a trial's recording is kept, if it is recorded."""
    return out / "recordings" / f"{cell.name}_{seed:04d}.mcap"


@cache
def _context(request: Request) -> Context:
    return request.context()


def play_trial(request: Request, out: Path, cell: Cell, seed: int, file: Path) -> None:
    """Run one trial in a worker process; write its row to a file, and its recording beside if it is wanted."""
    experiment, context = EXPERIMENTS[cell.experiment], _context(request)
    place = recording_file(out, cell, seed)
    place.unlink(missing_ok=True)  # of another program, or of a trial whose row was damaged
    unfinished = place.with_suffix(".unfinished")
    if request.record == "all" or (seed == 0 and experiment.recorded):
        unfinished.unlink(missing_ok=True)
        context = replace(context, recording=unfinished)
    try:
        row, _ = experiment.trial(cell, seed, context)
    except SystemExit as end:  # of a signal, the recording is closed; the pool would go on with the next trial
        os._exit(int(end.code or 1))
    if context.world:
        row = {**row, "world": context.world}
    if unfinished.exists():  # some trials play nothing
        os.replace(unfinished, place)
    write_json(row, file)
