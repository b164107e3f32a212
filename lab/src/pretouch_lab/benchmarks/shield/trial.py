"""Trials with moving people under any commander, in the whole simulation; and what each touch was."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pretouch.control.braking import braking_cap
from pretouch.control.joint_box import joint_limits
from pretouch.desired import Desired
from pretouch.params import BrakingParams
from pretouch.profiles import Profile, profile
from pretouch.sim.hand import Hand
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.avoidance.obstacle import Nearest, nearest, truth_of
from pretouch_lab.benchmarks.avoidance.scenario import scenarios
from pretouch_lab.benchmarks.avoidance.setting import Setting, setting
from pretouch_lab.benchmarks.scenario_files import SeedRange, scenario, seed_of
from pretouch_lab.benchmarks.shield.commanders import AtPerson, Commander, Situation, Tracking
from pretouch_lab.benchmarks.shield.measures import asked_velocity, breaks_limits
from pretouch_lab.run import Row
from pretouch_lab.table import rounded
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


_DRIVE_1_S = 50.0


@dataclass(frozen=True)
class TouchCell:
    """One trial."""

    filter_name: str
    commander: str
    """tracking or at-person."""
    scene: str
    number: int
    """Of the seed."""
    seeds: SeedRange = "published"

    @property
    def seed(self) -> int:
        """Of the arm, its sensors and the person."""
        return seed_of(scenario(f"avoidance-{scenarios()[self.scene].family}"), self.seeds, self.number)


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


def play_touch(cell: TouchCell) -> Row:
    """Play a trial, and say what its touches were."""
    made = setting(scenarios()[cell.scene], FILTERS[cell.filter_name], cell.seed)
    commander = _commander(cell, made)
    commanding = _Commanding(commander, made)
    setup = replace(made.setup, commander=commanding.on)
    record = play(setup, lambda step, plant: made.done(step, plant) or _touched(step.stamp, plant))
    truth = truth_of(record, setup.model, map(made.shape, record.hand_position))
    touches = touches_of(record, made)
    found = _motion(record, commanding, commander, made)
    return {
        "scene": cell.scene, "seed": cell.seed, "touches": touches,
        "least_distance_m": rounded(float(truth.distance.min()), 4), **found,
    }  # fmt: skip


def tried(cell: TouchCell) -> Row:
    """Play a trial; one that raises is a row that says so."""
    try:
        return play_touch(cell) | {"exceptions": 0}
    except Exception as error:  # that there is none is what is measured
        none: Row = dict.fromkeys(("steps", "limit_violations", "non_finite", "errors", "changes"), 0)
        none |= {"exceptions": 1, "first_exception": repr(error), "error_m2": 0.0, "change_m2_s2": 0.0}
        return {"scene": cell.scene, "seed": cell.seed, "touches": [], "least_distance_m": _FAR_M, **none}


def _commander(cell: TouchCell, made: Setting) -> Commander:
    if cell.commander == "tracking":
        return Tracking(made.setup.path, _SPEED_M_S, _GAIN_1_S, _FASTEST_M_S)
    return AtPerson(np.random.default_rng([cell.seed, 31]))


_SPEED_M_S, _GAIN_1_S, _FASTEST_M_S = 0.2, 2.0, 0.5
"""Of the ordinary commander."""


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
