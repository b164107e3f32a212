"""One piece of work, as text in and text out, so that a worker process or a cluster is handed data and gives data."""

import json
import time
from dataclasses import dataclass
from hashlib import sha256
from threading import Lock
from typing import Any

from pretouch.checks import Checked
from pretouch.errors import ExperimentError, PretouchError
from pretouch_lab.result_key import result_key
from pretouch_lab.sweep.definition import Sweep
from pretouch_lab.sweep.design import Point
from pretouch_lab.sweep.registry import measure
from pretouch_lab.sweep.setting import Setting, Values, built, world_digest

_ONE_AT_A_TIME = Lock()
"""Threads of a cluster's worker share the models that MuJoCo computes in."""


def code(experiment: str) -> str:
    """Return the key of what decides the numbers of an experiment, its parameters aside."""
    what = measure(experiment)
    return result_key(what.run, *([what.shared] if what.shared else []), built)


@dataclass(frozen=True)
class Cell:
    """One cell to play."""

    key: str
    """Digest of all that decides what comes out: it names the cell's file."""
    values: Values
    """Of what is varied and what is fixed."""
    seed: int
    cost_s: float
    """Processor time, about [s]."""


@dataclass(frozen=True)
class Job:
    """Cells that are played by one worker one after the other, because they have a recorded stream in common."""

    experiment: str
    profile: str
    cells: tuple[Cell, ...]
    shared_cost_s: float = 0.0

    @property
    def cost_s(self) -> float:
        """Processor time, about [s]."""
        return self.shared_cost_s + sum(cell.cost_s for cell in self.cells)

    def written(self) -> str:
        """Return what a worker is handed."""
        cells = [{"key": cell.key, "values": cell.values, "seed": cell.seed} for cell in self.cells]
        about = {"experiment": self.experiment, "profile": self.profile, "code": code(self.experiment)}
        return json.dumps({**about, "cells": cells})


def cell_of(sweep: Sweep, point: Point) -> Cell:
    """Return a design point as a cell to play."""
    values = dict(sorted((sweep.fixed | point.values).items()))
    whole = [sweep.experiment, sweep.profile, code(sweep.experiment), values, point.seed, world_digest(values)]
    key = sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()[:24]
    return Cell(key, values, point.seed, sweep.measure.cost_s(sweep.setting(point.values, point.seed)))


def jobs_of(sweep: Sweep, wanted: list[Cell]) -> list[Job]:
    """Group cells that share what is recorded; each cell is its own job where nothing is."""
    what = sweep.measure
    if what.shared is None:
        return [Job(sweep.experiment, sweep.profile, (cell,)) for cell in wanted]
    together: dict[str, tuple[Setting, list[Cell]]] = {}
    for cell in wanted:
        setting = built(sweep.profile, what.scene, cell.values, cell.seed)
        together.setdefault(setting.world, (setting, []))[1].append(cell)
    return [
        Job(sweep.experiment, sweep.profile, tuple(cells), what.shared_cost_s(setting))
        for setting, cells in together.values()
    ]


def work(text: str) -> str:
    """Play the cells of a job; what fails is reported with its reason, and stops no other."""
    job = json.loads(text)
    here = code(job["experiment"])
    if job["code"] != here:
        reason = (
            f"The worker has another version of pretouch or of a library ({here}, not {job['code']}): install the same"
            " there."
        )
        return json.dumps([{"key": cell["key"], "reason": reason, "seconds": 0.0} for cell in job["cells"]])
    with _ONE_AT_A_TIME:
        return json.dumps(_play(job), allow_nan=False)


def _play(job: dict[str, Any]) -> list[dict[str, Any]]:
    what, shared, rows = measure(job["experiment"]), None, []
    trouble = ""
    for number, cell in enumerate(job["cells"]):
        start = time.perf_counter()
        row: dict[str, Any] = {"key": cell["key"]}
        try:
            setting = _setting(what.scene, job["profile"], cell)
            if number == 0 and what.shared:
                shared = what.shared(setting)
            if trouble:
                raise ExperimentError(trouble)
            row["metrics"] = what.run(setting, shared)
        except Exception as error:  # whatever a cell does, it is written down and the others go on
            said = str(error) if isinstance(error, PretouchError) else f"{type(error).__name__}: {error}"
            row["reason"] = said or type(error).__name__
            if what.shared and shared is None:
                trouble = row["reason"]
        rows.append(row | {"seconds": round(time.perf_counter() - start, 4)})
    return rows


def _setting(scene: Checked, profile: str, cell: dict[str, Any]) -> Setting:
    return built(profile, scene, cell["values"], cell["seed"])
