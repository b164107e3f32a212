"""A recording, measured: distances of sensed objects, speed of the arm, margins of commands to limits, forces."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np

from pretouch.control.approach import ApproachRestriction, notice_m
from pretouch.recording.reader import Recorded
from pretouch.recording.run_record import MODES
from pretouch.reporting.contacts import TRANSIENT_S, ContactMeasures, contacts_in
from pretouch.reporting.html import Html, Row, Text, bad, element, facts, joined, number, percent, table
from pretouch.reporting.record import OUTCOMES, RunCourse, gather, least, spread
from pretouch.types import BoolArray, FloatArray, Mode, QpOutcome

_SLOWED = 0.99
"""Speed factor below which the arm counts as slowed."""
_MOST = 1000.0
"""Fraction that stands for more, as of a command where the arm allows none."""
_ROUNDING = 1e-9
"""Excess of a fraction over 1, or of a margin below 0 [rad], that is rounding."""


class LeastDistance(NamedTuple):
    """The least distance of something."""

    name: str
    distance: float
    """[m], infinite where there is none."""
    time: float
    """[s], NaN where there is none."""


def _nearest(course: RunCourse, names: Sequence[str], distances: FloatArray) -> list[LeastDistance]:
    """Return the least distance of each column (S, N) of distances [m], by its name."""
    time = np.append(course.time, np.nan)
    lows = [least(values) or (np.inf, -1) for values in distances.T]
    return [LeastDistance(name, low, float(time[at])) for name, (low, at) in zip(names, lows, strict=True)]


def nearest_to_body(course: RunCourse) -> LeastDistance | None:
    """Return the least distance from the surface of the body, with the unit that showed it; None of nothing sensed."""
    units = _nearest(course, course.units, course.body_distance)
    nearest = min(units, key=lambda one: one.distance, default=None)
    return nearest if nearest and np.isfinite(nearest.distance) else None


def d_crit(course: RunCourse) -> FloatArray:
    """Distance from the body (S,) below which nothing may come nearer [m]."""
    return course.of_runs(lambda run: ApproachRestriction.of_kind(run.profile.approach).d_crit_m)


def d_notice(course: RunCourse) -> FloatArray:
    """Distance from the body (S,) from which on what comes nearer counts [m]."""
    return course.of_runs(lambda run: notice_m(run.profile.approach))


def within_d_max(course: RunCourse) -> BoolArray:
    """Mask of the steps (S,) with a sensed point within d_max of the end-effector's origin."""
    return np.asarray(course.ee_distance < course.of_runs(lambda run: run.profile.d_max_m))


def distance_section(course: RunCourse) -> Html:
    """Least distances by unit and by link, and how long something was near: by what the units showed."""
    body = nearest_to_body(course)
    (ee,) = _nearest(course, ["end-effector"], course.ee_distance[:, None])
    if not course.proximity_used:
        return element("p", "Proximity was not used: the profile leaves the units aside.")
    if body is None or not np.isfinite(ee.distance):
        return element("p", "Nothing was sensed." if course.units else "The arm wears no unit: nothing is sensed.")
    lasted, distance = course.lasted, np.fmin.reduce(course.link_distance, axis=1)
    near = {
        "body nearer than d_crit": distance < d_crit(course),
        "body nearer than d_notice": distance < d_notice(course),
        "end-effector's origin nearer than d_max": within_d_max(course),
    }
    rows = [
        ("nearest to the body", f"{body.distance:.3f} m, shown by {body.name} at {body.time:.2f} s"),
        ("nearest to the end-effector's origin", f"{ee.distance:.3f} m at {ee.time:.2f} s"),
        *((name, f"{lasted[flags].sum():.2f} s") for name, flags in near.items()),
    ]

    def least_table(name: str, distance: str, columns: list[LeastDistance]) -> Html:
        return table(
            [{name: one.name, distance: number(one.distance, 3), "at [s]": number(one.time, 2)} for one in columns]
        )

    units = _nearest(course, course.units, course.body_distance)
    closest = [one for one in _nearest(course, course.model.links, course.link_distance) if np.isfinite(one.distance)]
    links = sorted(closest, key=lambda one: one.distance)
    tables = [
        least_table("unit", "least distance of what it showed [m]", units),
        least_table("link, where it was the closest", "least distance [m]", links),
    ]
    note = (
        "Distances are of sensed points from the surface of the body, negative in penetration. What no unit showed is"
        " not in them; the units measure nothing below 0.04 m and hold such an obstacle there."
    )
    return joined([facts(rows), element("div", joined(tables), "columns"), element("p", note, "note")])


