"""A recording as arrays: all that a report tells of it, read in one pass."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby, islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.explanation import answers
from pretouch.recording.reader import Kept, Recorded
from pretouch.recording.run import Run
from pretouch.recording.run_record import Columns, RunRecord, TrueForces, columns_of, contacts_of
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray, IntArray, QpOutcome, RangeReadings

OUTCOMES = tuple(QpOutcome)
"""Outcomes by the numbers in `RunCourse.outcome`."""
NO_READING = -1
"""Stands in `RunCourse.reading_status` where there is no reading."""
_BATCH = 4096
"""Cycles that are objects at a time: an hour of them fits into memory as arrays only."""


@dataclass(frozen=True, kw_only=True)
class RunCourse(RunRecord):
    """S control cycles of one recording, with n joints, K units and L links. Base frame; NaN where there is nothing."""

    runs: tuple[Run, ...]
    """All with the same arm and the same skin."""
    run: IntArray
    """(S,) index of the run."""
    event: NDArray[np.object_]
    """(S,) `Event` that made the mode so."""
    reason: NDArray[np.object_]
    """(S,) sentences."""
    q: FloatArray
    """(S, n) measured positions [rad]."""
    q_commanded: FloatArray
    """(S, n) [rad]"""
    command: FloatArray
    """(S, n) [rad/s]"""
    body_distance: FloatArray
    """(S, K) distance of what each unit showed from the surface of the body [m]."""
    link_distance: FloatArray
    """(S, L) least distance of anything sensed from the surface of each link, where that link was the closest [m]."""
    ee_distance: FloatArray
    """(S,) distance of `nearest_point` from the end-effector's origin, less its spread [m]."""
    answering: BoolArray
    """(S,) whether the arm moves with a contact."""
    detectable_n: FloatArray
    """(S,) force at the end-effector that is detected if it lasts for 0.1 s [N]."""
    restricted: IntArray
    """(S,) how many obstacles restrict the arm."""
    outcome: IntArray
    """(S,) index in `OUTCOMES`."""
    slack: FloatArray
    """(S,) largest violation of an approach row [m/s], 0 without rows."""
    with_inputs: BoolArray
    """(S,) whether the inputs of the step are in the recording."""
    robot_stamp: FloatArray
    """(S,) of the robot state among the inputs [s]"""
    force_missing: BoolArray
    """(S,) whether that state had no force estimate."""
    reading_stamp: FloatArray
    """(S, K) of the readings among the inputs [s]"""
    reading_distance: FloatArray
    """(S, K) [m]"""
    reading_status: IntArray
    """(S, K) `RangeStatus` codes, `NO_READING` for none."""

    @property
    def model(self) -> RobotModel:
        """The arm."""
        return self.runs[0].model

    @property
    def units(self) -> tuple[str, ...]:
        """Names of the units, in order."""
        return self.runs[0].skin.ids

    @property
    def lasted(self) -> FloatArray:
        """Duration of each step (S,) until the next one; the median for the last [s]."""
        if len(self) < 2:
            return np.zeros(len(self))
        steps = np.maximum(np.diff(self.time), 0.0)
        return np.append(steps, np.median(steps))

    @property
    def proximity_used(self) -> bool:
        """True if any of the profiles uses the units' readings."""
        return any(run.profile.perception is not None for run in self.runs)

    @property
    def by_thresholds(self) -> bool:
        """True if any of the profiles detects contacts by the paper's thresholds."""
        return any(isinstance(run.profile.detect, MovingThresholds) for run in self.runs)

    @property
    def profile_names(self) -> tuple[str, ...]:
        """Names of the profiles that ran, each once."""
        return tuple(dict.fromkeys(run.profile.name for run in self.runs))

    def of_runs(self, value: Callable[[Run], float]) -> FloatArray:
        """Value (S,) that each step's run has."""
        return np.array([value(run) for run in self.runs], dtype=np.float64)[self.run]


