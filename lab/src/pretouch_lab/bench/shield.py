"""Filters between a commander and the arm, held against each other: what holds whoever commands, and what it costs."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from math import sqrt
from typing import Any

import numpy as np

from pretouch.control.braking import braking_cap
from pretouch.control.joint_box import joint_limits
from pretouch.desired import Desired
from pretouch.params import BrakingParams
from pretouch.profiles import Profile, profile
from pretouch.sim.hand import Hand
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.text_table import TextTable
from pretouch.types import FloatArray
from pretouch_lab.bench.avoidance_scenes import Setting, scenarios, setting
from pretouch_lab.bench.commanders import (
    TOLERANCE,
    AtPerson,
    Commander,
    Situation,
    Tracking,
    asked_velocity,
    breaks_limits,
)
from pretouch_lab.bench.obstacle import Nearest, nearest, truth_of
from pretouch_lab.bench.scenes import SeedRange
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import Column, grouped, rounded, table
from pretouch_lab.trial import Record, play

FILTERS: dict[str, Profile] = {
    "pretouch": profile("pretouch"),
    "paper": profile("paper"),
    "none": profile("pretouch:approach=none:null_space=none"),
}
"""`none` sees what `pretouch` does, answers contacts as it does, and keeps the limits of the joints alone."""
SCENES = ("walking", "srdo", "drdo", "inside")
"""Scenarios of `bench avoidance` in which somebody moves: a person walks up, an obstacle passes over a standing arm or
into the way of a moving one, a hand is held in the way and taken away."""
SEEN_S = 0.4
"""How long the touching part has to have been known to be near [s]: latency and what a row takes, at its rate of
tightening, from the fastest approach that the braking curve leaves at its greatest distance (0.06 s + 0.8 / 3 s), and
two readings."""
CLOSE_M = 0.02
"""By how much it may be thought farther than it is to be seen well [m]: what the VL53L1X's data sheet allows."""
SAME_M = 0.1
"""How near to the touching place of the arm a sensed point's closest point has to be [m]."""
_FAR_M = 10.0
"""Least distance of a trial that was not played to its end [m]."""
_AFTER_S, _APART_S = 1.5, 0.2
"""A trial ends so long after its first touch; touches so near after the last contact belong to it [s]."""
COMMANDERS = ("tracking", "at-person")
_TRIALS = {"pretouch": (50, 100), "paper": (6, 14), "none": (6, 14)}
"""Trials of a scene, with each commander."""
_SPEED_M_S, _GAIN_1_S, _FASTEST_M_S = 0.2, 2.0, 0.5
"""Of the ordinary commander."""
_DRIVE_1_S = 50.0


def speed_bound(mistaken: float) -> float:
    """Largest speed of a touching point along the normal, if it was thought so much farther than it was [m/s].

    The braking curve of the profile `pretouch` at that distance, which is the touch speed where nothing was mistaken,
    and what the drives are off by: a critically damped impedance of w = 50 rad/s (3000 Nm/rad, 1.2 kg m^2) answers an
    acceleration that changes by a with a velocity that is off by up to a / (e w), here for what a row may loosen and
    tighten by.
    """
    p = BrakingParams()
    cap = braking_cap(mistaken, p.touch_speed_max_m_s, p.deceleration_m_s2, p.latency_s, p.margin_m)
    return float(cap + (p.loosen_m_s2 + p.tighten_m_s2) / (np.e * _DRIVE_1_S))


@dataclass
class _Commanding:
    """Asks a commander in each step, and keeps what it said."""

    commander: Commander
    made: Setting
    asked: list[tuple[Desired | None, FloatArray | None]] = field(default_factory=list)
    """What was asked for, and the velocity (3,) of the end-effector origin that was [m/s]."""

    def on(self, plant: Plant, hand: Hand | None) -> Any:
        """See `Setup.commander`."""
        model = plant.model

        def ask() -> Desired | None:
            robot = plant.read()
            kin = model.kinematics(robot.q)
            place, velocity = (np.zeros(3), np.zeros(3)) if hand is None else (hand.position, hand.velocity)
            situation = Situation(plant.time, model, kin, self.made.shape(place), place, velocity)
            asked = self.commander(situation)
            self.asked.append((asked, asked_velocity(asked, plant.time, model, kin)))
            return asked

        return ask


def plays(seeds: SeedRange, quick: bool) -> list[Play]:
    """Return all trials: each filter and commander in each scene, a quick run with one seed."""
    return [
        ({"filter": name, "commander": commander, "scene": scene}, seed)
        for name in FILTERS
        for commander, count in zip(COMMANDERS, _TRIALS[name], strict=True)
        for scene in SCENES
        for seed in scenarios()[scene].first_seeds(seeds, 1 if quick else count)
    ]


def trial(cell: Cell, seed: int) -> Row:
    """Play a trial; one that raises is a row that says so."""
    try:
        return play_touch(cell["filter"], cell["commander"], cell["scene"], seed) | {"exceptions": 0}
    except Exception as error:  # that there is none is what is measured
        none: Row = dict.fromkeys(("steps", "limit_violations", "non_finite", "errors", "changes"), 0)
        none |= {"exceptions": 1, "first_exception": repr(error), "error_m2": 0.0, "change_m2_s2": 0.0}
        return {"touches": [], "least_distance_m": _FAR_M, **none}


