"""How near the commands came to the arm's limits; modes, holds, and how the quadratic programs ended."""

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from pretouch.recording.run_record import MODES
from pretouch.reporting.html import Html, Text, bad, element, joined, number, percent, table
from pretouch.reporting.record import OUTCOMES, Percentiles, RunCourse, least, spread
from pretouch.types import FloatArray, Mode, QpOutcome

_MOST = 1000.0
"""Fraction that stands for more, as of a command where the arm allows none."""
_ROUNDING = 1e-9
"""What a fraction may exceed 1 by, or a margin lie below 0 [rad], as nothing but rounding."""
_HOLDS = 30
"""Holds that are listed."""


@dataclass(frozen=True)
class JointMargin:
    """One joint and its limits."""

    margin: float | None
    """Least distance of the commanded position from the nearer limit [rad]."""
    margin_measured: float | None
    """The same of the measured position [rad]."""
    speed: Percentiles | None
    """Command as a fraction of the largest speed the arm allows at that position."""
    acceleration: Percentiles | None
    """Change of the command as a fraction of the largest acceleration the arm allows."""

    @property
    def violations(self) -> tuple[str, ...]:
        """Which limits were exceeded."""
        margins = [margin for margin in (self.margin, self.margin_measured) if margin is not None]
        exceeded = {
            "position": min(margins, default=0.0) < -_ROUNDING,
            "velocity": self.speed is not None and self.speed.max > 1 + _ROUNDING,
            "acceleration": self.acceleration is not None and self.acceleration.max > 1 + _ROUNDING,
        }
        return tuple(name for name, beyond in exceeded.items() if beyond)


def limit_margins(course: RunCourse) -> tuple[JointMargin, ...]:
    """Each joint of the arm."""
    columns = zip(
        position_margin(course, course.q_commanded).T,
        position_margin(course, course.q).T,
        speed_fraction(course).T,
        acceleration_fraction(course).T,
        strict=True,
    )
    return tuple(
        JointMargin(_least(commanded), _least(measured), spread(speed), spread(acceleration))
        for commanded, measured, speed, acceleration in columns
    )


def _least(values: FloatArray) -> float | None:
    low = least(values)
    return low and low[0]


def position_margin(course: RunCourse, q: FloatArray) -> FloatArray:
    """Distance (S, n) of positions from the nearer limit of each joint [rad], negative beyond it."""
    return np.minimum(q - course.model.q_min, course.model.q_max - q)


def speed_fraction(course: RunCourse) -> FloatArray:
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


def acceleration_fraction(course: RunCourse) -> FloatArray:
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


def limit_section(joints: tuple[JointMargin, ...]) -> Html:
    """Each joint and its limits."""
    if not any(joint.speed for joint in joints):
        return element("p", "There are no commands.")

    def marked(joint: JointMargin, name: str, text: str) -> Text:
        return bad(text) if name in joint.violations else text

    columns = [
        ("joint", lambda row: str(row[0])),
        ("position margin, commanded [rad]", lambda row: marked(row[1], "position", number(row[1].margin, 3))),
        ("measured [rad]", lambda row: marked(row[1], "position", number(row[1].margin_measured, 3))),
        ("velocity, largest", lambda row: marked(row[1], "velocity", _percent(row[1].speed, "max"))),
        ("99 %", lambda row: _percent(row[1].speed, "p99")),
        ("acceleration, largest", lambda row: marked(row[1], "acceleration", _percent(row[1].acceleration, "max"))),
        ("99 %", lambda row: _percent(row[1].acceleration, "p99")),
    ]
    exceeded = violations(joints)
    verdict: Text = "No position, velocity or acceleration limit of the arm was exceeded."
    if exceeded:
        verdict = bad(f"Exceeded: {', '.join(exceeded)}.")
    note = (
        "Margin: least distance from the nearer position limit. Velocity and acceleration: joint velocity commands and"
        " their changes over the period, as fractions of what the arm allows at that position."
    )
    return joined([element("p", verdict), table(columns, enumerate(joints, 1), note)])


def violations(joints: tuple[JointMargin, ...]) -> list[str]:
    """Limits that were exceeded, by joint."""
    return [f"{name} of joint {j}" for j, joint in enumerate(joints, 1) for name in joint.violations]


def _percent(values: Percentiles | None, which: str) -> str:
    return percent(getattr(values, which, None), 1)


@dataclass(frozen=True)
class Hold:
    """One stretch of HOLD by one event."""

    start: float
    """[s]"""
    duration: float
    """[s]"""
    sentence: str
    """Of its first step; what it says of a later one may differ."""


@dataclass(frozen=True)
class States:
    """Modes and solver of a recording."""

    time: dict[Mode, float]
    """Time in each mode [s]."""
    holds: tuple[Hold, ...]
    outcomes: dict[QpOutcome, int]
    """Steps by how their quadratic program ended."""
    slack: Percentiles | None
    """Largest violation of an approach row in the steps that had any row [m/s]."""

    @property
    def share(self) -> dict[Mode, float]:
        """Share of each mode, 0 of a recording without any time."""
        total = sum(self.time.values())
        return {mode: lasted / total if total else 0.0 for mode, lasted in self.time.items()}


def states(course: RunCourse) -> States:
    """Modes, holds and solver outcomes of a recording."""
    lasted, holds = course.lasted, list[Hold]()
    holding = course.mode == MODES.index(Mode.HOLD)
    for event, steps in groupby(range(len(course)), key=lambda i: course.event[i] if holding[i] else None):
        if event is not None:
            first, *others = steps
            duration = float(lasted[[first, *others]].sum())
            holds.append(Hold(float(course.time[first]), duration, course.reason[first]))
    return States(
        time={mode: float(lasted[course.mode == i].sum()) for i, mode in enumerate(MODES)},
        holds=tuple(holds),
        outcomes={outcome: int(np.sum(course.outcome == i)) for i, outcome in enumerate(OUTCOMES)},
        slack=spread(course.slack[course.restricted > 0]),
    )


def mode_section(s: States) -> Html:
    """What the arm was doing, each hold, and how the quadratic programs ended."""
    modes = [
        ("mode", lambda mode: mode.name),
        ("share", lambda mode: percent(s.share[mode], 1)),
        ("time [s]", lambda mode: number(s.time[mode], 2)),
    ]
    bad_ends = (QpOutcome.INFEASIBLE, QpOutcome.FAILED)
    outcomes = [
        ("quadratic program", lambda end: bad(end.value) if s.outcomes[end] and end in bad_ends else end.value),
        ("steps", lambda end: str(s.outcomes[end])),
    ]
    slack = (
        "No obstacle restricted the arm (eqs. 5 to 7)."
        if s.slack is None
        else "Where obstacles restricted the arm (eqs. 5 to 7), the largest violation of an approach limit in a step"
        f" had the median {s.slack.median:.3f}, 99 % {s.slack.p99:.3f} and largest value {s.slack.max:.3f} m/s."
    )
    parts = [
        element("div", joined([table(modes, Mode), table(outcomes, s.outcomes)]), "columns"),
        element("p", slack),
    ]
    if s.holds:
        rest = s.holds[_HOLDS:]
        more = f"{len(rest)} more holds, {sum(hold.duration for hold in rest):.2f} s together." if rest else ""
        holds = [
            ("HOLD: reason as first said", lambda hold: hold.sentence),
            ("from [s]", lambda hold: number(hold.start, 2)),
            ("lasted [s]", lambda hold: number(hold.duration, 2)),
        ]
        parts.append(table(holds, s.holds[:_HOLDS], more))
    return joined(parts)
