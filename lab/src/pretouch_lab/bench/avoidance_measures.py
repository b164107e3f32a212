"""Measures of a trial of the avoidance benchmark: true contacts and distances, and the commanded motion."""

from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from pretouch.sim.plant import TOUCH_N
from pretouch.traces import mean_over
from pretouch.types import BoolArray, ControlStep, FloatArray, Mode
from pretouch_lab.bench.avoidance_scenes import Scenario, Setting
from pretouch_lab.bench.obstacle import least_distance, nearest
from pretouch_lab.encounters import hand_velocity
from pretouch_lab.run import Row
from pretouch_lab.table import peak, rounded
from pretouch_lab.trial import Record

_CLAMP_S = 0.5
"""Least duration of a quasi-static contact (ISO/TS 15066) [s]."""
_CAUSE_S = 0.5
"""Longest time from a true contact to a reaction to it [s]."""
_ECHO_S = 3.0
"""Longest time from a true contact to a repeated reaction, its echo [s]."""
_D_MAX_M = 0.8
"""Default distance of the obstacle from the end-effector at which the time to contact starts [m]."""
_BEGINNING_S = 0.5
_LOOK_EVERY = 10
"""Control steps from one test for a livelock to the next."""


def measured(record: Record, setting: Setting, scenario: Scenario) -> Row:
    """Return all measures of a trial."""
    setup, params, hands = setting.setup, scenario.params, record.hand_position
    model, steps, begin = setup.model, record.steps, record.started()

    def towards(i: int) -> FloatArray:
        return nearest(model.kinematics(steps[i].q), model.body, setting.shape(hands[i])).direction

    from_ee, _ = setting.shape(hands).closest(np.array([s.ee_position for s in steps]))
    postures = np.array([s.q for s in steps])
    return {
        "least_distance_m": rounded(least_distance(model, postures, setting.shape, hands), 4),
        **contact(record, from_ee <= params["obstacle"].get("d_max_m", _D_MAX_M), towards),
        **tracking(steps[begin:], 0.0 if params["path"]["kind"] == "held" else setup.path.length),
        "jerk_rms_rad_s3": jerk(steps[begin:], setup.profile.task.control_period_s),
        **holds(steps[begin:], setup.profile.task.control_period_s),
        **reactions(record),
        **livelocks(record, setting, params.get("livelock")),
        "timed": "turns" in params,
        "duration_s": round(steps[-1].stamp, 3),
    }


def contact(record: Record, near: BoolArray, towards: Callable[[int], FloatArray]) -> Row:
    """First contact, impact speed, and forces.

    Args:
        record: of the trial, with S steps.
        near: (S,) true where the obstacle is near; the time to contact starts at the first such step.
        towards: returns for a step the direction (3,) from the arm to the obstacle where they are nearest.
    """
    touch, times = record.first_contact(), record.times()
    force = np.linalg.norm(record.true_force, axis=1)
    row: Row = {
        "contact": touch is not None,
        "first_contact_s": None,
        "impact_speed_m_s": None,
        "peak_estimate_n": None,
        "true_peak_20ms_n": rounded(peak(mean_over(force, 20))),
        "clamping_force_n": rounded(clamping(record.true_time, force)),
    }
    if touch is None:
        return row
    within = times[near]
    if len(within) and within[0] <= touch:
        row["first_contact_s"] = rounded(touch - max(float(within[0]), float(times[record.started()])))
    at = max(0, int(np.searchsorted(times, touch)) - 1)
    direction = towards(at)
    estimate = -record.forces() @ direction
    row["peak_estimate_n"] = rounded(peak(estimate[(times >= touch) & np.isfinite(estimate)]))
    if record.touches:
        speed = record.touches[0].velocity - hand_velocity(record, at)
        row["impact_speed_m_s"] = rounded(float(speed @ direction), 4)
    return row


def clamping(time: FloatArray, force: FloatArray) -> float:
    """Largest mean [N] of a force (T,) [N] over half a second without a value below 1 N; 0 without such a span."""
    width = max(1, round(_CLAMP_S / float(time[1] - time[0]))) if len(time) > 1 else 1
    if len(force) < max(2, width):
        return 0.0
    unbroken = mean_over((force > TOUCH_N).astype(np.float64), width) > 1.0 - 0.5 / width
    return peak(mean_over(force, width)[unbroken])


