"""Both calibrations of many random skins, each by both motions, in parallel processes."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.data import CalibrationData
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.motion.planner import plan_motion
from pretouch.errors import ExperimentError
from pretouch.robot.description import RobotDescription
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch_lab.engine import run_jobs
from pretouch_lab.rows import Row
from pretouch_lab.studies.calibration.errors import NOT_FOUND, error_row, place_row, pose_error
from pretouch_lab.studies.calibration.random_skin import random_skin
from pretouch_lab.studies.calibration.simulated import DATA_SHEET, clock_errors, simulate
from pretouch_lab.studies.calibration.swings import watanabe_plan
from pretouch_lab.studies.calibration.watanabe import watanabe

OURS, WATANABE = "pretouch", "Watanabe et al."
"""Names of methods and of motions."""
WATANABE_UNBIASED = "the same, no bias or scale error"
"""Name of their method with accelerometers that err by noise, counts and clocks only: what it was made for."""
_UNBIASED = replace(DATA_SHEET, acceleration_bias_mg=0.0, scale_error=0.0)


@dataclass(frozen=True, eq=False)
class Trial:
    """What one method made of one skin on one motion."""

    skin: int
    method: str
    motion: str
    rows: list[Row]
    """One a unit."""
    compute_s: float
    """For all units of the skin, from measured signals to poses [s]."""


@dataclass(frozen=True, eq=False)
class Study:
    """All trials, in the order of the skins."""

    trials: list[Trial]
    motion_s: dict[str, float]
    """Duration of each motion [s]."""

    def of(self, method: str, motion: str) -> list[Trial]:
        """Return the trials of one method on one motion."""
        return [trial for trial in self.trials if (trial.method, trial.motion) == (method, motion)]

    def rows(self, method: str = OURS, motion: str = OURS) -> list[Row]:
        """Return one row a unit, of one method on one motion."""
        return [row for trial in self.of(method, motion) for row in trial.rows]

    def compute_s(self, method: str = OURS, motion: str = OURS) -> float:
        """Return the computing time of a skin, the median [s]."""
        return float(np.median([trial.compute_s for trial in self.of(method, motion)]))

    def as_json(self) -> dict[str, Any]:
        """Return our own rows, motion and computing time, and the rows of the other pairs of method and motion."""
        pairs = list(dict.fromkeys((trial.method, trial.motion) for trial in self.trials))
        return {
            "rows": self.rows(),
            "motion_s": self.motion_s[OURS],
            "compute_s": self.compute_s(),
            "compared": [
                {
                    "method": method,
                    "motion": motion,
                    "motion_s": self.motion_s[motion],
                    "compute_s": self.compute_s(method, motion),
                    "rows": self.rows(method, motion),
                }
                for method, motion in pairs
                if (method, motion) != (OURS, OURS)
            ],
        }


def study(
    model: RobotModel, skins: int = 20, seed: int = 0, compared: bool = True, links_known: bool = True,
    plan: Plan | None = None, processes: int | None = None, progress: Callable[[], None] = lambda: None,
) -> Study:  # fmt: skip
    """Calibrate random skins in simulation.

    Args:
        model: the arm.
        skins: how many; each has one unit on each link from the second on.
        seed: of the first skin, its arm and its sensors; the next skins take the next seeds.
        compared: also with the method and the motion of Watanabe et al.
        links_known: whether the calibration is given each unit's link, or has to find it. Watanabe et al. are given it.
        plan: our motion, if not the one that is planned by default.
        processes: that compute at once; None: one a processor.
        progress: called after each simulation.
    """
    if skins < 1:
        raise ExperimentError(f"The number of skins is {skins}: give at least 1.")
    plans = {OURS: plan or plan_motion(model)} | ({WATANABE: watanabe_plan(model)} if compared else {})
    tasks = [
        _Task(model.description, skin, seed, motion, planned, compared, links_known)
        for skin in range(skins)
        for motion, planned in plans.items()
    ]
    made = _run(tasks, min(len(tasks), processes or os.cpu_count() or 1), progress)
    return Study(made, {motion: planned.duration for motion, planned in plans.items()})


def _run(tasks: "list[_Task]", processes: int, progress: Callable[[], None]) -> list[Trial]:
    """Run all tasks in parallel processes; the trials come in the order of the tasks."""
    made: dict[int, list[Trial]] = {}

    def done(task: _Task, trials: list[Trial]) -> None:
        made[id(task)] = trials
        progress()

    def lost(_task: _Task, reason: str) -> None:
        raise ExperimentError(f"{reason} Use fewer processes.")

    run_jobs(tasks, lambda task: (_Task.run, task), processes, done, lost)
    return [trial for task in tasks for trial in made[id(task)]]


@dataclass(frozen=True, eq=False)
class _Task:
    """One simulation, for a worker process."""

    description: RobotDescription
    skin: int
    seed: int
    motion: str
    plan: Plan
    compared: bool
    links_known: bool

    def run(self) -> list[Trial]:
        """Simulate it, and calibrate."""
        model, seed = RobotModel(self.description), self.seed + self.skin
        skin = random_skin(model, seed)
        data = simulate(model, skin, self.plan, seed)
        trials = [self._trial(OURS, *_ours(model, skin, data, seed, self.links_known))]
        if self.compared:
            trials.append(self._trial(WATANABE, *_watanabes(model, skin, data, self.plan)))
        if self.compared and self.motion == WATANABE:
            data = simulate(model, skin, self.plan, seed, _UNBIASED)
            trials.append(self._trial(WATANABE_UNBIASED, *_watanabes(model, skin, data, self.plan)))
        return trials

    def _trial(self, method: str, rows: list[Row], took: float) -> Trial:
        return Trial(self.skin, method, self.motion, [{"skin": self.skin} | row for row in rows], took)


def _ours(
    model: RobotModel, skin: Skin, data: CalibrationData, seed: int, links_known: bool
) -> tuple[list[Row], float]:
    """Calibrate as this package does; return a row for each unit, and how long it took [s]."""
    if not links_known:
        data = replace(data, units=tuple(replace(unit, link=None) for unit in data.units))
    begin = perf_counter()
    found = calibrate(model, data).units
    took = perf_counter() - begin
    rows = [
        {"unit": unit.id, "link": unit.link, "accepted": answer.accepted}
        | (place_row(model, unit, answer.place, late) if answer.place else NOT_FOUND)
        for unit, answer, late in zip(skin.units, found, clock_errors(len(skin), seed).tolist(), strict=True)
    ]
    return rows, took


def _watanabes(model: RobotModel, skin: Skin, data: CalibrationData, plan: Plan) -> tuple[list[Row], float]:
    """Calibrate as Watanabe et al. do; return a row for each unit, and how long it took [s]."""
    begin = perf_counter()
    poses = watanabe(model, data, plan.still)
    took = perf_counter() - begin
    rows = [
        {"unit": unit.id, "link": unit.link} | error_row(pose_error(unit.T_link_sensor, pose))
        for unit, pose in zip(skin.units, poses, strict=True)
    ]
    return rows, took
