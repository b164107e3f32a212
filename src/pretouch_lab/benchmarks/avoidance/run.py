"""All trials of the avoidance benchmark: which, in which files, and what they came to."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from hashlib import sha256
from pathlib import Path

from pretouch.errors import ExperimentError
from pretouch.profiles import profile
from pretouch_lab.benchmarks.avoidance.contenders import ABLATED, ABLATED_IN, ABLATED_SEEDS, CONTENDERS, profile_text
from pretouch_lab.benchmarks.avoidance.scenario import Scenario, scenarios
from pretouch_lab.benchmarks.avoidance.trial import keep_trial
from pretouch_lab.benchmarks.scenario_files import SeedRange
from pretouch_lab.benchmarks.store import Row, Task, open_bench, read_rows, run_tasks
from pretouch_lab.result_key import result_key
from pretouch_lab.worlds import told

NAME = "avoidance"


@dataclass(frozen=True)
class Request:
    """What to run."""

    contenders: tuple[str, ...] = ()
    """None: all there are, and `pretouch` with each switch off alone in some scenarios."""
    quick: bool = False
    seeds: SeedRange = "published"
    names: tuple[str, ...] = ()
    """Scenarios; none: all."""
    world: str = ""
    """Set of worlds of which each trial's seed draws its own, or none: the arms of the published tables."""

    def __post_init__(self) -> None:
        if len(set(self.contenders)) < len(self.contenders):
            raise ExperimentError(f"The contenders are {', '.join(self.contenders)}: name each once.")
        for contender in self.contenders:
            profile_text(contender)
        for name in self.names:
            if name not in scenarios():
                raise ExperimentError(f"The scenario {name!r} is unknown: choose from {', '.join(scenarios())}.")

    def scenes(self) -> list[Scenario]:
        """Return the scenarios that are played."""
        wanted = self.names or tuple(scenarios())
        return [s for name, s in scenarios().items() if name in wanted and s.seeds(self.seeds, self.quick)]

    def tasks(self, out: Path) -> list[Task]:
        """Return all trials, by scenario, contender and seed."""
        played = [
            (scene, contender, seed)
            for scene in self.scenes()
            for contender in self.contenders or CONTENDERS
            for seed in scene.seeds(self.seeds, self.quick)
        ]
        ablated = [
            (scene, contender, seed)
            for scene in self.scenes()
            for contender in (() if self.contenders else ABLATED)
            for seed in (scene.seeds(self.seeds, self.quick)[:ABLATED_SEEDS] if scene.name in ABLATED_IN else ())
        ]
        return [_task(out, *trial, self.world) for trial in (*played, *ablated)]


def _task(out: Path, scene: Scenario, contender: str, seed: int, world: str) -> Task:
    text = profile_text(contender)
    digest = sha256(f"{contender} {scene.name}".encode()).hexdigest()[:6]
    plain = re.sub(r"[^A-Za-z0-9.-]+", "-", f"{scene.name}_{contender}")[:60]
    file = out / "trials" / f"{plain}_{digest}_{_key(text)}_{seed:04d}.json"
    return Task(file, partial(keep_trial, scene.name, contender, seed, world), _cost(scene, contender))


def _cost(scene: Scenario, contender: str) -> float:
    """Processor time, about [s]; the board is met soon, and a turn is quick, where little is done before a contact."""
    soon = contender in _SOON and ("after_contact_s" in scene.says or "turns" in scene.says)
    return _COST * float(scene.says["duration_s"]) * (0.4 if soon else 1.0)


_COST = 0.15
"""Processor time of a simulated second, measuring included [s]."""
_SOON = ("blind", "pretouch", *ABLATED)


@cache
def _key(text: str) -> str:
    """Return the key of the trials of a profile."""
    return result_key(keep_trial, profile=profile(text))


def open_run(request: Request, out: Path) -> None:
    """Make a folder for the results, or take one up that another run with such seeds began."""
    open_bench(out, NAME, {"seeds": request.seeds, **told(request.world)})


def run(request: Request, out: Path, progress: Callable[[float], None], processes: int | None = None) -> None:
    """Play what is missing; however it ends, finished trials stay in the folder."""
    open_run(request, out)
    run_tasks(request.tasks(out), out, progress, processes)


def rows_of(request: Request, out: Path) -> list[Row]:
    """Return the rows of all finished trials."""
    return read_rows(task for task in request.tasks(out) if task.file.exists())