def tracking(steps: list[ControlStep], length: float) -> Row:
    """Error and progress along a path; `length` is that of one turn [m], 0 for an arm that holds its place.

    The cycle time is the time of the second turn; None for an unfinished turn.
    """
    row: Row = dict.fromkeys(("tracking_rms_m", "speed_m_s", "cycle_time_s"))
    if not steps:
        return row
    off = np.array([np.linalg.norm(s.ee_position - s.path_position) for s in steps])
    row["tracking_rms_m"] = rounded(float(np.sqrt((off**2).mean())), 4)
    if length:
        phase, time = np.array([s.path_phase for s in steps]), np.array([s.stamp for s in steps])
        row["speed_m_s"] = rounded((phase[-1] - phase[0]) / max(time[-1] - time[0], 0.01), 4)
        first, second = (time[phase >= turns * length - 1e-9] for turns in (1, 2))
        row["cycle_time_s"] = rounded(second[0] - first[0]) if len(second) else None
    return row


def jerk(steps: list[ControlStep], period: float) -> float:
    """Rms jerk of the commanded joint velocities [rad/s^3].

    The first half second, in which every arm starts to move, is left out.
    """
    commands = np.array([s.command for s in steps[round(_BEGINNING_S / period) :]])
    third = np.diff(commands, n=2, axis=0) / period**2 if len(commands) > 2 else np.zeros(1)
    return rounded(float(np.sqrt((third**2).mean())), 1)


def holds(steps: list[ControlStep], period: float) -> Row:
    """Count the holds after the start, with their durations and events."""
    begun = [b for a, b in pairwise(steps) if b.mode is Mode.HOLD and a.mode is not Mode.HOLD]
    return {
        "holds": len(begun),
        "held_s": rounded(sum(s.mode is Mode.HOLD for s in steps) * period),
        "hold_events": dict(Counter(s.event.value for s in begun)),
    }


def reactions(record: Record) -> Row:
    """Count reactions, those without a contact, and those against the force of their contact."""
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


def livelocks(record: Record, setting: Setting, limits: dict[str, Any] | None) -> Row:
    """Count livelocks: the path's phase grows by less than `advance_m` in `within_s` although the path is clear.

    The path is clear if the obstacle is farther than `clear_m` from its next `ahead_m` all that time.
    """
    if limits is None:
        return {"livelocks": None, "livelock_s": None}
    chosen = range(record.started(), len(record.steps), _LOOK_EVERY)
    if len(chosen) < 2:
        return {"livelocks": 0, "livelock_s": 0.0}
    phase, time = np.array([(record.steps[i].path_phase, record.steps[i].stamp) for i in chosen]).T
    further = np.linspace(0.0, limits["ahead_m"], 11)
    ahead = np.array([[setting.setup.path.point(way + s) for s in further] for way in phase])
    gaps, _ = setting.shape(record.hand_position[chosen, None]).closest(ahead)
    period = time[1] - time[0]
    width = round(limits["within_s"] / period)
    stuck = stuck_for(phase, gaps.min(axis=1) > limits["clear_m"], width, limits["advance_m"])
    begun = np.count_nonzero(stuck[1:] & ~stuck[:-1]) + int(stuck[0])
    return {"livelocks": int(begun), "livelock_s": rounded(float(stuck.sum() * period))}


def stuck_for(phase: FloatArray, clear: BoolArray, width: int, advance: float) -> BoolArray:
    """Return flags (S,) of the instants in a clear span of `width` with less than `advance` [m] of progress.

    `phase` (S,) [m] is the progress so far; `clear` (S,) is true where the path ahead is clear.
    """
    stuck = np.zeros(len(phase), np.bool_)
    for end in range(width, len(phase)):
        span = slice(end - width, end + 1)
        if phase[end] - phase[end - width] < advance and clear[span].all():
            stuck[span] = True
    return stuck
