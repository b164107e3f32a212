"""The course of one trial as arrays: what figures are drawn from."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pretouch.errors import RecordingError
from pretouch.perception.obstacles import points_of_units
from pretouch.recording.reader import open_recording
from pretouch.types import BoolArray, ControlStep, FloatArray, Mode
from pretouch_lab.trial import Record, record_of


@dataclass(frozen=True)
class Trace:
    """S control steps of one trial. Base frame."""

    time: FloatArray
    """(S,) [s]"""
    ee_position: FloatArray
    """(S, 3) [m]"""
    ee_velocity: FloatArray
    """(S, 3) [m/s]"""
    path_position: FloatArray
    """(S, 3) [m]"""
    speed_scale: FloatArray
    """(S,)"""
    range_distance: FloatArray
    """(S, K) [m], NaN for no target"""
    sensed_point: FloatArray
    """(S, K, 3) obstacle each unit showed (eq. 1) [m], NaN for none"""
    approach_limit: FloatArray
    """(S,) approach limit of the nearest obstacle that restricts the arm (eq. 7) [m/s], NaN for none"""
    force: FloatArray
    """(S, 3) [N]"""
    filtered_force: FloatArray
    """(S, 3) [N]"""
    upper: FloatArray
    """(S, 3) [N]"""
    lower: FloatArray
    """(S, 3) [N]"""
    mean: FloatArray
    """(S, 3) of the window [N]"""
    obstacle_positive: FloatArray
    """(S, 3) F_obs+ of eq. 11, by which the lower threshold is raised [N]"""
    obstacle_negative: FloatArray
    """(S, 3) F_obs-, by which the upper threshold is lowered [N]"""
    true_force: FloatArray
    """(S, 3) mean true force since the last step [N]"""
    reacting: BoolArray
    """(S,)"""
    detected: BoolArray
    """(S,) a reaction begins"""


def trace_of(record: Record) -> Trace:
    """Take from a record what figures need."""
    steps, times = record.steps, record.times()
    edges = np.searchsorted(record.true_time, times, side="right")
    summed = np.vstack([np.zeros(3), np.cumsum(record.true_force, axis=0)])
    starts = np.concatenate([[0], edges[:-1]])
    true = (summed[edges] - summed[starts]) / np.maximum(edges - starts, 1)[:, None]
    return Trace(
        time=times,
        ee_position=np.array([s.ee_position for s in steps]),
        ee_velocity=np.array([s.ee_velocity for s in steps]),
        path_position=np.array([s.path_position for s in steps]),
        speed_scale=np.array([s.speed_scale for s in steps]),
        range_distance=np.array([s.range_distance for s in steps]),
        sensed_point=np.array([sensed_points(s) for s in steps]),
        approach_limit=np.array([_nearest_limit(s) for s in steps]),
        force=record.forces(),
        filtered_force=np.array([s.filtered_force for s in steps]),
        upper=np.array([s.thresholds.upper for s in steps]),
        lower=np.array([s.thresholds.lower for s in steps]),
        mean=np.array([s.thresholds.mean for s in steps]),
        obstacle_positive=np.array([s.thresholds.obstacle_positive for s in steps]),
        obstacle_negative=np.array([s.thresholds.obstacle_negative for s in steps]),
        true_force=true,
        reacting=np.array([s.mode is Mode.REACT for s in steps]),
        detected=np.array([s.contact is not None for s in steps]),
    )


def sensed_points(step: ControlStep) -> FloatArray:
    """Obstacle of each unit (K, 3) [m], NaN where it showed none."""
    return points_of_units(step.obstacles, len(step.range_distance))


def _nearest_limit(step: ControlStep) -> float:
    """Approach limit [m/s] of the obstacle nearest to the body, NaN where none restricts the arm."""
    if len(step.restricted) == 0:
        return np.nan
    return float(step.approach_limit[np.argmin(step.obstacles.body_distance[step.restricted])])


def read_trace(place: Path) -> tuple[Trace, tuple[str, ...]]:
    """Read the course of a recorded trial, and the names of its units; RecordingError for what is no recording."""
    recorded = open_recording(place)
    if len(recorded) == 0:
        raise RecordingError(f"The recording {place} holds no control step: remove it.")
    return trace_of(record_of(recorded)), recorded.runs[0].skin.ids