def speed_section(course: RunCourse) -> Html:
    """Speed of the end-effector over time."""
    near, tracking = within_d_max(course), course.mode == MODES.index(Mode.TRACK)
    when = {
        "whole recording": np.ones(len(course), np.bool_),
        "TRACK, nothing within d_max": tracking & ~near,
        "anything within d_max": near,
        **{mode.name: course.mode == i for i, mode in enumerate(MODES)},
    }
    spreads = {name: spread(course.speed[flags]) for name, flags in when.items()}
    rows = [
        {
            "end-effector speed [m/s]": name,
            "median": number(speed.median, 3),
            "99 %": number(speed.p99, 3),
            "largest": number(speed.max, 3),
        }
        for name, speed in spreads.items()
    ]
    factor = course.speed_scale[tracking & np.isfinite(course.speed_scale)]
    factors = (
        f"While following the path the speed factor (eqs. 3 and 4) had the median {number(np.median(factor), 2)} and"
        f" the least value {number(factor.min(), 2)}; it was below 0.99 for {percent(np.mean(factor < _SLOWED))} of the"
        " steps."
        if len(factor)
        else "The arm never followed its path."
    )
    return joined([table(rows), element("p", factors)])


def _position_margin(course: RunCourse, q: FloatArray) -> FloatArray:
    """Distance (S, n) of positions from the nearer limit of each joint [rad], negative beyond it."""
    return np.minimum(q - course.model.q_min, course.model.q_max - q)


