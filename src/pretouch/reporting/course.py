"""The course of one recording as arrays: what all measures and figures of a report are made from."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.types import BoolArray, Contact, FloatArray, IntArray, Mode, QpOutcome

if TYPE_CHECKING:
    from pretouch.recording.reader import Run

MODES = tuple(Mode)
"""What the numbers in `Course.mode` stand for."""
OUTCOMES = tuple(QpOutcome)
"""What the numbers in `Course.outcome` stand for."""
NO_READING = -1
"""Stands in `Course.reading_status` where there is no reading."""


@dataclass(frozen=True)
class Truth:
    """What a simulation knows of the forces on the arm."""

    time: FloatArray
    """(M,) instants of the physics [s]."""
    force: FloatArray
    """(M, 3) true contact force on the arm [N], base frame."""
    touches: tuple[tuple[float, str, FloatArray], ...]
    """Beginnings of contacts: instant [s], name of the link, (3,) velocity of the touching point [m/s]."""


@dataclass(frozen=True)
class Course:
    """S control cycles of one recording, with n joints, U units and L links. Base frame; NaN where there is nothing."""

    runs: tuple["Run", ...]
    units: tuple[str, ...]
    """Names of the units of all skins that were worn, in order."""
    links: tuple[str, ...]
    """Names of the links of the arm."""
    time: FloatArray
    """(S,) stamps of the steps [s]."""
    run: IntArray
    """(S,) index of the run."""
    mode: IntArray
    """(S,) index in `MODES`."""
    reason: tuple[str, ...]
    """S sentences."""
    ee_position: FloatArray
    """(S, 3) [m]"""
    path_position: FloatArray
    """(S, 3) [m]"""
    speed: FloatArray
    """(S,) of the end-effector [m/s]"""
    speed_scale: FloatArray
    """(S,) factor on the speed along the path, eqs. 3 and 4."""
    force: FloatArray
    """(S, 3) estimate [N]"""
    filtered: FloatArray
    """(S, 3) value of eq. 8 [N]"""
    upper: FloatArray
    """(S, 3) threshold [N]"""
    lower: FloatArray
    """(S, 3) threshold [N]"""
    sigma: FloatArray
    """(S, 3) standard deviation of the force window [N]"""
    evidence: FloatArray
    """(S,) how far the detector was on the way to a contact, one from 1 on."""
    armed: BoolArray
    """(S,)"""
    contacts: tuple[tuple[int, Contact, float], ...]
    """Detections: index of the step, contact, speed of the reaction [m/s]."""
    body_distance: FloatArray
    """(S, U) distance of what each unit showed from the surface of the body [m]."""
    link_distance: FloatArray
    """(S, L) least distance of anything sensed from the surface of each link, where that link was the closest [m]."""
    ee_distance: FloatArray
    """(S,) distance of the nearest sensed point from the end-effector's origin [m]."""
    nearest_point: FloatArray
    """(S, 3) that point [m]."""
    range_distance: FloatArray
    """(S, U) readings used [m]"""
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
    """(S, U) of the readings a step was given [s]"""
    reading_distance: FloatArray
    """(S, U) [m]"""
    reading_status: IntArray
    """(S, U) `RangeStatus` codes, `NO_READING` for none."""
    truth: Truth | None

    def __len__(self) -> int:
        return len(self.time)

    @property
    def proximity_used(self) -> bool:
        """Whether any of the profiles looks at what the units say."""
        return any(run.profile.perception.enabled for run in self.runs)

    @property
    def by_thresholds(self) -> bool:
        """Whether any of the profiles feels contacts by the paper's thresholds."""
        return any(isinstance(run.profile.detect, MovingThresholds) for run in self.runs)

    def of_runs(self, value: Callable[["Run"], float]) -> FloatArray:
        """Value (S,) that each step's run has."""
        return np.array([value(run) for run in self.runs], dtype=np.float64)[self.run]
