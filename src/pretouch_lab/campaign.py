"""Many trials in parallel processes, each result in its own file, so that a run that was stopped goes on."""

import json
import os
from collections.abc import Callable
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass, replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, cast, get_args

from pretouch import __version__
from pretouch.atomic_write import write_json
from pretouch.coverage.placement import placement_for
from pretouch.errors import ExperimentError, SkinError
from pretouch.params import Orientation
from pretouch.profiles import profile, restriction_modes
from pretouch.robot.description import panda
from pretouch.robot.description_file import FILE, load_description
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import PAPER_SKIN, load_skin, paper_skin
from pretouch.sim.randomisation import world_set
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.registry import EXPERIMENTS
from pretouch_lab.result_key import parameters_digest, result_key
from pretouch_lab.results_file import failure_said
from pretouch_lab.workers import interrupt_held_back, workers

Recorded = Literal["first", "all"]
"""Trials to record: those of the first seed of which figures are drawn, or all."""


_FOR_ANY_ARM = ("static",)


@dataclass(frozen=True)
class Request:
    """What to run. Raises an error of this package for anything that cannot be done."""

    experiments: tuple[str, ...]
    seeds: int
    profiles: tuple[str, ...] = ("blind", "paper")
    restrictions: tuple[str, ...] = ()
    """Restriction modes; none: each experiment's own."""
    orientation: str | None = None
    """Whether the hand's orientation is free or held, or None for the profile's own."""
    stiffness: tuple[float, ...] = (25_000.0,)
    """Contact stiffnesses of static objects [N/m]."""
    skin: str | None = None
    """Skin file, or None for the seven units of the paper's experiment."""
    record: str = "first"
    """Trials to record, `Recorded`."""
    arm: str | None = None
    """Folder of an imported arm, or its robot.toml; None for the Panda."""
    first_seed: int = 0
    world: str | None = None
    """Set of worlds of which each trial's seed draws its own (`sim.randomisation`), or None for the usual one."""

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
            _check_choice("restriction mode", mode, restriction_modes())
        if self.orientation is not None:
            _check_choice("orientation", self.orientation, get_args(Orientation))
        _check_choice("choice of trials to record", self.record, get_args(Recorded))
        for stiffness in self.stiffness:
            if not 100.0 <= stiffness <= 1e6:
                raise ExperimentError(f"The stiffness is {stiffness:g} N/m: give one from 100 to 1000000 N/m.")
        if not self.stiffness or len(set(self.stiffness)) < len(self.stiffness):
            listed = ", ".join(f"{k:g}" for k in self.stiffness) or "none"
            raise ExperimentError(f"The stiffnesses are {listed} N/m: name each wanted one once.")
        if self.world:
            world_set(self.world)
        if not self.tasks():
            raise ExperimentError(
                f"There is nothing to run: {', '.join(self.experiments)} is about proximity, and none of the profiles"
                f" {', '.join(self.profiles)} has it."
            )

    def context(self) -> Context:
        """Load what all trials share."""
        model = RobotModel(load_description(self.arm) if self.arm else panda())
        skin = load_skin(self.skin_file, model) if self.skin or self.arm else paper_skin(model)
        return Context(model, skin, cast(Orientation | None, self.orientation), placement_for(model), self.world or "")

    @property
    def skin_file(self) -> Path:
        """The skin's file: the one asked for, or else the arm's own."""
        if self.skin:
            return Path(self.skin)
        return _arm_folder(self.arm) / "skin.toml" if self.arm else PAPER_SKIN

    def tasks(self) -> list[tuple[Cell, int]]:
        """Every trial once, seed by seed, so that a stopped run has some of each cell."""
        grid = Grid(self.profiles, self.restrictions, self.stiffness)
        cells = [cell for name in self.experiments for cell in EXPERIMENTS[name].cells(grid)]
        once = list({cell.name: cell for cell in cells}.values())
        return [(cell, seed) for seed in range(self.first_seed, self.first_seed + self.seeds) for cell in once]


def _arm_folder(arm: str) -> Path:
    return Path(arm) if Path(arm).is_dir() else Path(arm).parent


def _check_choice(what: str, choice: str, allowed: tuple[str, ...]) -> None:
    if choice not in allowed:
        raise ExperimentError(f"The {what} {choice!r} is unknown: choose from {', '.join(allowed)}.")


def open_folder(request: Request, out: Path) -> None:
    """Make a folder for the results, or take one up that a run with the same parameters began."""
    wanted = json.loads(json.dumps({"version": __version__, **asdict(request), "sha256": _fingerprints(request)}))
    about = out / "run.json"
    try:
        for folder in {out / "recordings", *(trial_file(out, *task).parent for task in request.tasks())}:
            folder.mkdir(parents=True, exist_ok=True)
        if about.exists():
            _check_same(_object(about), wanted, out)
        else:
            write_json(wanted, about)
    except OSError as error:
        raise ExperimentError(f"The folder {out} cannot be used: {error.strerror}: give another --out.") from error
    except _Damaged as error:
        raise ExperimentError(f"The file {about} is damaged ({error}): give another --out.") from error


