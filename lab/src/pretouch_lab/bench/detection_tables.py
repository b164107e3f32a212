"""The detection benchmark as tables of finished text, for the terminal and the document."""

from pretouch.text_table import TextTable
from pretouch_lab.bench.contenders import BASE, WITHOUT
from pretouch_lab.bench.detection_results import (
    ABLATED_CONTACTS,
    ABLATED_FREE,
    GOAL_CONTACTS,
    GOAL_FREE,
    HARD,
    HARD_CONTACTS,
)
from pretouch_lab.bench.goals import find
from pretouch_lab.bench.scenes import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import Column, short, table

_COLUMNS = (
    Column("detector", "detector"),
    Column("false\n[1/h]", "rate"),
    Column("seen\nmedian, 95 % [ms]", "seen"),
    Column("missed", "seen_missed"),
    Column("unseen\nmedian, 95 % [ms]", "unseen"),
    Column("missed", "unseen_missed"),
)
_TOWARDS, _REACHED = Column("towards\nperson", "towards"), Column("goals\nreached", "reached")


def tables(results: Row) -> list[TextTable]:
    """Return all tables of what `results` of the JSON file says."""
    goal, rows = scenario("contacts")["goal"], results["rows"]
    names = list(dict.fromkeys(row["contender"] for row in rows))
    ablated = [name for name in names if name.startswith(WITHOUT)]
    whole = [name for name in names if name not in ablated]
    note = (
        f"Goals: at most {goal['false_alarms_per_hour']:g} false alarm an hour in free motion at"
        f" {goal['speed_m_s']:g} m/s, with or without somebody near; median delay at most"
        f" {1000 * goal['seen_delay_s']:g} ms for contacts the skin saw and {1000 * goal['unseen_delay_s']:g} ms for"
        f" others, none missed, of those of {goal['force_n']:g} N and more lasting {1000 * goal['duration_s']:g} ms and"
        " more on the links 3 to 7 and the hand, whose torques exceed three standard deviations of free motion's. Below"
        " a rate: 95 % bounds. Delay: from the true force passing 1 N, of what was detected. Towards person: the"
        " touched point would begin to move against the force on it, of all detected: none is the goal. Reached: as"
        " measured here, whatever the bounds."
    )
    judged, hard = (*_COLUMNS, _TOWARDS, _REACHED), (*_COLUMNS, _TOWARDS)  # hard arms have goals of their own
    compared = [BASE, *ablated] if ablated else []
    every = [
        table("Contact detection: the goals", judged, _judged(rows, whole, GOAL_FREE, GOAL_CONTACTS), note),
        _equal(results["curves"], whole),
        table(
            "Each switch of pretouch's detection off alone",
            judged,
            _judged(rows, compared, ABLATED_FREE, ABLATED_CONTACTS),
            f"{note} On a part of the streams: free motion of at most two arms of each path and neighbour, and the"
            " contacts at the goal's speed; pretouch here has the same. Nothing reacts in them and no arm has touch"
            " sensors, so that freeze_while_reacting and touch are not here.",
        ),
        table(
            "Arms with the flaws of real ones",
            hard,
            _judged(rows, whole, HARD, HARD_CONTACTS),
            f"{note} The world hard: friction that remembers, gears that shake, joints that ring, drift, cables,"
            " delays; contacts whose torques exceed three standard deviations of that arm's free motion.",
        ),
    ]
    return [each for each in every if each.rows]


def _texts(name: str, free: Row | None, seen: Row | None, unseen: Row | None) -> Row:
    """What each column says of a detector."""
    return {
        "detector": name,
        "rate": _rate(free),
        "seen": _delay(seen),
        "seen_missed": _missed(seen),
        "unseen": _delay(unseen),
        "unseen_missed": _missed(unseen),
    }


def _judged(rows: list[Row], names: list[str], free: str, contacts: str) -> list[Row]:
    """Return what the table of the goals says of each detector, in scenarios of free motion and of contacts."""
    lines = []
    for name in names:
        alarms, seen, unseen = (
            find(rows, name, free),
            find(rows, name, contacts, True),
            find(rows, name, contacts, False),
        )
        there = [row for row in (seen, unseen) if row]
        detected, against = (
            sum(row["contacts"] - row["missed"] for row in there),
            sum(row["towards"] for row in there),
        )
        judged = {"towards": f"{against}/{detected}", "reached": reached(alarms, seen, unseen)}
        lines.append(_texts(name, alarms, seen, unseen) | judged)
    return lines


def reached(free: Row | None, seen: Row | None, unseen: Row | None) -> str:
    """Name the goals that a detector reached: its rate of false alarms, delays of what was seen or not, direction."""
    goal = scenario("contacts")["goal"]
    names = ["rate"] if free and free["false_alarms_per_hour"] <= goal["false_alarms_per_hour"] else []
    for name, row in (("seen", seen), ("unseen", unseen)):
        if row and row["contacts"] and not row["missed"] and row["median_delay_s"] <= goal[f"{name}_delay_s"]:
            names.append(name)
    there = [row for row in (seen, unseen) if row]
    if there and not any(row["towards"] for row in there):
        names.append("direction")
    return "\n".join(names) or "none"


def _equal(curves: list[Row], names: list[str]) -> TextTable:
    """Each detector with the value of its sweep at which it keeps the goal of false alarms, and what it has then."""
    limit = scenario("contacts")["goal"]["false_alarms_per_hour"]
    quiet: dict[str, Row] = {}
    for point in curves:
        if point.get("false_alarms_per_hour", limit + 1.0) <= limit:
            quiet.setdefault(point["contender"], point)
    lines = []
    for name in names:
        point = quiet.get(name, {})
        at = f"{point['f_base_n']:g} N" if "f_base_n" in point else f"x {point['scale']:g}" if point else "none"
        lines.append(_texts(name, point or None, point.get("seen"), point.get("unseen")) | {"at": at})
    return table(
        "The same with as many false alarms as allowed",
        (_COLUMNS[0], Column("at", "at"), *_COLUMNS[1:]),
        lines,
        f"Each detector at the smallest value of its swept parameter at which it has at most {limit:g} false alarm an"
        " hour: the base force F_b, or a factor on the evidence that makes an alarm. Chosen with hindsight on the same"
        " streams, so it flatters all of them alike.",
    )


def _rate(row: Row | None) -> str:
    if row is None:
        return "-"
    value, low, high = (short(row[key]) for key in ("false_alarms_per_hour", "low_per_hour", "high_per_hour"))
    return f"{value}\n{low}-{high}"


def _delay(row: Row | None) -> str:
    if row is None or not row["contacts"]:
        return "-"
    return ", ".join("-" if row[key] is None else f"{1000 * row[key]:.0f}" for key in ("median_delay_s", "p95_delay_s"))


def _missed(row: Row | None) -> str:
    if row is None or not row["contacts"]:
        return "-"
    return f"{row['missed']}/{row['contacts']}" + (f"\n{row['busy']} busy" if row["busy"] else "")