def play_touch(filter_name: str, commander_name: str, scene: str, seed: int) -> Row:
    """Play a trial, and say what its touches were."""
    made = setting(scenarios()[scene], FILTERS[filter_name], seed)
    commander: Commander = AtPerson(np.random.default_rng([seed, 31]))
    if commander_name == "tracking":
        commander = Tracking(made.setup.path, _SPEED_M_S, _GAIN_1_S, _FASTEST_M_S)
    commanding = _Commanding(commander, made)
    setup = replace(made.setup, commander=commanding.on)
    record = play(setup, lambda step, plant: made.done(step, plant) or _touched(step.stamp, plant))
    truth = truth_of(record, setup.model, map(made.shape, record.hand_position))
    return {
        "touches": touches_of(record, made),
        "least_distance_m": rounded(float(truth.distance.min()), 4),
        **_motion(record, commanding, commander, made),
    }


def _touched(now: float, plant: Plant) -> bool:
    return bool(plant.touches) and now > plant.touches[0].time + _AFTER_S


def touches_of(record: Record, made: Setting) -> list[Row]:
    """Return the touches of a trial that are no echo of the one before, each with its speed and whether it was seen.

    The speed is that of the touching point of the arm along the normal to the person, before the contact: what a
    controller can answer for; `closing_m_s` has the person's own in it.
    """
    times, rows = record.times(), []
    pressed = record.true_time[np.linalg.norm(record.true_force, axis=1) > TOUCH_N]
    for touch in record.touches:
        earlier = pressed[pressed < touch.time - 1e-9]
        at = int(np.searchsorted(times, touch.time)) - 1
        if at < 0 or (len(earlier) and touch.time - earlier[-1] < _APART_S):
            continue
        towards = _near(record, made, at, touch.link).direction
        before = max(at - 2, 0)
        person = record.hand_position[at] - record.hand_position[before]
        took = max(times[at] - times[before], 1e-9)
        own = float(touch.velocity @ towards)
        rows.append({
            "time_s": rounded(touch.time), "link": made.setup.model.links[touch.link], "speed_m_s": rounded(own, 4),
            "closing_m_s": rounded(own - float(person @ towards) / took, 4),
            "mistaken_m": _mistaken(record, made, at, touch.link), "mode": record.steps[at].mode.value,
        })  # fmt: skip
    return rows


def seen_in_time(touch: Row) -> bool:
    """Whether the controller knew, all the time before a touch, of something near the touching part.

    In each step of the last `SEEN_S` the point of the body nearest to one of its obstacles lay on the touching body,
    within `SAME_M` of the place that is truly nearest.
    """
    return touch["mistaken_m"] is not None


def _mistaken(record: Record, made: Setting, at: int, link: int) -> float | None:
    """By how much the touching part was thought farther than it was, at most [m]; None where it was not known of."""
    rigid, worst = made.setup.model.rigid, -np.inf
    first = int(np.searchsorted(record.times(), record.steps[at].stamp - SEEN_S))
    for i in range(first, at + 1):
        near, o = _near(record, made, i, link), record.steps[i].obstacles
        same = rigid[o.link] == rigid[link]
        same &= np.linalg.norm(o.body_point - near.point, axis=1) < SAME_M
        if not same.any():
            return None
        worst = max(worst, float(o.body_distance[same].min()) - near.distance)
    return rounded(worst, 4)


def _near(record: Record, made: Setting, at: int, link: int) -> Nearest:
    """Closest points of the person and the rigid body of a link at a step."""
    model = made.setup.model
    body = model.body.of_links(np.flatnonzero(model.rigid == model.rigid[link]))
    return nearest(model.kinematics(record.steps[at].q), body, made.shape(record.hand_position[at]))


def _motion(record: Record, commanding: _Commanding, commander: Commander, made: Setting) -> Row:
    """Limits, how far the command was from what was asked, and from where the hand was wanted."""
    model, task = made.setup.model, made.setup.profile.task
    limits = joint_limits(model, task.position_margin_rad, task.control_period_s)
    off, changed, broken, strange = [], [], 0, 0
    for i, (step, (_, asked)) in enumerate(zip(record.steps, commanding.asked, strict=True)):
        if not np.isfinite(step.command).all():
            strange += 1
            continue
        before = record.steps[i - 1].command if i else np.zeros(model.n)
        broken += breaks_limits(step.q_commanded, before, step.command, limits)
        if asked is not None:
            got = model.ee_jacobian(model.kinematics(step.q))[:3] @ step.command
            changed.append(float((got - asked) @ (got - asked)))
        if isinstance(commander, Tracking):
            off.append(float(np.sum((step.ee_position - commander.wanted(step.stamp)) ** 2)))
    return {
        "steps": len(record.steps), "limit_violations": broken, "non_finite": strange,
        "error_m2": sum(off), "errors": len(off), "change_m2_s2": sum(changed), "changes": len(changed),
    }  # fmt: skip


