"""What one trial comes to: numbers from what truly happened, and from what was commanded."""

from collections import Counter
from itertools import pairwise
from typing import Any

import numpy as np

from pretouch.control.path import Path
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import mean_over
from pretouch.types import BoolArray, ControlStep, FloatArray, Mode, QpOutcome
from pretouch_lab.bench.avoidance_scenes import Setting
from pretouch_lab.bench.obstacle import Truth
from pretouch_lab.run import Row
from pretouch_lab.table import peak, rounded
from pretouch_lab.trial import Record

_CLAMP_S = 0.5
"""A contact that lasts this long is quasi-static (ISO/TS 15066) [s]."""
_CAUSE_S = 0.5
"""A reaction this long after a true contact still answers it [s]."""
_ECHO_S = 3.0
"""A later reaction this long after it is its echo [s]."""
_NEAR_M = 0.6
"""Distance within which control points are looked at, and what the skin sees [m]."""
_SAME_M = 0.15
"""A sensed point this near to the obstacle's surface shows it [m]."""
_BEGINNING_S = 0.5
_LOOK_EVERY = 10
"""Control steps between two that are looked at for livelocks."""


def started(steps: list[ControlStep]) -> int:
    """Index of the first step in which the arm does not hold, as it does while its window fills."""
    return next((i for i, s in enumerate(steps) if s.mode is not Mode.HOLD), len(steps))


def contact(record: Record, truth: Truth, d_max: float) -> Row:
    """First touch, impact speed, and forces.

    The first contact counts from the first step in which the obstacle is within `d_max` [m] of the end-effector's
    origin. Clamping is the largest mean force over half a second of unbroken contact.
    """
    touch, times = record.first_contact(), record.times()
    force = np.linalg.norm(record.true_force, axis=1)
    row: Row = {
        "contact": touch is not None,
        "first_contact_s": None,
        "impact_speed_m_s": None,
        "peak_estimate_n": None,
        "true_peak_20ms_n": rounded(peak(mean_over(force, 20))),
        "true_peak_n": rounded(peak(force)),
        "clamping_force_n": rounded(clamping(record.true_time, force)),
        "least_distance_m": rounded(float(truth.distance.min()), 4),
    }
    if touch is None:
        return row
    near = np.flatnonzero(truth.ee_distance <= d_max)
    if len(near) and times[near[0]] <= touch:
        row["first_contact_s"] = rounded(touch - max(float(times[near[0]]), float(times[started(record.steps)])))
    at = max(0, int(np.searchsorted(times, touch)) - 1)
    towards = truth.nearest[at].direction
    estimate = -record.forces() @ towards
    row["peak_estimate_n"] = rounded(peak(estimate[(times >= touch) & np.isfinite(estimate)]))
    if record.touches:
        row["impact_speed_m_s"] = rounded(float((record.touches[0].velocity - _speed(record, at)) @ towards), 4)
    return row


def _speed(record: Record, at: int) -> FloatArray:
    """Velocity (3,) [m/s] of the person's hand before a step; zero of what stands still."""
    before = max(at - 2, 0)
    moved = record.hand_position[at] - record.hand_position[before]
    took = record.steps[at].stamp - record.steps[before].stamp
    return moved / took if took > 0 and np.isfinite(moved).all() else np.zeros(3)


def clamping(time: FloatArray, force: FloatArray) -> float:
    """Largest mean (N) of a force (T,) [N] over half a second in which it is never below 1 N; 0 if there is none."""
    if len(time) < 2:
        return 0.0
    width = max(1, round(_CLAMP_S / float(time[1] - time[0])))
    if len(force) < width:
        return 0.0
    unbroken = mean_over((force > TOUCH_N).astype(np.float64), width) > 1.0 - 0.5 / width
    return peak(mean_over(force, width)[unbroken])