def _speed_fraction(course: RunCourse) -> FloatArray:
    """Commands (S, n) as fractions of what the arm allows there in their direction, no more than `_MOST`."""
    arm, q, command = course.model.description, course.q_commanded, course.command
    allowed, envelope = np.broadcast_to(arm.qd_max, q.shape), arm.envelope
    if envelope is not None:
        ahead = np.where(command > 0, envelope.q_upper - q, q - envelope.q_lower)
        falling = np.sqrt(envelope.slope * np.maximum(ahead, 0.0)) - envelope.offset
        allowed = np.minimum(allowed, np.maximum(falling, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.abs(command) / allowed
    return np.where(command == 0, 0.0, np.minimum(fraction, _MOST))


def _acceleration_fraction(course: RunCourse) -> FloatArray:
    """Changes (S, n) of the command as fractions of what the arm allows in the whole periods they took; first row NaN.

    A command is in force for a period. A step that came later, or after cycles that the recording lost, had longer.
    """
    fraction = np.full(course.command.shape, np.nan)
    period = course.of_runs(lambda run: run.profile.task.control_period_s)[1:]
    periods = np.maximum(np.round(np.diff(course.time) / period), 1.0)
    allowed = course.model.description.qdd_max * (periods * period)[:, None]
    with np.errstate(invalid="ignore"):
        fraction[1:] = np.abs(np.diff(course.command, axis=0)) / allowed
    return fraction


def limit_rows(course: RunCourse) -> tuple[list[Row], list[str]]:
    """Describe each joint beside its limits, and name the limits that were exceeded."""
    rows, exceeded = list[Row](), list[str]()
    positions = _position_margin(course, course.q_commanded), _position_margin(course, course.q)
    fractions = _speed_fraction(course), _acceleration_fraction(course)
    for j, columns in enumerate(zip(*(values.T for values in (*positions, *fractions)), strict=True), 1):
        margins = [low and low[0] for low in map(least, columns[:2])]
        speed, acceleration = map(spread, columns[2:])
        beyond = {
            "position": min((margin for margin in margins if margin is not None), default=0.0) < -_ROUNDING,
            "velocity": speed.max > 1 + _ROUNDING,
            "acceleration": acceleration.max > 1 + _ROUNDING,
        }
        exceeded += [f"{what} of joint {j}" for what, exceeds in beyond.items() if exceeds]
        texts = [number(margins[0], 3), number(margins[1], 3), percent(speed.max, 1), percent(acceleration.max, 1)]
        limits = "position", "position", "velocity", "acceleration"
        marked = [bad(text) if beyond[what] else text for what, text in zip(limits, texts, strict=True)]
        rows.append(
            {
                "joint": str(j),
                "position margin, commanded [rad]": marked[0],
                "measured [rad]": marked[1],
                "velocity, largest": marked[2],
                "velocity, 99 %": percent(speed.p99, 1),
                "acceleration, largest": marked[3],
                "acceleration, 99 %": percent(acceleration.p99, 1),
            }
        )
    return rows, exceeded


def limit_section(course: RunCourse) -> Html:
    """Each joint and its limits."""
    if not np.isfinite(_speed_fraction(course)).any():
        return element("p", "There are no commands.")
    rows, exceeded = limit_rows(course)
    verdict: Text = "No position, velocity or acceleration limit of the arm was exceeded."
    if exceeded:
        verdict = bad(f"Exceeded: {', '.join(exceeded)}.")
    note = (
        "Margin: least distance from the nearer position limit. Velocity and acceleration: joint velocity commands and"
        " their changes over the period, as fractions of what the arm allows at that position."
    )
    return joined([element("p", verdict), table(rows, note)])


class Hold(NamedTuple):
    """One stretch of HOLD by one event."""

    start: float
    """[s]"""
    duration: float
    """[s]"""
    sentence: str
    """Sentence of its first step; that of a later step may differ."""


def holds_in(course: RunCourse) -> list[Hold]:
    """Return each stretch of HOLD by one event."""
    lasted, holds = course.lasted, list[Hold]()
    holding = course.mode == MODES.index(Mode.HOLD)
    for event, steps in groupby(range(len(course)), key=lambda i: course.event[i] if holding[i] else None):
        if event is not None:
            first, *others = steps
            duration = float(lasted[[first, *others]].sum())
            holds.append(Hold(float(course.time[first]), duration, course.reason[first]))
    return holds


def time_in_modes(course: RunCourse) -> dict[Mode, tuple[float, float]]:
    """Return the time in each mode [s], and its share, 0 of a recording without any time."""
    times = {mode: float(course.lasted[course.mode == i].sum()) for i, mode in enumerate(MODES)}
    total = sum(times.values())
    return {mode: (time, time / total if total else 0.0) for mode, time in times.items()}


def mode_section(course: RunCourse) -> Html:
    """Modes of the arm, each hold, and the status of the quadratic programs."""
    modes: list[Row] = [
        {"mode": mode.name, "share": percent(share, 1), "time [s]": number(time, 2)}
        for mode, (time, share) in time_in_modes(course).items()
    ]
    outcomes: list[Row] = []
    for i, end in enumerate(OUTCOMES):
        count = int(np.sum(course.outcome == i))
        wrong = count and end in (QpOutcome.INFEASIBLE, QpOutcome.FAILED)
        outcomes.append({"quadratic program": bad(end.value) if wrong else end.value, "steps": str(count)})
    slack = spread(course.slack[course.restricted > 0])
    sentence = (
        "No obstacle restricted the arm (eqs. 5 to 7)."
        if np.isnan(slack.max)
        else "Where obstacles restricted the arm (eqs. 5 to 7), the largest violation of an approach limit in a step"
        f" had the median {slack.median:.3f}, 99 % {slack.p99:.3f} and largest value {slack.max:.3f} m/s."
    )
    parts = [element("div", joined([table(modes), table(outcomes)]), "columns"), element("p", sentence)]
    rows = [
        {
            "HOLD: reason as first said": hold.sentence,
            "from [s]": number(hold.start, 2),
            "lasted [s]": number(hold.duration, 2),
        }
        for hold in holds_in(course)
    ]
    return joined([*parts, table(rows)])


def force_section(contacts: ContactMeasures) -> Html:
    """The largest force, and the largest that lasted: for orientation, not conformity."""
    lasting = contacts.lasting
    source, unsure = "true force, as the simulation knows it", ""
    if not contacts.truth_known:
        source = "force estimate during detected contacts"
        unsure = (
            " The estimate has a bandwidth of about 10 Hz and understates the peaks of impacts, and contacts that were"
            " not detected are not in it."
        )
    later = "none" if lasting is None else f"{lasting:.1f} N"
    sentence = f"Largest {source}: {number(contacts.peak, 1)} N; later than {TRANSIENT_S:g} s into a contact: {later}."
    note = (
        "For orientation, not conformity: ISO/TS 15066 limits the one and the other by body region. Which region would"
        f" be hit, and over what area, is not known here; pressures are not looked at.{unsure}"
    )
    return joined([element("p", sentence), element("p", note, "note")])


@dataclass(frozen=True)
class Measures:
    """One recording, measured: what the sections of a report are written from."""

    title: str
    """Name of the file."""
    lacking: str
    """Sentence on the missing part of an incomplete file, or ''."""
    course: RunCourse
    contacts: ContactMeasures
    exceeded: list[str]
    """Limits of the arm that were exceeded, as "velocity of joint 2"."""


def measure(recorded: Recorded, title: str) -> Measures:
    """Measure a recording."""
    course = gather(recorded)
    lacking = "" if recorded.complete else recorded.sentence or "The file is not complete."
    return Measures(title, lacking, course, contacts_in(course), limit_rows(course)[1])
