"""The calibration of many random skins, in parallel processes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.motion.planner import plan_motion
from pretouch.errors import ExperimentError
from pretouch.robot.description import RobotDescription
from pretouch.robot.model import RobotModel
from pretouch.sim.random_skin import random_skin
from pretouch_lab.engine import run_jobs
from pretouch_lab.run import Row
from pretouch_lab.studies.calibration.errors import NOT_FOUND, place_row
from pretouch_lab.studies.calibration.simulated import clock_errors, simulate


@dataclass(frozen=True, eq=False)
class Study:
    """What the calibration made of all skins."""

    rows: list[Row]
    """One a unit, in the order of the skins."""
    motion_s: float
    """Duration of the motion [s]."""
    compute_s: float
    """Median computing time of a skin, from measured signals to poses [s]."""


def study(
    model: RobotModel, skins: int = 20, seed: int = 0, links_known: bool = True, plan: Plan | None = None,
    processes: int | None = None, progress: Callable[[], None] = lambda: None,
) -> Study:  # fmt: skip
    """Calibrate random skins in simulation.

    Args:
        model: the arm.
        skins: how many; each has one unit on each link from the second on.
        seed: of the first skin, its arm and its sensors; the next skins take the next seeds.
        links_known: whether the calibration is given each unit's link, or has to find it.
        plan: the motion, if not the one that is planned by default.
        processes: that compute at once; None: one a processor.
        progress: called after each simulation.
    """
    if skins < 1:
        raise ExperimentError(f"The number of skins is {skins}: give at least 1.")
    motion = plan or plan_motion(model)
    tasks = [_Task(model.description, skin, seed, motion, links_known) for skin in range(skins)]
    answers: dict[int, tuple[list[Row], float]] = {}

    def done(task: _Task, answer: tuple[list[Row], float]) -> None:
        answers[task.skin] = answer
        progress()

    run_jobs(tasks, _Task.run, processes, done)
    rows = [row for skin in range(skins) for row in answers[skin][0]]
    return Study(rows, motion.duration, float(np.median([took for _, took in answers.values()])))


@dataclass(frozen=True, eq=False)
class _Task:
    """One simulation, for a worker process."""

    description: RobotDescription
    skin: int
    seed: int
    plan: Plan
    links_known: bool

    def run(self) -> tuple[list[Row], float]:
        """Simulate it, and calibrate; return a row for each unit, and how long the calibration took [s]."""
        model, seed = RobotModel(self.description), self.seed + self.skin
        skin = random_skin(model, seed)
        data = simulate(model, skin, self.plan, seed)
        if not self.links_known:
            data = replace(data, units=tuple(replace(unit, link=None) for unit in data.units))
        begin = perf_counter()
        found = calibrate(model, data).units
        took = perf_counter() - begin
        rows = [
            {"skin": self.skin, "unit": unit.id, "link": unit.link, "accepted": answer.accepted}
            | (place_row(model, unit, answer.place, late) if answer.place else NOT_FOUND)
            for unit, answer, late in zip(skin.units, found, clock_errors(len(skin), seed).tolist(), strict=True)
        ]
        return rows, took
