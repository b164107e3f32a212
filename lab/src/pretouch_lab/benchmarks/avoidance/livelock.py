"""Livelocks: the arm does not get on although nothing is in its way."""

from typing import Any

import numpy as np

from pretouch.control.path import Path
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.benchmarks.avoidance.measures import started
from pretouch_lab.benchmarks.avoidance.setting import Setting
from pretouch_lab.run import Row
from pretouch_lab.table import rounded
from pretouch_lab.trial import Record

_EVERY = 10
"""Control steps between two that are looked at."""


def livelocks(record: Record, setting: Setting, limits: dict[str, Any] | None) -> Row:
    """How often and how long [s] the path's phase grows by less than `advance_m` in `within_s` while nothing blocks it.

    Nothing blocks it if the obstacle is farther than `clear_m` from the next `ahead_m` of the path all that time.
    """
    row: Row = {"livelocks": None, "livelock_s": None}
    if limits is None:
        return row
    chosen = range(started(record.steps), len(record.steps), _EVERY)
    if len(chosen) < 2:
        return row | {"livelocks": 0, "livelock_s": 0.0}
    steps = [record.steps[i] for i in chosen]
    clear = np.array([
        _clear(setting, record.hand_position[i], step.path_phase, limits) for i, step in zip(chosen, steps, strict=True)
    ])  # fmt: skip
    phase, period = np.array([s.path_phase for s in steps]), steps[1].stamp - steps[0].stamp
    stuck = stuck_for(phase, clear, round(limits["within_s"] / period), limits["advance_m"])
    begun = np.count_nonzero(stuck[1:] & ~stuck[:-1]) + int(stuck[0])
    return {"livelocks": int(begun), "livelock_s": rounded(float(stuck.sum() * period))}


def stuck_for(phase: FloatArray, clear: BoolArray, width: int, advance: float) -> BoolArray:
    """Tell of each of S instants whether it lies in a span of `width` with less than `advance` [m] of way, all clear.

    `phase` (S,) [m] is the way so far, `clear` (S,) whether the way ahead is clear.
    """
    stuck = np.zeros(len(phase), np.bool_)
    for end in range(width, len(phase)):
        span = slice(end - width, end + 1)
        if phase[end] - phase[end - width] < advance and clear[span].all():
            stuck[span] = True
    return stuck


def _clear(setting: Setting, hand: FloatArray, phase: float, limits: dict[str, Any]) -> bool:
    path: Path = setting.setup.path
    ahead = np.array([path.point(phase + s) for s in np.linspace(0.0, limits["ahead_m"], 11)])
    return bool(setting.shape(hand).closest(ahead)[0].min() > limits["clear_m"])