_COUNTS = ("steps", "exceptions", "non_finite", "limit_violations")


def results(rows: Iterable[Row]) -> list[Row]:
    """Return a row for each filter and commander."""
    return [{**key, **_counted(trials), **_touches(trials)} for key, trials in grouped(rows, ("filter", "commander"))]


def _counted(trials: list[Row]) -> Row:
    """Sums over trials."""
    raised = [trial["first_exception"] for trial in trials if trial["exceptions"]]
    return {
        **{name: sum(trial[name] for trial in trials) for name in _COUNTS},
        "first_exception": raised[0] if raised else "",
        "intervention": _rms(trials, "change_m2_s2", "changes"),
        "task_error": _rms(trials, "error_m2", "errors"),
    }


def _rms(parts: list[Row], squares: str, count: str) -> float | None:
    total = sum(part[count] for part in parts)
    return rounded(sqrt(sum(part[squares] for part in parts) / total), 4) if total else None


def _touches(trials: list[Row]) -> Row:
    """Touches of the trials, those that were seen in time apart from the others."""
    touches = [touch for trial in trials for touch in trial["touches"]]
    seen = [touch for touch in touches if seen_in_time(touch)]
    kinds = {
        "": seen,
        "close_": [touch for touch in seen if touch["mistaken_m"] <= CLOSE_M],
        "unseen_": [touch for touch in touches if not seen_in_time(touch)],
    }
    row: Row = {"trials": len(trials), "bound_m_s": rounded(speed_bound(CLOSE_M), 4)}
    for prefix, found in kinds.items():
        speeds = [touch["speed_m_s"] for touch in found]
        row |= {f"{prefix}touches": len(found), f"{prefix}touch_speed_m_s": max(speeds, default=None)}
    excess = [touch["speed_m_s"] - speed_bound(touch["mistaken_m"]) for touch in seen]
    row |= {"over_bound": sum(each > 0.0 for each in excess), "excess_m_s": _largest(excess)}
    least = [trial["least_distance_m"] for trial in trials]
    return row | {"least_distance_m": min(least, default=None)}


def _largest(values: list[float]) -> float | None:
    return rounded(max(values), 4) if values else None


def guarantees() -> str:
    """Say what is counted, and how."""
    return (
        "Filters between the commander and the arm: `pretouch` and `paper` as they are; `none`: `pretouch` without"
        " restriction, the limits of the joints alone. Commanders: `at-person`, which knows where the person is and"
        " drives a part of the arm at them, at up to 1.5 m/s; `tracking`, an ordinary one.\n\n"
        "Trials are those of"
        " `bench avoidance` in which somebody moves, with all errors and latencies. A limit is broken where a command"
        f" passes position, velocity or acceleration by more than {TOLERANCE:g}. The speed at a touch is that of the"
        " arm's touching point towards the person. A touch was seen in time if in each step of the"
        f" {SEEN_S:g} s before it the controller knew a point whose closest point on the body lay within"
        f" {100 * SAME_M:.0f} cm of the touching place. If that was thought up to e farther than it was, the braking"
        " curve leaves the touch speed of 0.05 m/s and what it allows at e in addition, and the drives are off by up to"
        f" 0.03 m/s when it begins to bind: {speed_bound(0.01):.2f} m/s in all where e is 1 cm or less,"
        f" {speed_bound(CLOSE_M):.2f} m/s at 2 cm, {speed_bound(0.05):.2f} m/s at 5 cm: the bound of each touch."
        " Where nothing was seen no filter can know: a column of its own."
    )


_NAMES = (Column("filter", "filter"), Column("commander", "commander"))
_LIMITS = (
    *_NAMES,
    Column("steps", "steps"),
    Column("exceptions", "exceptions"),
    Column("no\nnumber", "non_finite"),
    Column("limits\nbroken", "limit_violations"),
    Column("trials", "trials"),
    Column("seen: over\nthe bound", "over_bound", of="touches"),
    Column("by\n[m/s]", "excess_m_s", 2),
    Column("fastest\n[m/s]", "touch_speed_m_s", 2),
    Column("seen to\n2 cm", "close_touches"),
    Column("fastest\n[m/s]", "close_touch_speed_m_s", 2),
    Column("unseen", "unseen_touches"),
    Column("fastest\n[m/s]", "unseen_touch_speed_m_s", 2),
    Column("least\n[mm]", "least_distance_m", 0, 1e3),
)
_COST = (*_NAMES, Column("off\n[mm]", "task_error", 0, 1e3), Column("change\n[m/s]", "intervention", 2))


def tables(groups: list[Row]) -> list[TextTable]:
    """Return the tables of `results`."""
    note = (
        "change: rms of how far the command at the end-effector is from what was asked, while that is sound. off: rms"
        " distance of the hand from where the ordinary commander wants it."
    )
    return [
        table("What holds whoever commands", _LIMITS, groups, "least: least true distance in the trials.", 2),
        table("What it costs", _COST, groups, note, 2),
    ]