def gather(recorded: Recorded) -> RunCourse:
    """Read all cycles of a recording."""
    blocks, contacts, touches, count = list[Columns](), [], [], 0
    times, forces = list[FloatArray](), list[FloatArray]()
    model, units = recorded.runs[0].model, len(recorded.runs[0].skin)
    for _, cycles in groupby(recorded, key=lambda cycle: cycle.run):
        while batch := list(islice(cycles, _BATCH)):
            blocks.append(_block(batch, len(model.links), units))
            contacts += contacts_of([cycle.step for cycle in batch], count)
            count += len(batch)
            if truths := [cycle.truth for cycle in batch if cycle.truth is not None]:
                times.append(np.concatenate([truth.time for truth in truths]))
                forces.append(np.concatenate([truth.force for truth in truths]))
                touches += [(time, model.links[link], velocity) for t in truths for time, link, velocity in t.touches]
    columns = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    truth = TrueForces(np.concatenate(times), np.concatenate(forces), tuple(touches)) if times else None
    return RunCourse(runs=tuple(recorded.runs), contacts=tuple(contacts), truth=truth, **columns)


def _block(batch: list[Kept], links: int, units: int) -> Columns:
    """Arrays of a batch of one run."""
    steps = [cycle.step for cycle in batch]
    return {
        **columns_of(steps, "q", "q_commanded", "command", "detectable_n"),
        "run": np.full(len(batch), batch[0].run),
        "event": np.array([step.event for step in steps], dtype=object),
        "reason": np.array([step.reason for step in steps], dtype=object),
        "answering": np.array([answers(step) for step in steps]),
        "restricted": np.array([len(step.restricted) for step in steps]),
        "outcome": np.array([OUTCOMES.index(step.qp.outcome) for step in steps]),
        "slack": np.array([np.max(step.qp.slack, initial=0.0) for step in steps]),
        **_near(batch, links, units),
        **_inputs(batch, units),
    }


def _near(batch: list[Kept], links: int, units: int) -> Columns:
    """Least sensed distance of each step by unit, by link and from the end-effector."""
    obstacles = [cycle.step.obstacles for cycle in batch]
    row = np.repeat(np.arange(len(obstacles)), [len(o.unit) for o in obstacles])
    unit = np.concatenate([o.unit for o in obstacles])
    link = np.concatenate([o.link for o in obstacles])
    body = np.concatenate([o.body_distance for o in obstacles])
    ee = np.concatenate([o.ee_distance for o in obstacles])
    by_unit, by_link, nearest = (np.full((len(obstacles), *shape), np.nan) for shape in ((units,), (links,), ()))
    own = unit < units  # what outside sources see is of no unit
    np.fmin.at(by_unit, (row[own], unit[own]), body[own])
    np.fmin.at(by_link, (row, link), body)
    np.fmin.at(nearest, row, np.where(np.isinf(ee), np.nan, ee))  # of fixtures that move it is infinite
    return {"body_distance": by_unit, "link_distance": by_link, "ee_distance": nearest}


def _inputs(batch: list[Kept], units: int) -> Columns:
    """Inputs of the steps; those that a controller could not use may hold anything."""
    inputs = [cycle.inputs for cycle in batch]
    lacking = RangeReadings(np.full(units, np.nan), np.full(units, np.nan), np.full(units, NO_READING))
    readings = [lacking if i is None else i.readings for i in inputs]
    names = ("stamp", "distance", "status")
    readings = [r if all(np.shape(getattr(r, n)) == (units,) for n in names) else lacking for r in readings]
    return {
        "with_inputs": np.array([i is not None for i in inputs]),
        "robot_stamp": np.array([np.nan if i is None else float(i.robot.stamp) for i in inputs]),
        "force_missing": np.array([i is not None and i.robot.wrench is None for i in inputs]),
        "reading_stamp": np.array([r.stamp for r in readings]),
        "reading_distance": np.array([r.distance for r in readings]),
        "reading_status": np.array([r.status for r in readings]),
    }


class Percentiles(NamedTuple):
    """Percentiles of some numbers; NaN for none."""

    median: float
    p99: float
    max: float


def spread(values: FloatArray) -> Percentiles:
    """Return median, 99 % and largest of the finite ones of some values."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return Percentiles(np.nan, np.nan, np.nan)
    median, p99 = np.percentile(finite, [50, 99])
    return Percentiles(float(median), float(p99), float(finite.max()))


def least(values: FloatArray) -> tuple[float, int] | None:
    """Least of the finite ones of some values (S,) and where it is, None of none."""
    finite = np.where(np.isfinite(values), values, np.inf)
    place = int(np.argmin(finite))
    return (float(finite[place]), place) if np.isfinite(finite[place]) else None
