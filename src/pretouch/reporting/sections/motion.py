"""Sections about distances, speeds, limits and modes."""

from pretouch.reporting.html import Html, Text, bad, element, facts, joined, note, number, percent, table
from pretouch.reporting.limits import JointMargin
from pretouch.reporting.measures import Measures
from pretouch.reporting.numbers import Spread
from pretouch.types import Mode

_HOLDS = 30
"""Holds that are listed."""


def distance_section(m: Measures) -> Html:
    """Least distances by unit and by link, and how long something was near."""
    d = m.distances
    if not m.course.proximity_used:
        return element("p", "Proximity was not used: the profile leaves the units aside.")
    if d.body is None or d.ee is None:
        return element("p", "Nothing was sensed." if m.course.units else "The arm wears no unit: nothing is sensed.")
    rows: list[list[Text]] = [
        [name, number(n.distance if n else None, 3), number(n.time if n else None, 2)]
        for name, n in zip(m.course.units, d.units, strict=True)
    ]
    links: list[list[Text]] = [[n.name, number(n.distance, 3), number(n.time, 2)] for n in d.links]
    near = facts([
        ("nearest to the body", f"{d.body.distance:.3f} m, shown by {d.body.name} at {d.body.time:.2f} s"),
        ("nearest to the end-effector's origin", f"{d.ee.distance:.3f} m at {d.ee.time:.2f} s"),
        ("body nearer than d_crit", f"{d.below_crit_s:.2f} s"),
        ("body nearer than d_notice", f"{d.below_notice_s:.2f} s"),
        ("end-effector's origin nearer than d_max", f"{d.within_d_max_s:.2f} s"),
    ])  # fmt: skip
    return joined([
        near,
        element("div", joined([
            table(("unit", "least distance of what it showed [m]", "at [s]"), rows),
            table(("link, where it was the closest", "least distance [m]", "at [s]"), links),
        ]), "columns"),
        note(
            "Distances are of sensed points from the surface of the body, negative in penetration. What no unit showed"
            " is not in them; the units measure nothing below 0.04 m and hold such an obstacle there."
        ),
    ])  # fmt: skip


def speed_section(m: Measures) -> Html:
    """How fast the end-effector went, and when."""
    s = m.speeds
    spreads = {
        "whole recording": s.all, "TRACK, nothing within d_max": s.free, "anything within d_max": s.near,
        **{mode.name: s.by_mode[mode] for mode in Mode},
    }  # fmt: skip
    rows: list[list[Text]] = [[name, *_spread(spread, 3)] for name, spread in spreads.items()]
    said = (
        f"While following the path the speed factor (eqs. 3 and 4) had the median {number(s.median_factor, 2)} and the"
        f" least value {number(s.least_factor, 2)}; it was below 0.99 for {percent(s.slowed)} of the steps."
    )
    return joined([
        table(("end-effector speed [m/s]", "median", "99 %", "largest"), rows),
        element("p", said if s.median_factor is not None else "The arm never followed its path."),
    ])  # fmt: skip


def limit_section(m: Measures) -> Html:
    """Each joint and its limits."""
    if not any(joint.speed for joint in m.joints):
        return element("p", "There are no commands.")
    head = (
        "joint", "position margin, commanded [rad]", "measured [rad]", "velocity, largest", "99 %",
        "acceleration, largest", "99 %",
    )  # fmt: skip
    rows = [_joint(i, joint) for i, joint in enumerate(m.joints, 1)]
    if m.violations:
        verdict: Text = bad(f"Exceeded: {', '.join(m.violations)}.")
    else:
        verdict = "No position, velocity or acceleration limit of the arm was exceeded."
    return joined([
        element("p", verdict),
        table(head, rows),
        note(
            "Margin: least distance from the nearer position limit. Velocity and acceleration: joint velocity commands"
            " and their changes over the period, as fractions of what the arm allows at that position."
        ),
    ])  # fmt: skip


def _joint(order: int, joint: JointMargin) -> list[Text]:
    wrong = joint.violations

    def marked(text: str, name: str) -> Text:
        return bad(text) if name in wrong else text

    speed, change = joint.speed, joint.acceleration
    return [
        str(order),
        marked(number(joint.margin, 3), "position"), marked(number(joint.margin_measured, 3), "position"),
        marked(percent(speed.max if speed else None, 1), "velocity"), percent(speed.p99 if speed else None, 1),
        marked(percent(change.max if change else None, 1), "acceleration"), percent(change.p99 if change else None, 1),
    ]  # fmt: skip


def mode_section(m: Measures) -> Html:
    """What the arm was doing, each hold, and how the quadratic programs ended."""
    s = m.states
    rows: list[list[Text]] = [
        [mode.name, percent(s.share[mode], 1), number(s.time[mode], 2)] for mode in Mode
    ]  # fmt: skip
    outcomes: list[list[Text]] = [
        [_marked_outcome(outcome.value, count), str(count)] for outcome, count in s.outcomes.items()
    ]  # fmt: skip
    parts = [
        element("div", joined([
            table(("mode", "share", "time [s]"), rows),
            table(("quadratic program", "steps"), outcomes),
        ]), "columns"),
        _slack(s.slack),
    ]  # fmt: skip
    if s.holds:
        holds: list[list[Text]] = [
            [hold.sentence, number(hold.start, 2), number(hold.duration, 2)] for hold in s.holds[:_HOLDS]
        ]  # fmt: skip
        parts.append(table(("HOLD: reason as first said", "from [s]", "lasted [s]"), holds))
    if len(s.holds) > _HOLDS:
        rest = s.holds[_HOLDS:]
        parts.append(note(f"{len(rest)} more holds, {sum(hold.duration for hold in rest):.2f} s together."))
    return joined(parts)


def _marked_outcome(name: str, count: int) -> Text:
    return bad(name) if count and name in ("infeasible", "failed") else name


def _slack(slack: Spread | None) -> Html:
    if slack is None:
        return element("p", "No obstacle restricted the arm (eqs. 5 to 7).")
    return element(
        "p",
        f"Where obstacles restricted the arm (eqs. 5 to 7), the largest violation of an approach limit in a step had"
        f" the median {slack.median:.3f}, 99 % {slack.p99:.3f} and largest value {slack.max:.3f} m/s.",
    )


def _spread(spread: Spread | None, digits: int, factor: float = 1.0) -> list[Text]:
    if spread is None:
        return [number(None, 0)] * 3
    return [number(value, digits, factor) for value in (spread.median, spread.p99, spread.max)]
