"""The record of a run with all that a report tells of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.modes import Event
from pretouch.recording.run_record import RunRecord
from pretouch.types import BoolArray, FloatArray, IntArray, QpOutcome

if TYPE_CHECKING:
    from pretouch.recording.reader import Run

OUTCOMES = tuple(QpOutcome)
"""What the numbers in `Course.outcome` stand for."""
NO_READING = -1
"""Stands in `Course.reading_status` where there is no reading."""


@dataclass(frozen=True, kw_only=True)
class Course(RunRecord):
    """S control cycles of one recording, with n joints, K units and L links. Base frame; NaN where there is nothing."""

    runs: tuple["Run", ...]
    units: tuple[str, ...]
    """Names of the units of all skins that were worn, in order."""
    links: tuple[str, ...]
    """Names of the links of the arm."""
    run: IntArray
    """(S,) index of the run."""
    event: tuple[Event, ...]
    """S, what made the mode so."""
    reason: tuple[str, ...]
    """S sentences."""
    body_distance: FloatArray
    """(S, K) distance of what each unit showed from the surface of the body [m]."""
    link_distance: FloatArray
    """(S, L) least distance of anything sensed from the surface of each link, where that link was the closest [m]."""
    ee_distance: FloatArray
    """(S,) distance of the nearest sensed point from the end-effector's origin [m]."""
    nearest_point: FloatArray
    """(S, 3) that point [m]."""
    answering: BoolArray
    """(S,) whether the arm moves with a contact."""
    detectable_n: FloatArray
    """(S,) force at the end-effector that is found if it is held for 0.1 s [N]."""
    restricted: IntArray
    """(S,) how many obstacles restrict the arm."""
    q_margin: FloatArray
    """(S, n) distance of the commanded positions from the nearer position limit [rad], negative beyond it."""
    q_margin_measured: FloatArray
    """(S, n) the same of the measured positions [rad]."""
    command: FloatArray
    """(S, n) [rad/s]"""
    speed_limit: FloatArray
    """(S, n) what the arm allows each joint at its position in the direction of its command [rad/s]."""
    outcome: IntArray
    """(S,) index in `OUTCOMES`."""
    slack: FloatArray
    """(S,) largest violation of an approach row [m/s], 0 without rows."""
    given: BoolArray
    """(S,) whether the inputs of the step were kept."""
    robot_stamp: FloatArray
    """(S,) of the robot state a step was given [s]"""
    force_missing: BoolArray
    """(S,) whether that state had no force estimate."""
    reading_stamp: FloatArray
    """(S, K) of the readings a step was given [s]"""
    reading_distance: FloatArray
    """(S, K) [m]"""
    reading_status: IntArray
    """(S, K) `RangeStatus` codes, `NO_READING` for none."""

    @property
    def proximity_used(self) -> bool:
        """Whether any of the profiles looks at what the units say."""
        return any(run.profile.perception is not None for run in self.runs)

    @property
    def by_thresholds(self) -> bool:
        """Whether any of the profiles detects contacts by the paper's thresholds."""
        return any(isinstance(run.profile.detect, MovingThresholds) for run in self.runs)

    def of_runs(self, value: Callable[["Run"], float]) -> FloatArray:
        """Value (S,) that each step's run has."""
        return np.array([value(run) for run in self.runs], dtype=np.float64)[self.run]
