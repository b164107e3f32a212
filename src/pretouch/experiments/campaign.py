"""Many trials in parallel processes, each result in its own file, so that a run that was stopped goes on."""

import json
import os
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import cache
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path
from threading import Thread
from types import ModuleType
from typing import Any, cast, get_args

from pretouch import __version__
from pretouch.errors import ExperimentError
from pretouch.experiments import avoidance, dynamic, static
from pretouch.experiments.cell import Cell, Context
from pretouch.experiments.trace import save_trace, trace_of
from pretouch.params import Orientation, RestrictionMode, profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import load_skin, paper_skin

EXPERIMENTS: dict[str, ModuleType] = {m.NAME: m for m in (static, avoidance, dynamic)}


@dataclass(frozen=True)
class Request:
    """What to run. Raises an error of this package for anything that cannot be done."""

    experiments: tuple[str, ...]
    seeds: int
    profiles: tuple[str, ...] = ("blind", "paper")
    restrictions: str | None = None
    """Restriction mode, or None for each experiment's own."""
    orientation: str | None = None
    """Whether the hand's orientation is free or held, or None for the profile's own."""
    stiffness: float = 25_000.0
    """Contact stiffness of static objects [N/m]."""
    skin: str | None = None
    """Skin file, or None for the seven units of the paper's experiment."""

    def __post_init__(self) -> None:
        for name in self.experiments:
            if name not in EXPERIMENTS:
                known = ", ".join([*EXPERIMENTS, "all"])
                raise ExperimentError(f"The experiment {name!r} is unknown: choose from {known}.")
        if self.seeds < 1:
            raise ExperimentError(f"The number of seeds is {self.seeds}: give at least 1.")
        if not self.profiles or len(set(self.profiles)) < len(self.profiles):
            raise ExperimentError(f"The profiles are {','.join(self.profiles) or 'none'}: name each wanted one once.")
        for name in self.profiles:
            profile(name)
        choices: tuple[tuple[str, str | None, tuple[str, ...]], ...] = (
            ("restriction mode", self.restrictions, get_args(RestrictionMode)),
            ("orientation", self.orientation, get_args(Orientation)),
        )
        for what, choice, allowed in choices:
            if choice is not None and choice not in allowed:
                raise ExperimentError(f"The {what} {choice!r} is unknown: choose from {', '.join(allowed)}.")
        if not 100.0 <= self.stiffness <= 1e6:
            raise ExperimentError(f"The stiffness is {self.stiffness:g} N/m: give one from 100 to 1000000 N/m.")

    def context(self) -> Context:
        """Load what all trials share."""
        model = RobotModel(panda())
        skin = load_skin(Path(self.skin), model) if self.skin else paper_skin(model)
        restrictions = cast(RestrictionMode | None, self.restrictions)
        return Context(model, skin, self.stiffness, restrictions, cast(Orientation | None, self.orientation))

    def tasks(self) -> list[tuple[Cell, int]]:
        """Every trial, seed by seed, so that a stopped run has some of each cell."""
        cells = [cell for name in self.experiments for cell in EXPERIMENTS[name].cells(self.profiles)]
        return [(cell, seed) for seed in range(self.seeds) for cell in cells]


def open_folder(request: Request, out: Path) -> None:
    """Make a folder for the results, or take one up that a run with the same parameters began."""
    wanted = json.loads(json.dumps({"version": __version__, **asdict(request)}))
    about = out / "run.json"
    try:
        for part in ("trials", "traces"):
            (out / part).mkdir(parents=True, exist_ok=True)
        if about.exists():
            found = json.loads(about.read_text(encoding="utf-8"))
            differing = [key for key in wanted if not isinstance(found, dict) or found.get(key) != wanted[key]]
            if differing:
                key = differing[0]
                was = found.get(key) if isinstance(found, dict) else found
                raise ExperimentError(
                    f"The folder {out} holds a run with {key} = {was!r}, not {wanted[key]!r}:"
                    " give another --out, or the parameters of that run."
                )
        else:
            write_json(wanted, about)
    except OSError as error:
        raise ExperimentError(f"The folder {out} cannot be used: {error.strerror}: give another --out.") from error
    except json.JSONDecodeError as error:
        raise ExperimentError(f"The file {about} is damaged ({error}): give another --out.") from error


def write_json(value: Any, path: Path) -> None:
    """Write a JSON file, whole or not at all."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    temporary.write_text(json.dumps(value, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    os.replace(temporary, path)


def run_campaign(request: Request, out: Path, progress: Callable[[int, int], None]) -> None:
    """Run all trials that have no result yet, on all processors; `progress(done, total)` after each.

    However it ends, the results of finished trials stay.
    """
    request.context()  # a bad skin is refused here, before any process starts
    open_folder(request, out)
    tasks = request.tasks()
    missing = [task for task in tasks if not trial_file(out, *task).exists()]
    progress(len(tasks) - len(missing), len(tasks))
    if not missing:
        return
    workers = min(len(missing), os.cpu_count() or 1)
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_start_worker)
    try:
        futures = [pool.submit(_work, request, out, cell, seed) for cell, seed in missing]
        for done, future in enumerate(as_completed(futures), start=len(tasks) - len(missing) + 1):
            future.result()
            progress(done, len(tasks))
    except BaseException:
        for process in active_children():
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown()


def trial_file(out: Path, cell: Cell, seed: int) -> Path:
    """Return where a trial's row of results is kept."""
    return out / "trials" / f"{cell.name}_{seed:04d}.json"


def trace_file(out: Path, cell: Cell, seed: int) -> Path:
    """Return where a trial's course is kept, if it is."""
    return out / "traces" / f"{cell.name}_{seed:04d}.npz"


def finished(request: Request, out: Path) -> list[dict[str, Any]]:
    """Read the rows of all finished trials, in the order of the tasks."""
    files = [trial_file(out, cell, seed) for cell, seed in request.tasks()]
    return [json.loads(file.read_text(encoding="utf-8")) for file in files if file.exists()]


def _start_worker() -> None:
    """Leave Ctrl-C to the parent, which ends the workers in order; and do not outlive it if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@cache
def _context(request: Request) -> Context:
    return request.context()


def _work(request: Request, out: Path, cell: Cell, seed: int) -> None:
    """Run one trial in a worker process and keep its results; the course of the first seed too, for figures."""
    row, record = EXPERIMENTS[cell.experiment].trial(cell, seed, _context(request))
    if seed == 0:
        save_trace(trace_of(record), trace_file(out, cell, seed))
    write_json(row, trial_file(out, cell, seed))