def tracking(record: Record, length: float, held: bool) -> Row:
    """Error and progress along the path, from the first step in which the arm does not hold.

    The cycle time is that of the second turn; None if it was not finished. `length` [m] is that of a turn.
    """
    steps = record.steps[started(record.steps) :]
    row: Row = {"tracking_rms_m": None, "off_path_max_m": None, "way_m": None, "speed_m_s": None, "cycle_time_s": None}
    if not steps:
        return row
    off = np.array([np.linalg.norm(s.ee_position - s.path_position) for s in steps])
    row |= {"tracking_rms_m": rounded(float(np.sqrt((off**2).mean())), 4), "off_path_max_m": rounded(off.max(), 4)}
    if held:
        return row
    phase, time = np.array([s.path_phase for s in steps]), np.array([s.stamp for s in steps])
    row["way_m"] = rounded(phase[-1] - phase[0])
    row["speed_m_s"] = rounded((phase[-1] - phase[0]) / max(time[-1] - time[0], 0.01), 4)
    turns = [np.flatnonzero(phase >= n * length - 1e-9) for n in (1, 2)]
    if all(map(len, turns)):
        row["cycle_time_s"] = rounded(time[turns[1][0]] - time[turns[0][0]])
    return row


def smoothness(record: Record, period: float) -> Row:
    """Jerk of the commanded joint velocities: largest of all, median over seconds of each second's largest, and rms.

    The first half second after the window is full is left out: every arm begins to move then.
    """
    begin = started(record.steps) + round(_BEGINNING_S / period)
    commands = np.array([s.command for s in record.steps[begin:]])
    if len(commands) < 3:
        return dict.fromkeys(("jerk_max_rad_s3", "jerk_max_per_second_rad_s3", "jerk_rms_rad_s3"), 0.0)
    jerk = np.diff(commands, n=2, axis=0) / period**2
    largest, second = np.abs(jerk).max(axis=1), round(1 / period)
    return {
        "jerk_max_rad_s3": rounded(largest.max(), 1),
        "jerk_max_per_second_rad_s3": rounded(
            float(np.median([largest[i : i + second].max() for i in range(0, len(largest), second)])), 1
        ),
        "jerk_rms_rad_s3": rounded(float(np.sqrt((jerk**2).mean())), 1),
    }


def holds(record: Record) -> Row:
    """Holds after the start, with their events, and steps without a solution."""
    steps = record.steps[started(record.steps) :]
    held = [s for s in steps if s.mode is Mode.HOLD]
    begun = [b for a, b in pairwise(steps) if b.mode is Mode.HOLD and a.mode is not Mode.HOLD]
    period = record.steps[1].stamp - record.steps[0].stamp if len(record.steps) > 1 else 0.0
    return {
        "holds": len(begun),
        "held_s": rounded(len(held) * period),
        "hold_events": dict(Counter(s.event.value for s in begun)),
        "solver_failures": sum(s.qp.outcome is QpOutcome.FAILED for s in steps),
        "infeasible": sum(s.qp.outcome is QpOutcome.INFEASIBLE for s in steps),
    }


def reactions(record: Record) -> Row:
    """Reactions without a contact, and such against the force of the contact they answer or echo."""
    force, time = record.true_force, record.true_time
    touching = time[np.linalg.norm(force, axis=1) > TOUCH_N]
    false = towards = 0
    for step, velocity in record.beginnings():
        before = touching[touching <= step.stamp]
        since = step.stamp - float(before[-1]) if len(before) else np.inf
        false += since > _CAUSE_S
        if since <= _ECHO_S:
            last = (time > before[-1] - 0.05) & (time <= before[-1])
            towards += float(velocity @ force[last].mean(axis=0)) < 0
    return {"reactions": len(record.reactions()), "false_reactions": int(false), "towards_person": int(towards)}


def seen(record: Record, truth: Truth, setting: Setting) -> Row:
    """Share of the steps with the obstacle within 0.6 m in which the controller knew a point near its surface."""
    shown = [
        len(step.obstacles.point) > 0
        and float(np.abs(setting.shape(hand).closest(step.obstacles.point)[0]).min()) < _SAME_M
        for step, hand, distance in zip(record.steps, record.hand_position, truth.distance, strict=True)
        if distance < _NEAR_M
    ]
    return {"seen_fraction": rounded(float(np.mean(shown))) if shown else None}


def livelocks(record: Record, setting: Setting, limits: dict[str, Any] | None) -> Row:
    """How often and how long [s] the path's phase grows by less than `advance_m` in `within_s` while nothing blocks it.

    Nothing blocks it if the obstacle is farther than `clear_m` from the next `ahead_m` of the path all that time.
    """
    row: Row = {"livelocks": None, "livelock_s": None}
    if limits is None:
        return row
    chosen = range(started(record.steps), len(record.steps), _LOOK_EVERY)
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
