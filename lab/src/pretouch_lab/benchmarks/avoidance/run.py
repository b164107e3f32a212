"""The avoidance benchmark: all its trials, in which files, and what they came to."""

import re
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from typing import ClassVar

from pretouch.errors import ExperimentError
from pretouch.robot.description import files_digest, robot_named
from pretouch_lab.baselines.avoidance import ABLATED, ABLATED_IN, ABLATED_SEEDS, BASELINES, profile_text
from pretouch_lab.benchmarks.ablations import BASE
from pretouch_lab.benchmarks.avoidance.scenario import Scenario, scenarios
from pretouch_lab.benchmarks.avoidance.setting import PANDA, place
from pretouch_lab.benchmarks.avoidance.summary import results, summarise
from pretouch_lab.benchmarks.avoidance.tables import tables
from pretouch_lab.benchmarks.avoidance.trial import keep_trial
from pretouch_lab.benchmarks.bench import Bench, Found
from pretouch_lab.engine import Task, rows_of
from pretouch_lab.run import Row


@dataclass(frozen=True)
class AvoidanceBench(Bench):
    """The avoidance benchmark."""

    name: ClassVar[str] = "avoidance"

    baselines: tuple[str, ...] = ()
    """None: all there are, and `pretouch` with each switch off alone in some scenarios."""
    names: tuple[str, ...] = ()
    """Scenarios; none: all."""
    arm: str = PANDA
    """Name of the arm, or the folder of an imported one."""

    def __post_init__(self) -> None:
        if len(set(self.baselines)) < len(self.baselines):
            raise ExperimentError(f"The baselines are {', '.join(self.baselines)}: name each once.")
        for baseline in self.baselines:
            profile_text(baseline)
        if self.arm != PANDA:
            place(self.arm)  # what cannot be placed is said before any process starts
        for name in self.names:
            if name not in scenarios():
                raise ExperimentError(f"The scenario {name!r} is unknown: choose from {', '.join(scenarios())}.")

    def scenes(self) -> list[Scenario]:
        """Return the scenarios that are played."""
        wanted = self.names or tuple(scenarios())
        return [s for name, s in scenarios().items() if name in wanted and s.seeds(self.seeds, self.quick)]

    def choices(self) -> Row:
        """See `Bench`; a quick run shares its trials with a full one."""
        other = {} if self.arm == PANDA else {"arm": self.arm, "arm_sha256": files_digest(robot_named(self.arm))}
        return {"seeds": self.seeds, "world": self.world, **other}

    def stages(self) -> list[list[Task]]:
        """Return all trials, by scenario, baseline and seed."""
        played = [
            (scene, baseline, seed)
            for scene in self.scenes()
            for baseline in self.baselines or BASELINES
            for seed in scene.seeds(self.seeds, self.quick)
        ]
        ablated = [
            (scene, baseline, seed)
            for scene in self.scenes()
            for baseline in (() if self.baselines else ABLATED)
            for seed in (scene.seeds(self.seeds, self.quick)[:ABLATED_SEEDS] if scene.name in ABLATED_IN else ())
        ]
        return [[_task(self, *trial) for trial in (*played, *ablated)]]

    def rows(self) -> list[Row]:
        """Return the rows of all finished trials."""
        return rows_of(self.every())

    def found(self) -> Found | None:
        """See `Bench`."""
        rows = self.rows()
        if not rows:
            return None
        summary = summarise(rows)
        counts = [cell["trials"] for cell in summary["cells"]]
        resolution = f"Resolution: {min(counts)} to {max(counts)} trials a cell, {self.seeds} seeds."
        trials = sum(counts) + sum(cell["trials"] for cell in summary["ablations"] if cell["contender"] != BASE)
        about = (
            f"{trials} trials with {self.seeds} seeds. Contenders: `blind` without proximity; `flacco` and `ding` as"
            " published, and each with another tuning ([baselines](../explanation/baselines.md)); `paper` with its"
            " restrictions, soft; `paper-off` without them."
        )
        scenes = [
            f"- **{family}**: {text}"
            for family, text in {s.family: s.text for s in scenarios().values()}.items()
            if any(cell["family"] == family for cell in summary["cells"])
        ]
        text = "\n\n".join([about, "\n".join(scenes)])
        return Found(results(summary, self), tables(summary), resolution, text)


def _task(bench: AvoidanceBench, scene: Scenario, baseline: str, seed: int) -> Task:
    digest = sha256(f"{baseline} {scene.name}".encode()).hexdigest()[:6]
    plain = re.sub(r"[^A-Za-z0-9.-]+", "-", f"{scene.name}_{baseline}")[:60]
    file = bench.out / "trials" / f"{plain}_{digest}_{seed:04d}.json"
    return Task(file, partial(keep_trial, scene.name, baseline, seed, bench.world, bench.arm), _cost(scene, baseline))


def _cost(scene: Scenario, baseline: str) -> float:
    """Processor time, about [s]; the board is met soon, and a turn is quick, where little is done before a contact."""
    soon = baseline in _SOON and ("after_contact_s" in scene.params or "turns" in scene.params)
    return _COST * float(scene.params["duration_s"]) * (0.4 if soon else 1.0)


_COST = 0.15
"""Processor time of a simulated second, measuring included [s]."""
_SOON = ("blind", "pretouch", *ABLATED)