def _fingerprints(request: Request) -> dict[str, str]:
    """Digests of what a request only names: the skin file, and the parameters of each profile."""
    path = request.skin_file
    try:
        digests = {"the skin file has": sha256(path.read_bytes()).hexdigest()}
    except OSError as error:
        raise SkinError(f"The skin file {path} cannot be read: {error.strerror}.") from error
    if request.world:
        digests["the world's file has"] = world_set(request.world).digest
    if request.arm:
        digests["the arm's files have"] = sha256(_arm_files(request.arm)).hexdigest()
    for name in dict.fromkeys(cell.profile for cell, _ in request.tasks()):
        digests[f"the parameters of profile {name} have"] = parameters_digest(profile(name))
    return digests


def _arm_files(arm: str) -> bytes:
    """Content of an arm's files."""
    mjcf = load_description(arm).mjcf
    file = Path(arm) / FILE if Path(arm).is_dir() else Path(arm)
    return file.read_bytes() + mjcf.read_bytes()


def _check_same(found: dict[str, Any], wanted: dict[str, Any], out: Path) -> None:
    """Refuse to go on with a run that other parameters began."""
    digests: dict[str, str] = wanted["sha256"]
    for key, value in wanted.items():
        if key != "sha256" and found.get(key) != value:
            raise ExperimentError(
                f"The folder {out} holds a run with {key} = {found.get(key)!r}, not {value!r}:"
                " give another --out, or the parameters of that run."
            )
    before = found.get("sha256")
    for what, digest in digests.items():
        if not isinstance(before, dict) or before.get(what) != digest:
            raise ExperimentError(f"The folder {out} holds a run, but {what} changed since: give another --out.")


class _Damaged(Exception):
    """A JSON file holds something else than an object."""


def _object(path: Path) -> dict[str, Any]:
    """Read a JSON file that holds an object."""
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # not UTF-8, not JSON, brackets too deep
        raise _Damaged(error) from error
    if not isinstance(value, dict):
        raise _Damaged("it holds no object")
    return value


@dataclass(frozen=True)
class Progress:
    """How far a campaign is."""

    done: int
    """Trials that are finished."""
    total: int
    cost_done: float
    """Simulated time of those trials, about [s]."""
    cost_total: float


def progress_of(request: Request, out: Path) -> Progress:
    """How far a campaign in a folder is."""
    tasks = request.tasks()
    missing = [task for task in tasks if _row(out, *task) is None]
    total = sum(_cost(cell) for cell, _ in tasks)
    return Progress(len(tasks) - len(missing), len(tasks), total - sum(_cost(cell) for cell, _ in missing), total)


def _cost(cell: Cell) -> float:
    return EXPERIMENTS[cell.experiment].cost(cell)


def run_campaign(request: Request, out: Path, progress: Callable[[float], None]) -> None:
    """Run all trials that have no result yet, on all processors; `progress(cost)` after each, with its cost.

    However it ends, the results of finished trials stay.
    """
    request.context()  # a bad skin is refused here, before any process starts
    open_folder(request, out)
    missing = [task for task in request.tasks() if _row(out, *task) is None]
    if not missing:
        return
    # the long ones first, so that no processor waits for one at the end
    missing.sort(key=lambda task: (task[1], -_cost(task[0])))
    with workers(min(len(missing), os.cpu_count() or 1)) as pool:
        with interrupt_held_back(), failure_said(out):
            futures = {pool.submit(_work, request, out, cell, seed): _cost(cell) for cell, seed in missing}
        for future in as_completed(futures):
            with failure_said(out):
                future.result()
            progress(futures[future])


def trial_file(out: Path, cell: Cell, seed: int) -> Path:
    """Return where a trial's row of results is kept: elsewhere as soon as what plays the trial is another."""
    key = result_key(EXPERIMENTS[cell.experiment].trial)
    return out / "trials" / f"{cell.experiment}-{key}" / f"{cell.name}_{seed:04d}.json"


def recording_file(out: Path, cell: Cell, seed: int) -> Path:
    """Return where a trial's recording is kept, if it is recorded."""
    return out / "recordings" / f"{cell.name}_{seed:04d}.mcap"


def finished(request: Request, out: Path) -> list[dict[str, Any]]:
    """Read the rows of all finished trials, in the order of the tasks."""
    return [row for task in request.tasks() if (row := _row(out, *task)) is not None]


def _row(out: Path, cell: Cell, seed: int) -> dict[str, Any] | None:
    """Read a trial's row of results; None where there is none, or a damaged one, and the trial is still to run."""
    try:
        row = _object(trial_file(out, cell, seed))
    except (OSError, _Damaged):
        return None
    its_own = {"experiment": cell.experiment, **cell.where, "profile": cell.profile, "seed": seed}
    return row if all(row.get(key) == value for key, value in its_own.items()) else None


@cache
def _context(request: Request) -> Context:
    return request.context()


def _work(request: Request, out: Path, cell: Cell, seed: int) -> None:
    """Run one trial in a worker process and keep its results, and its recording if it is wanted."""
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
    write_json(row, trial_file(out, cell, seed))
