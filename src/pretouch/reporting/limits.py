"""How near the commands came to the arm's limits; modes, holds, and how the quadratic programs ended."""

from itertools import groupby
from typing import NamedTuple

import numpy as np

from pretouch.recording.run_record import MODES
from pretouch.reporting.html import Html, Row, Text, bad, element, joined, number, percent, table
from pretouch.reporting.record import OUTCOMES, RunCourse, least, spread
from pretouch.types import FloatArray, Mode, QpOutcome

_MOST = 1000.0
"""Fraction that stands for more, as of a command where the arm allows none."""
_ROUNDING = 1e-9
"""What a fraction may exceed 1 by, or a margin lie below 0 [rad], as nothing but rounding."""
_HOLDS = 30
"""Holds that are listed."""


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
    exceeded: list[str] = []

    def marked(what: str, joint: int, text: str, beyond: bool) -> Text:
        name = f"{what} of joint {joint}"
        if beyond and name not in exceeded:
            exceeded.append(name)
        return bad(text) if name in exceeded else text

    rows: list[Row] = []
    positions = _position_margin(course, course.q_commanded), _position_margin(course, course.q)
    fractions = _speed_fraction(course), _acceleration_fraction(course)
    for j, columns in enumerate(zip(*(values.T for values in (*positions, *fractions)), strict=True), 1):
        commanded, measured = (low and low[0] for low in map(least, columns[:2]))
        speed, acceleration = map(spread, columns[2:])
        beyond = min((margin for margin in (commanded, measured) if margin is not None), default=0.0) < -_ROUNDING
        fast = speed.max > 1 + _ROUNDING
        sudden = acceleration.max > 1 + _ROUNDING
        rows.append(
            {
                "joint": str(j),
                "position margin, commanded [rad]": marked("position", j, number(commanded, 3), beyond),
                "measured [rad]": marked("position", j, number(measured, 3), beyond),
                "velocity, largest": marked("velocity", j, percent(speed.max, 1), fast),
                "velocity, 99 %": percent(speed.p99, 1),
                "acceleration, largest": marked("acceleration", j, percent(acceleration.max, 1), sudden),
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
    """Of its first step; what it says of a later one may differ."""


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
    """What the arm was doing, each hold, and how the quadratic programs ended."""
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
    holds = holds_in(course)
    rest = holds[_HOLDS:]
    more = f"{len(rest)} more holds, {sum(hold.duration for hold in rest):.2f} s together." if rest else ""
    rows = [
        {
            "HOLD: reason as first said": hold.sentence,
            "from [s]": number(hold.start, 2),
            "lasted [s]": number(hold.duration, 2),
        }
        for hold in holds[:_HOLDS]
    ]
    return joined([*parts, table(rows, more)])
