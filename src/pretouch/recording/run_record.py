"""The record of a run as arrays: what reports, figures and comparisons of detectors are made from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pretouch.types import BoolArray, Contact, ControlStep, FloatArray, IntArray, Mode, Obstacles

MODES = tuple(Mode)
"""Modes by the numbers in `RunRecord.mode`."""

Columns = dict[str, NDArray[Any]]
"""Arrays by the names of the fields that they are of."""


@dataclass(frozen=True)
class TrueForces:
    """True forces on the arm, from a simulation."""

    time: FloatArray
    """(M,) instants of the physics [s]."""
    force: FloatArray
    """(M, 3) true contact force on the arm [N], base frame."""
    touches: tuple[tuple[float, str, FloatArray], ...] = ()
    """Beginnings of contacts: instant [s], name of the link, (3,) velocity of the touching point [m/s]."""


def _threshold_part(row: int, what: str) -> property:
    return property(lambda record: record.thresholds[:, row], doc=what)


@dataclass(frozen=True, kw_only=True)
class DetectorRecord:
    """Inputs of a contact detector and its thresholds in S cycles. Forces on the robot, base frame."""

    time: FloatArray
    """(S,) [s]."""
    force: FloatArray
    """(S, 3) estimate of each cycle [N], NaN without one."""
    thresholds: FloatArray
    """(S, 6, 3) thresholds and what they are made of, the rows of `Thresholds` [N]."""
    armed: BoolArray
    """(S,) whether the force window was full."""

    def __len__(self) -> int:
        return len(self.time)

    upper = _threshold_part(0, "(S, 3) T_u of eq. 9.")
    lower = _threshold_part(1, "(S, 3) T_l of eq. 9.")
    mean = _threshold_part(2, "(S, 3) mean of the force window.")
    sigma = _threshold_part(3, "(S, 3) standard deviation of the force window.")
    obstacle_positive = _threshold_part(4, "(S, 3) F_obs+ of eq. 11, by which the lower threshold is raised.")
    obstacle_negative = _threshold_part(5, "(S, 3) F_obs-, by which the upper threshold is lowered.")


@dataclass(frozen=True, kw_only=True)
class RunRecord(DetectorRecord):
    """S control steps of an arm with K units. Base frame; NaN where there is nothing."""

    mode: IntArray
    """(S,) index in `MODES`."""
    ee_position: FloatArray
    """(S, 3) [m]."""
    ee_velocity: FloatArray
    """(S, 3) [m/s]."""
    path_position: FloatArray
    """(S, 3) [m]."""
    speed_scale: FloatArray
    """(S,) factor on the speed along the path, eqs. 3 and 4."""
    range_distance: FloatArray
    """(S, K) readings used [m]."""
    nearest_point: FloatArray
    """(S, 3) obstacle nearest to the end-effector's origin [m]; fixtures that move are left out."""
    filtered_force: FloatArray
    """(S, 3) value of eq. 8 [N]."""
    evidence: FloatArray
    """(S,) how far the detector was on the way to a contact, one from 1 on."""
    contacts: tuple[tuple[int, Contact, float], ...]
    """Detections: index of the step, contact, speed of the reaction [m/s]."""
    truth: TrueForces | None
    """True forces; None where they are unknown."""

    @property
    def speed(self) -> FloatArray:
        """(S,) of the end-effector [m/s]."""
        return np.linalg.norm(self.ee_velocity, axis=1)

    @property
    def reacting(self) -> BoolArray:
        """(S,) whether a reaction is under way."""
        return np.asarray(self.mode == MODES.index(Mode.REACT))

    @property
    def detected(self) -> BoolArray:
        """(S,) whether a contact was found in a step."""
        flags = np.zeros(len(self), dtype=np.bool_)
        flags[[i for i, _, _ in self.contacts]] = True
        return flags

    @property
    def true_force(self) -> FloatArray:
        """(S, 3) mean true force since the step before [N]; zero where no instant of the physics lies between."""
        if self.truth is None:
            return np.full((len(self), 3), np.nan)
        edges = np.searchsorted(self.truth.time, self.time, side="right")
        summed = np.vstack([np.zeros(3), np.cumsum(self.truth.force, axis=0)])
        starts = np.concatenate([[0], edges[:-1]])
        return np.asarray((summed[edges] - summed[starts]) / np.maximum(edges - starts, 1)[:, None])


_AS_THEY_ARE = """
ee_position ee_velocity path_position speed_scale range_distance force filtered_force evidence armed
"""


def columns_of(steps: Sequence[ControlStep], *more: str) -> Columns:
    """Return the arrays of a `RunRecord` that steps with the same units tell alone, and those of `more` fields."""
    columns: Columns = {
        name: np.array([getattr(step, name) for step in steps]) for name in (*_AS_THEY_ARE.split(), *more)
    }
    return columns | {
        "time": np.array([step.stamp for step in steps]),
        "mode": np.array([MODES.index(step.mode) for step in steps]),
        "thresholds": np.array([step.thresholds for step in steps]),
        "nearest_point": np.array([_nearest(step.obstacles) for step in steps]),
    }


def _nearest(obstacles: Obstacles) -> FloatArray:
    finite = np.flatnonzero(np.isfinite(obstacles.ee_distance))
    return obstacles.point[finite[obstacles.ee_distance[finite].argmin()]] if len(finite) else np.full(3, np.nan)


def contacts_of(steps: Sequence[ControlStep], first: int = 0) -> list[tuple[int, Contact, float]]:
    """Return the contacts found in steps, the index of which begins with `first`, and the reactions' speeds [m/s]."""
    return [
        (i, step.contact, float(np.linalg.norm(step.reaction_velocity)))
        for i, step in enumerate(steps, first)
        if step.contact is not None
    ]
